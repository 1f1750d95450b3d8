"""The rate pass: acceleration and du/dt (eqs 22-26), with the pair force of the scheme."""

import numpy as np
from numba import njit, types
from numba.extending import overload

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.formulations.gas.schemes import pair
from sph.formulations.gas.terms import exchange_speed, pair_alpha
from sph.formulations.gas.weighting import by_share
from sph.kernels import force_over_q, normalisation
from sph.neighbours.order import BLOCK
from sph.passes.active import any_active, is_active
from sph.passes.gather import (
    TINY,
    also,
    copy_box,
    copy_values,
    copy_vectors,
    largest_of,
    load_of,
    longest_list,
    middle,
    near_blocks,
    near_particles,
    own_box,
    place_block,
    read,
    scratch,
    unit,
    unpacked,
    value_of,
)
from sph.simd import (
    any_lane,
    at,
    block_width,
    dot,
    filled,
    inverse_sqrt,
    lane_max,
    lane_sum,
    lane_sums,
    load,
    load_spatial,
    minus,
    plus,
    put,
    select,
    store,
    times,
    width,
    zeros,
)

# Quantities of candidates after position and velocity.
RHO, P_TERM, C_S, H_INV, M_HALF, M_GRADIENT, NEXT = 0, 1, 2, 3, 4, 5, 6


@njit(**COMPILED)
def rates(
    first, last, dim, models, neighbours, position, velocity, mass, energy, support, density,
    pressure_term, sound_speed, alpha, balsara, pressure, energy_shift, exchanged, shares,
    acceleration, energy_rate, signal_speed,
):  # fmt: skip
    """Rate pass over superblocks [first, last): eqs 22-26.

    Writes acceleration (D, N), energy_rate (N,) and signal_speed (N,), the largest v_sig of each
    particle over its pairs and itself (eq 32). An array is None if the scene does not need it:
    alpha (if constant), balsara, pressure, energy_shift (of schemes that sum the pressure),
    exchanged (the internal energy, for conductivity), shares (for switched conductivity).
    """
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    kernel, weighting, viscosity = models.kernel, models.weighting, models.viscosity
    C = normalisation(kernel, dim)
    rest = 2 * D
    fields = dim + dim + (0, 0, 0, 0, 0, 0)
    with_alpha = also(fields, alpha, (0,))
    with_f = also(with_alpha, balsara, (0,))
    with_u = also(with_f, pressure, (0, 0))
    with_share = also(with_u, shares, (0,))
    every = also(with_share, energy_shift, (0,))
    a_row, f_row, u_row = len(fields), len(with_alpha), len(with_f)
    share_row, shift_row = len(with_u), len(with_share)
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(every))
    used = empty(near.shape[1] // width(lanes), np.int64)
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        if not any_active(neighbours.active, i_0, i_end):
            continue
        x_0, v_0 = middle(dim, neighbours, begin, end), at(dim, velocity, i_0)
        per_length = unit(largest_of(support, i_0, i_end))
        per_velocity = unit(largest_of(sound_speed, i_0, i_end))
        per_mass = unit(largest_of(mass, i_0, i_end))
        per_density = per_mass / per_length**D
        per_energy = per_velocity * per_velocity  # per unit mass
        # P/(Omega rho^2); where terms are multiplied by energies, without their unit
        per_term = per_energy / per_density
        if energy_shift is not None:
            per_term = 1.0 / per_density
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            to = t * len(every) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            to += D * BLOCK
            copy_vectors(
                lanes, dim, copied, to, velocity, block, neighbours, image, v_0, per_velocity
            )
            to += D * BLOCK
            copy_values(lanes, copied, to, density, block, per_density)
            copy_values(lanes, copied, to + P_TERM * BLOCK, pressure_term, block, per_term)
            copy_values(lanes, copied, to + C_S * BLOCK, sound_speed, block, per_velocity)
            H = _copy_slopes(
                lanes, dim, copied, to + H_INV * BLOCK, support, mass, block, per_length,
                0.5 * C * per_mass,
            )  # fmt: skip
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, H)
            to += NEXT * BLOCK
            to = copy_values(lanes, copied, to, alpha, block, 1.0)
            to = copy_values(lanes, copied, to, balsara, block, 0.5)
            if pressure is not None:
                to = copy_values(lanes, copied, to, energy, block, per_energy)
                to = copy_values(lanes, copied, to, pressure, block, per_energy * per_density)
            to = copy_values(lanes, copied, to, shares, block, 0.5)
            copy_values(lanes, copied, to, energy_shift, block, per_energy)
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            if not any_active(neighbours.active, i_first, i_last):
                continue
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            nc = near_particles(
                lanes, dim, copied, every, rest + H_INV, chosen, blocks, low, high, reach, near
            )
            store(near, (rest + M_HALF, nc), filled(lanes, 1.0))  # a weighting divides by masses
            for i in range(i_first, i_last):
                if not is_active(neighbours.active, i):
                    continue
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                v_i = times(minus(at(dim, velocity, i), v_0), per_velocity)
                rho_i, c_i = density[i] * per_density, sound_speed[i] * per_velocity
                rho_inv_i = 1.0 / rho_i
                P_term_i = pressure_term[i] * per_term
                H_inv_i = 1.0 / (support[i] * per_length)
                gradient_i = H_inv_i ** (D + 2)
                m_half_i = 0.5 * C * mass[i] * per_mass
                total = zeros(lanes, dim)
                gained = filled(lanes, 0.0)
                fastest = filled(lanes, 0.0)
                near_i = _within(lanes, dim, near, nc, rest + H_INV, x_i, H_inv_i, used)
                for index in range(near_i):
                    k = used[index]
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    v_ij = minus(v_i, load_spatial(lanes, dim, near, D, k))
                    squared = dot(r_ij, r_ij) + TINY
                    v_dot_r = dot(v_ij, r_ij)
                    rho_j = load(lanes, near, (rest + RHO, k))
                    rho_sum = 1.0 + rho_j * rho_inv_i  # over rho_i, lest its square underflow
                    # one root serves 1/r and 1/(rho_i + rho_j)
                    inverse = inverse_sqrt(squared * (rho_sum * rho_sum))
                    r_inv = inverse * rho_sum
                    r = squared * r_inv
                    w_ij = smaller(v_dot_r, 0.0) * r_inv  # eq 26
                    v_sig = c_i + load(lanes, near, (rest + C_S, k)) - 3.0 * w_ij  # eq 25
                    m_half = load(lanes, near, (rest + M_HALF, k))
                    slope_i = m_half * gradient_i * force_over_q(kernel, dim, r * H_inv_i)
                    q_j = r * load(lanes, near, (rest + H_INV, k))
                    m_gradient = load(lanes, near, (rest + M_GRADIENT, k))
                    slope_j = m_gradient * force_over_q(kernel, dim, q_j)
                    # eq 24: alpha/2 v_sig w_ij/rho_ij with rho_ij = (rho_i + rho_j)/2
                    alpha_j = load_of(alpha, lanes, near, a_row, k)
                    alpha_ij = pair_alpha(viscosity, value_of(alpha, i), alpha_j)
                    Pi = (v_sig * w_ij) * (inverse * r) * (-rho_inv_i * alpha_ij)
                    if balsara is not None:
                        Pi *= 0.5 * balsara[i] + load(lanes, near, (f_row, k))
                    term_i, term_j = _terms(
                        energy_shift, weighting, P_term_i, load(lanes, near, (rest + P_TERM, k)),
                        value_of(energy, i) * per_energy, load_of(pressure, lanes, near, u_row, k),
                        value_of(energy_shift, i) * per_energy,
                        load_of(energy_shift, lanes, near, shift_row, k), m_half_i, m_half,
                    )  # fmt: skip
                    force, work = pair(models.scheme, term_i, term_j, slope_i, slope_j, Pi)
                    gained += work * v_dot_r
                    if exchanged is not None:
                        P_i = pressure[i] * (per_energy * per_density)
                        speed = exchange_speed(
                            models.exchange, P_i, load(lanes, near, (u_row + 1, k)), rho_i, rho_j,
                            w_ij,
                        )  # fmt: skip
                        # Price (2008) eq 27: over rho_ij = (rho_i + rho_j)/2
                        jump = exchanged[i] * per_energy - load(lanes, near, (u_row, k))
                        exchange = speed * jump * (2.0 * rho_inv_i) * (inverse * r)
                        if shares is not None:
                            exchange *= 0.5 * shares[i] + load(lanes, near, (share_row, k))
                        gained += (slope_i + slope_j) * r * exchange  # slope r is m_j dW/dr
                    fastest = larger(fastest, select(slope_i + slope_j < 0.0, v_sig, 0.0))
                    total = plus(total, times(r_ij, force))
                put(acceleration, i, times(lane_sums(total), -per_length / per_energy))
                energy_rate[i] = lane_sum(gained) * (per_length / (per_energy * per_velocity))
                signal_speed[i] = lane_max(fastest) / per_velocity


def _terms(
    energy_shift, weighting, term_i, term_j, u_i, u_j, shift_i, shift_j, mass_i, mass_j
):  # fmt: skip
    """Return the pressure terms of a pair, see `schemes` and `weighting`."""


@overload(_terms, jit_options=INLINED)  # type: ignore[arg-type]
def _pressure_terms(
    energy_shift, weighting, term_i, term_j, u_i, u_j, shift_i, shift_j, mass_i, mass_j
):  # fmt: skip
    def shared(
        energy_shift, weighting, term_i, term_j, u_i, u_j, shift_i, shift_j, mass_i, mass_j
    ):  # fmt: skip
        return by_share(weighting, term_i, term_j, mass_i, mass_j)

    def of_energies(
        energy_shift, weighting, term_i, term_j, u_i, u_j, shift_i, shift_j, mass_i, mass_j
    ):  # fmt: skip
        f_i, f_j = by_share(weighting, shift_i, shift_j, mass_i, mass_j)
        return term_i * (u_j - f_i), term_j * (u_i - f_j)

    is_summed = not isinstance(energy_shift, types.NoneType | types.Omitted)
    return of_energies if is_summed else shared


@njit(**INLINED)
def _within(lanes, dim, near, nc, h_row, x_i, H_inv_i, used):
    """Write to `used` where groups of lanes with a neighbour begin; return their number.

    Candidates are in the order of space, so that a third of the groups has no neighbour.
    """
    number = 0
    for k in range(0, nc, width(lanes)):
        r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
        H_inv = smaller(H_inv_i, load(lanes, near, (h_row, k)))
        used[number] = k
        number += any_lane(dot(r_ij, r_ij) * H_inv * H_inv < 1.0)
    return number


@njit(**INLINED)
def _copy_slopes(lanes, dim, copied, begin, support, mass, block, per_length, per_mass):
    """Copy 1/H, C m/2 and C m/2 H^-(D+2) of a block; return the largest H."""
    largest = 0.0
    for lane in range(0, BLOCK, block_width(lanes)):
        H = read(lanes, support, block, lane, 0.0) * per_length
        H_inv = inverse_sqrt(H * H)  # large outside the array, where H = 0
        m_half = read(lanes, mass, block, lane, 0.0) * per_mass
        gradient = m_half * H_inv * H_inv * H_inv
        for _ in range(len(dim) - 1):
            gradient = gradient * H_inv
        store(copied, begin + lane, H_inv)
        store(copied, begin + (M_HALF - H_INV) * BLOCK + lane, m_half)
        store(copied, begin + (M_GRADIENT - H_INV) * BLOCK + lane, gradient)
        largest = max(largest, lane_max(H))
    return largest
