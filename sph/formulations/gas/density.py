"""The density pass: eqs 7-8 and 15-17, and the pressure sum of schemes that need one.

Sums over candidates are in the units of the superblock (`sph.passes.gather`).
"""

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED
from sph.formulations.gas.smoothing import ROWS, WEIGHT, R, find_support
from sph.formulations.gas.thermodynamics import summed, thermodynamics
from sph.formulations.gas.weighting import copy_weights, mass_per_weight, weight
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.passes.active import is_active
from sph.passes.gather import (
    FAR,
    TINY,
    also,
    copy_box,
    copy_products,
    copy_vectors,
    fastest,
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
    count,
    cross,
    curl_dim,
    dot,
    filled,
    front,
    inverse_sqrt,
    lane_sum,
    lane_sums,
    load,
    load_spatial,
    minus,
    pick,
    pick_spatial,
    plus,
    rows,
    store,
    store_spatial,
    times,
    width,
    zeros,
)

# Candidates of a particle are first selected within this multiple of its support radius before the
# step, and within the reach of the lists if the new support radius is larger.
MARGIN = 1.02


# Further rows of the candidates of one particle: v_ij . r_ij, m_j u_j, v_ij x r_ij.
V_DOT_R, MU, CURL = 2, 3, 4


@njit(**COMPILED)
def density(
    first, last, dim, models, neighbours, position, velocity, mass, energy, support_before, alpha,
    support, rho, Omega, pressure, energy_shift, div_v, curl_v, pressure_term, sound_speed, balsara,
    alpha_rate, wanted,
):  # fmt: skip
    """Density pass over superblocks [first, last), with the quantities that follow from it.

    wanted (blocks,): see `sph.passes.Sweep`. A particle whose support was not found gets a density
    of -1. An array is None if the scene does not need it: pressure, energy_shift (of schemes that
    sum the pressure), div_v, curl_v, balsara, alpha and alpha_rate.
    """
    D, lanes = len(dim), neighbours.lanes
    weighting, lists = models.weighting, neighbours.lists
    # position, weight, velocity, m u; Numba does not know (*dim, 0)
    fields = also(also(dim + (0,), div_v, dim), energy_shift, (0,))  # noqa: RUF005
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    # the particles of a block are treated together unless their candidates fill the nearest cache
    group = BLOCK if D < 3 else 1
    pairs = rows(lanes, group * ROWS, near.shape[1])
    members, n = empty(BLOCK, np.int64), empty(BLOCK, np.int64)
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        if not _any(wanted, begin, end):
            continue
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        x_0, v_0 = middle(dim, neighbours, begin, end), at(dim, velocity, i_0)
        per_length = unit(largest_of(support_before, i_0, i_end))
        # beside fast neighbours, gas at rest must not have the unit of its round-off
        thermal = np.sqrt(max(0.0, largest_of(energy, i_0, i_end)))
        per_velocity = unit(max(fastest(dim, velocity, i_0, i_end), thermal))
        per_mass = unit(weight(weighting, largest_of(mass, i_0, i_end)))
        per_energy = per_mass * unit(largest_of(energy, i_0, i_end))
        per_density = per_mass / per_length**D
        listed = lists.count[superblock]
        for t in range(listed):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, 0.0)
            to = t * len(fields) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            copy_weights(lanes, copied, to + D * BLOCK, weighting, mass, block, per_mass)
            if div_v is not None:
                after = to + (D + 1) * BLOCK
                copy_vectors(
                    lanes, dim, copied, after, velocity, block, neighbours, image, v_0, per_velocity
                )
            if energy_shift is not None:
                last_field = to + (len(fields) - 1) * BLOCK
                copy_products(lanes, copied, last_field, mass, energy, block, per_energy)
        for block in range(begin, end):
            if wanted[block] == 0.0:
                continue
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            number = 0
            for i in range(i_first, i_last):
                if is_active(neighbours.active, i):
                    members[number] = i
                    number += 1
            for attempt in range(2):
                farthest = 0.0
                for i in range(i_first, i_last):
                    farthest = max(farthest, _reach(attempt, support_before, neighbours, i))
                farthest *= per_length
                blocks = near_blocks(lanes, dim, boxes, listed, low, high, farthest, chosen)
                nc = near_particles(
                    lanes, dim, copied, fields, 0, chosen, blocks, low, high, farthest, near
                )
                wanted[block] = 0.0
                unsettled = 0
                for first_member in range(0, number, group):
                    in_group = min(group, number - first_member) if group > 1 else 1
                    for p in range(in_group):
                        i = members[first_member + p]
                        reach = _reach(attempt, support_before, neighbours, i) * per_length
                        x_i = times(minus(at(dim, position, i), x_0), per_length)
                        v_i = times(minus(at(dim, velocity, i), v_0), per_velocity)
                        n[p] = _select(
                            lanes, dim, near, nc, len(fields) - 1, x_i, v_i, reach, div_v,
                            curl_v, energy_shift, pairs, p * ROWS,
                        )  # fmt: skip
                    for p in range(in_group):
                        _take_roots(lanes, pairs, p * ROWS, n[p])
                    for p in range(in_group):
                        i = members[first_member + p]
                        reach = _reach(attempt, support_before, neighbours, i) * per_length
                        H, n_i, Omega_i, needed = find_support(
                            models.smoothing, lanes, models.kernel, dim, pairs, p * ROWS, n[p],
                            weight(weighting, mass[i]) * per_mass, support_before[i] * per_length,
                            models.support_ratio * models.eta, reach,
                            models.max_support * per_length,
                        )  # fmt: skip
                        rho_i = n_i / per_density * mass_per_weight(weighting, mass[i])
                        support[i], rho[i], Omega[i] = H / per_length, rho_i, Omega_i
                        if needed > 0.0:
                            members[unsettled] = i  # for the second attempt
                            unsettled += 1
                            needed /= per_length * neighbours.list_support[i]
                            wanted[block] = max(wanted[block], needed)
                            continue
                        H_inv = 1.0 / H
                        if energy_shift is not None:
                            E, slope = _energy_density(
                                lanes, models.kernel, dim, pairs, p * ROWS, n[p], H_inv
                            )
                            scale = per_length**D / per_energy
                            summed(
                                i, models, energy, scale * E, scale * slope / (Omega_i * rho_i),
                                pressure, pressure_term, energy_shift,
                            )  # fmt: skip
                        if div_v is not None:
                            scale = per_length / (per_velocity * Omega_i * n_i)
                            div, curl = _motion(
                                lanes, models.kernel, dim, pairs, p * ROWS, n[p], H_inv, curl_v
                            )
                            div_v[i] = scale * div
                            if curl_v is not None:
                                curl_v[i] = scale * curl
                number = unsettled
                if number == 0:
                    break
            thermodynamics(
                lanes, models, block, energy, support, rho, Omega, div_v, curl_v, alpha,
                energy_shift, pressure, pressure_term, sound_speed, balsara, alpha_rate,
                neighbours.active,
            )  # fmt: skip


@njit(**INLINED)
def _any(wanted, first, last):
    """Return whether one of the blocks [first, last) is wanted."""
    found = False
    for block in range(first, last):
        found = found or wanted[block] != 0.0
    return found


@njit(**INLINED)
def _reach(attempt, support_before, neighbours, i):
    """Return the radius within which candidates of particle i are selected."""
    complete = neighbours.reach_factor * neighbours.list_support[i]
    return complete if attempt > 0 else min(MARGIN * support_before[i], complete)


@njit(**INLINED)
def _select(
    lanes, dim, near, nc, mu_row, x_i, v_i, reach, div_v, curl_v, energy_shift, pairs, row
):  # fmt: skip
    """Write the candidates within reach of particle i to the rows from `row` of `pairs`.

    Returns their number. The row R receives squares of distances. The arrays div_v, curl_v and
    energy_shift are None if their rows are not needed.
    """
    D = len(dim)
    n = 0
    for k in range(0, nc, width(lanes)):
        r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
        squared = dot(r_ij, r_ij)
        inside = squared < reach * reach
        chosen = front(lanes, inside)
        store(pairs, (row + R, n), pick(squared, chosen))
        store(pairs, (row + WEIGHT, n), pick(load(lanes, near, (D, k)), chosen))
        if div_v is not None:
            v_ij = minus(v_i, load_spatial(lanes, dim, near, D + 1, k))
            store(pairs, (row + V_DOT_R, n), pick(dot(v_ij, r_ij), chosen))
            if curl_v is not None:
                store_spatial(pairs, row + CURL, n, pick_spatial(cross(v_ij, r_ij), chosen))
        if energy_shift is not None:
            store(pairs, (row + MU, n), pick(load(lanes, near, (mu_row, k)), chosen))
        n += count(inside)
    store(pairs, (row + R, n), filled(lanes, FAR))
    for one in range(1, ROWS):
        store(pairs, (row + one, n), filled(lanes, 0.0))
    return n


@njit(**INLINED)
def _take_roots(lanes, pairs, row, n):
    """Replace squares of distances by distances, in the row R of a particle."""
    for k in range(0, n, width(lanes)):
        squared = load(lanes, pairs, (row + R, k))
        # 0 for particles in one place, which no support radius separates
        store(pairs, (row + R, k), squared * inverse_sqrt(squared + TINY))


@njit(**INLINED)
def _energy_density(lanes, kernel, dim, pairs, row, n, H_inv):
    """Return E = sum m_j u_j W_ij(H_i) and H/D dE/dH (by eq 10)."""
    sum_w = filled(lanes, 0.0)
    sum_dw = filled(lanes, 0.0)
    for k in range(0, n, width(lanes)):
        q = load(lanes, pairs, (row + R, k)) * H_inv
        mu = load(lanes, pairs, (row + MU, k))
        sum_w += mu * w(kernel, dim, q)
        sum_dw += mu * (q * q) * dw_over_q(kernel, dim, q)
    scale = normalisation(kernel, dim) * H_inv ** len(dim)
    E = scale * lane_sum(sum_w)
    return E, -(E + scale * lane_sum(sum_dw) / len(dim))


@njit(**INLINED)
def _motion(lanes, kernel, dim, pairs, row, n, H_inv, curl_v):
    """Return Omega n div v and Omega n |curl v| (eqs 16-17); curl_v is None without the curl.

    The sign in eq 16 is a misprint: v_ij = v_i - v_j.
    """
    D = len(dim)
    total = filled(lanes, 0.0)
    curls = zeros(lanes, curl_dim(dim))
    for k in range(0, n, width(lanes)):
        q = load(lanes, pairs, (row + R, k)) * H_inv
        m_dw = load(lanes, pairs, (row + WEIGHT, k)) * dw_over_q(kernel, dim, q)
        total += m_dw * load(lanes, pairs, (row + V_DOT_R, k))
        if curl_v is not None:
            curls = plus(
                curls, times(load_spatial(lanes, curl_dim(dim), pairs, row + CURL, k), m_dw)
            )
    scale = normalisation(kernel, dim) * H_inv ** (D + 2)
    curl = lane_sums(curls)
    return -scale * lane_sum(total), scale * np.sqrt(dot(curl, curl))
