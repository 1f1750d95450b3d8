"""The pass for zeta: how a support that follows the density changes the potential (eq 304)."""

from numba import njit

from sph.compiled import COMPILED, INLINED, smaller
from sph.formulations.gas.weighting import mass_per_weight
from sph.kernels import enclosed_over_q3, potential_depth
from sph.neighbours.order import BLOCK
from sph.passes.active import any_active, is_active
from sph.passes.gather import (
    TINY,
    copy_box,
    copy_values,
    largest_of,
    longest_list,
    middle,
    near_blocks,
    near_particles,
    own_box,
    place_block,
    scratch,
    unit,
    unpacked,
)
from sph.simd import (
    at,
    dot,
    filled,
    inverse_sqrt,
    lane_sum,
    load,
    load_spatial,
    minus,
    times,
    width,
)


@njit(**COMPILED)
def find_zeta(
    first, last, dim, models, neighbours, position, mass, support, density, omega, zeta
):  # fmt: skip
    """Write zeta/Omega (N,), of eq 304, for superblocks [first, last).

    0 where the support is limited to max_support, and so does not follow the density.
    """
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    fields = dim + (0,)  # noqa: RUF005
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        if not any_active(neighbours.active, i_0, i_end):
            continue
        x_0 = middle(dim, neighbours, begin, end)
        per_length = unit(largest_of(support, i_0, i_end))
        per_mass = unit(largest_of(mass, i_0, i_end))
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, 0.0)
            to = t * len(fields) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            copy_values(lanes, copied, to + D * BLOCK, mass, block, per_mass)
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            if not any_active(neighbours.active, i_first, i_last):
                continue
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            nc = near_particles(
                lanes, dim, copied, fields, 0, chosen, blocks, low, high, reach, near
            )
            for i in range(i_first, i_last):
                if not is_active(neighbours.active, i):
                    continue
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                H_inv = 1.0 / (support[i] * per_length)
                slope = _by_support(lanes, dim, models.kernel, near, nc, x_i, H_inv)
                # dH/dn = -H/(D n), with n = rho w/m; the rest turns the units of the superblock
                n = density[i] / mass_per_weight(models.weighting, mass[i])
                per_n = -support[i] / (D * n * omega[i])
                follows = 1.0 if support[i] < models.max_support else 0.0
                zeta[i] = follows * per_n * slope * (per_length * per_length / per_mass)


@njit(**INLINED)
def _by_support(lanes, dim, kernel, near, nc, x_i, H_inv):
    """Return the sum of m_j dphi(r_ij, H_i)/dH_i over candidates (eq 302), with G = 1."""
    total = filled(lanes, 0.0)
    for k in range(0, nc, width(lanes)):
        r = minus(x_i, load_spatial(lanes, dim, near, 0, k))
        squared = dot(r, r) + TINY
        q = smaller(squared * inverse_sqrt(squared) * H_inv, 1.0)
        change = potential_depth(kernel, q) - q * q * enclosed_over_q3(kernel, q)
        total += load(lanes, near, (len(dim), k)) * change
    return H_inv * H_inv * lane_sum(total)
