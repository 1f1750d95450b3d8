"""The pass for the Laplacian of u, for conductivity that is limited to contacts.

lap u = 2 sum m_j/rho_j (u_i - u_j) (dW/dr)/r, as in Price & Monaghan (2005) after Brookshaw (1985).
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.kernels import dw_over_q, normalisation
from sph.neighbours.order import BLOCK
from sph.passes.active import any_active, is_active
from sph.passes.gather import (
    TINY,
    copy_box,
    copy_values,
    copy_vectors,
    largest_of,
    longest_list,
    near_blocks,
    near_particles,
    own_box,
    place_block,
    read,
    scratch,
    unit,
    unpacked,
)
from sph.simd import (
    at,
    block_width,
    dot,
    filled,
    inverse_sqrt,
    lane_max,
    lane_sum,
    load,
    load_spatial,
    minus,
    select,
    store,
    times,
    width,
)

COLD = 1e-300  # gives 0 instead of 0/0 in uniform cold gas


@njit(**INLINED)
def share(h, laplacian, energy, signal_speed):
    """Return the fraction of the conductivity that acts on a particle, 0 to 1.

    The coefficient of Price (2008; Price & Monaghan 2005) grows at 0.1 h |lap u| / sqrt(u) and
    decays in the time h/(0.1 v_sig), with h the smoothing length. Here it is the balance of growth
    and decay, which needs no evolved quantity and acts at once on new contacts, while a jump of
    pressure still drives the exchange.
    """
    return smaller(h * h * abs(laplacian) / (signal_speed * np.sqrt(energy) + COLD), 1.0)


# Quantities of candidates after position and velocity.
U, VOLUME, C_HALF = 0, 1, 2


@njit(**COMPILED)
def contacts(
    first, last, dim, models, neighbours, position, velocity, mass, energy, support, density,
    sound_speed, shares,
):  # fmt: skip
    """Write the fractions (N,) of conductivity that act, for superblocks [first, last).

    v_sig is the largest (c_i + c_j)/2 - w_ij within the particle's support. `velocity` and `energy`
    are the predicted values.
    """
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    kernel, support_ratio = models.kernel, models.support_ratio
    C = normalisation(kernel, dim)
    rest = 2 * D
    fields = dim + dim + (0, 0, 0)
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        if not any_active(neighbours.active, i_0, i_end):
            continue
        x_0, v_0 = at(dim, position, i_0), at(dim, velocity, i_0)
        per_length = unit(largest_of(support, i_0, i_end))
        per_velocity = unit(largest_of(sound_speed, i_0, i_end))
        per_energy = per_velocity * per_velocity
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, 0.0)
            to = t * len(fields) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            copy_vectors(
                lanes,
                dim,
                copied,
                to + D * BLOCK,
                velocity,
                block,
                neighbours,
                image,
                v_0,
                per_velocity,
            )
            copy_values(lanes, copied, to + (rest + U) * BLOCK, energy, block, per_energy)
            copy_values(
                lanes, copied, to + (rest + C_HALF) * BLOCK, sound_speed, block, 0.5 * per_velocity
            )
            _copy_volumes(
                lanes, copied, to + (rest + VOLUME) * BLOCK, mass, density, block, per_length**D
            )
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
                v_i = times(minus(at(dim, velocity, i), v_0), per_velocity)
                H_inv = 1.0 / (support[i] * per_length)
                c_half_i, u_i = 0.5 * sound_speed[i] * per_velocity, energy[i] * per_energy
                fastest = filled(lanes, 0.0)
                total = filled(lanes, 0.0)
                for k in range(0, nc, width(lanes)):
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    v_ij = minus(v_i, load_spatial(lanes, dim, near, D, k))
                    squared = dot(r_ij, r_ij) + TINY
                    r_inv = inverse_sqrt(squared)
                    q = squared * r_inv * H_inv
                    w_ij = smaller(dot(v_ij, r_ij), 0.0) * r_inv
                    v_sig = c_half_i + load(lanes, near, (rest + C_HALF, k)) - w_ij
                    fastest = larger(fastest, select(q < 1.0, v_sig, 0.0))
                    jump = u_i - load(lanes, near, (rest + U, k))
                    volume = load(lanes, near, (rest + VOLUME, k))
                    total += volume * jump * dw_over_q(kernel, dim, q)
                laplacian = 2.0 * C * H_inv ** (D + 2) * lane_sum(total)
                h = support[i] * per_length / support_ratio
                shares[i] = share(h, laplacian, u_i, lane_max(fastest))


@njit(**INLINED)
def _copy_volumes(lanes, copied, begin, mass, density, block, factor):
    """Copy m/rho of a block to `copied`, times factor."""
    for lane in range(0, BLOCK, block_width(lanes)):
        m = read(lanes, mass, block, lane, 0.0)
        store(copied, begin + lane, m / read(lanes, density, block, lane, 1.0) * factor)
