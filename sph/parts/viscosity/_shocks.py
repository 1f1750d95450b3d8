"""The pass for velocity gradients, for viscosity switches that detect shocks by them.

Gradients are those of Cullen & Dehnen (2010, appendix B): with r = r_i - r_j and weights
g_j = -w_j (dW/dr)/r (w_j the mass, or 1: `weighting`), the matrix sum g v_ij r^T times the inverse
of sum g r r^T is exact for linear fields. d(div v)/dt = div a - tr(L L), with L the velocity
gradient, uses the acceleration of the last step. (The difference of div v over a step is
unsuitable: in a step cut for an output, the difference between prediction and correction does not
shrink with the step.)
"""

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED, larger, smaller, verb
from sph.formulations.gas.weighting import copy_weights, mass_per_weight, weight
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.passes.active import any_active, is_active, step_of
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
    count,
    dot,
    filled,
    front,
    inverse_sqrt,
    lane_max,
    lane_sum,
    load,
    load_spatial,
    minus,
    pick_spatial,
    rows,
    select,
    store,
    store_spatial,
    times,
    width,
)

# A pivot below this fraction of the trace means that neighbours lie on a line or in a plane. The
# gradient is then undefined and set to zero.
SINGULAR = 1e-6


@verb
def alpha_after(
    self, alpha, dt, support, signal_speed, divergence, divergence_rate, shear, signs
):  # fmt: skip
    return self.alpha_after(
        alpha, dt, support, signal_speed, divergence, divergence_rate, shear, signs
    )  # fmt: skip


alpha_after.takes_vectors = False  # type: ignore[attr-defined]


@njit(**INLINED)
def _invert(matrix, inverse):
    """Write the inverse of a symmetric positive (D, D) matrix, zero if singular (Gauss-Jordan).

    Positive matrices need no pivoting. `matrix` is overwritten.
    """
    D = matrix.shape[0]
    trace = 0.0
    for a in range(D):
        trace += matrix[a, a]
        for b in range(D):
            inverse[a, b] = 1.0 if a == b else 0.0
    for a in range(D):
        if not matrix[a, a] > SINGULAR * trace:
            inverse[:] = 0.0
            return
        scale = 1.0 / matrix[a, a]
        for c in range(D):
            matrix[a, c] *= scale
            inverse[a, c] *= scale
        for b in range(D):
            factor = matrix[b, a]
            if b != a:
                for c in range(D):
                    matrix[b, c] -= factor * matrix[a, c]
                    inverse[b, c] -= factor * inverse[a, c]


@njit(**COMPILED)
def shocks(
    first, last, dim, models, neighbours, position, velocity, mass, support, density, sound_speed,
    div_v, acceleration, alpha, dt,
):  # fmt: skip
    """Advance alpha (N,) by the step dt, in place, over superblocks [first, last).

    dt: one step, or (N,) with individual steps.

    `velocity` is the predicted velocity; `div_v` (N,) comes from the density pass, `acceleration`
    (D, N) from the last step.
    """
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    kernel, weighting, viscosity = models.kernel, models.weighting, models.viscosity
    C = normalisation(kernel, dim)
    # rows of candidates: position, velocity, acceleration, weight, its sign, c/2
    m_row, signed_row, c_row = 3 * D, 3 * D + 1, 3 * D + 2
    fields = dim + dim + dim + (0, 0, 0)
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    # rows of neighbours: r_ij/H, g r_ij/H, v_ij, a_ij
    pairs = rows(lanes, 4 * D, near.shape[1])
    matrix = empty((D, D), np.float64)
    inverse = empty((D, D), np.float64)
    L = empty((D, D), np.float64)
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        if not any_active(neighbours.active, i_0, i_end):
            continue
        x_0, v_0, a_0 = (
            at(dim, position, i_0), at(dim, velocity, i_0), at(dim, acceleration, i_0)
        )  # fmt: skip
        per_length = unit(largest_of(support, i_0, i_end))
        per_velocity = unit(largest_of(sound_speed, i_0, i_end))
        per_mass = unit(weight(weighting, largest_of(mass, i_0, i_end)))
        per_rate = per_velocity / per_length
        per_acceleration = per_velocity * per_rate
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
            copy_vectors(
                lanes, dim, copied, to + 2 * D * BLOCK, acceleration, block, neighbours, image, a_0,
                per_acceleration,
            )  # fmt: skip
            copy_weights(lanes, copied, to + m_row * BLOCK, weighting, mass, block, per_mass)
            _copy_signs(
                lanes, copied, to + signed_row * BLOCK, weighting, mass, div_v, block, per_mass
            )
            copy_values(lanes, copied, to + c_row * BLOCK, sound_speed, block, 0.5 * per_velocity)
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
                a_i = times(minus(at(dim, acceleration, i), a_0), per_acceleration)
                H_inv = 1.0 / (support[i] * per_length)
                c_half_i = 0.5 * sound_speed[i] * per_velocity
                signs = filled(lanes, 0.0)
                fastest = filled(lanes, 0.0)
                n = 0
                for k in range(0, nc, width(lanes)):
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    v_ij = minus(v_i, load_spatial(lanes, dim, near, D, k))
                    a_ij = minus(a_i, load_spatial(lanes, dim, near, 2 * D, k))
                    squared = dot(r_ij, r_ij) + TINY
                    r_inv = inverse_sqrt(squared)
                    q = squared * r_inv * H_inv
                    signs += load(lanes, near, (signed_row, k)) * w(kernel, dim, q)
                    w_ij = smaller(dot(v_ij, r_ij), 0.0) * r_inv
                    v_sig = c_half_i + load(lanes, near, (c_row, k)) - w_ij  # eq 76
                    fastest = larger(fastest, select(q < 1.0, v_sig, 0.0))
                    # the sums below are faster over neighbours only, about half of the candidates
                    inside = front(lanes, q < 1.0)
                    g = load(lanes, near, (m_row, k)) * -dw_over_q(kernel, dim, q)
                    r_over_H = times(r_ij, H_inv)
                    store_spatial(pairs, 0, n, pick_spatial(r_over_H, inside))
                    store_spatial(pairs, D, n, pick_spatial(times(r_over_H, g), inside))
                    store_spatial(pairs, 2 * D, n, pick_spatial(v_ij, inside))
                    store_spatial(pairs, 3 * D, n, pick_spatial(a_ij, inside))
                    n += count(q < 1.0)
                for row in range(4 * D):
                    store(pairs, (row, n), filled(lanes, 0.0))
                sign = lane_sum(signs) * mass_per_weight(weighting, mass[i]) / density[i]
                sign *= C * (H_inv * per_length) ** D / per_mass  # eq 73
                for s in range(D):
                    for t in range(s, D):
                        matrix[s, t] = _product(lanes, pairs, s, D + t, n)
                        matrix[t, s] = matrix[s, t]
                _invert(matrix, inverse)
                divergence_rate = 0.0
                for s in range(D):
                    for t in range(D):
                        matrix[s, t] = _product(lanes, pairs, 2 * D + s, D + t, n)
                        from_a = _product(lanes, pairs, 3 * D + s, D + t, n)
                        divergence_rate += from_a * inverse[t, s] * H_inv
                divergence = 0.0
                for s in range(D):
                    for t in range(D):
                        total = 0.0
                        for k in range(D):
                            total += matrix[s, k] * inverse[k, t]
                        L[s, t] = total * H_inv
                    divergence += L[s, s]
                shear = 0.0
                for s in range(D):
                    for t in range(D):
                        divergence_rate -= L[s, t] * L[t, s]
                        strain = 0.5 * (L[s, t] + L[t, s])
                        if s == t:
                            strain -= divergence / D
                        shear += strain * strain
                rates = per_rate * per_rate
                alpha[i] = alpha_after(
                    viscosity, alpha[i], step_of(dt, i), support[i],
                    lane_max(fastest) / per_velocity, divergence / per_rate,
                    divergence_rate / rates, shear / rates, sign,
                )  # fmt: skip


@njit(**INLINED)
def _copy_signs(lanes, copied, begin, weighting, mass, div_v, block, factor):
    """Copy the weights of a block, times the sign of div v and factor, to `copied`."""
    for lane in range(0, BLOCK, block_width(lanes)):
        div = read(lanes, div_v, block, lane, 0.0)
        sign = select(div > 0.0, 1.0, 0.0) - select(div < 0.0, 1.0, 0.0)
        w_j = weight(weighting, read(lanes, mass, block, lane, 0.0))  # div v is 0 outside the array
        store(copied, begin + lane, sign * w_j * factor)


@njit(**INLINED)
def _product(lanes, pairs, a, b, n):
    """Return the sum of the products of two rows over n neighbours."""
    total = filled(lanes, 0.0)
    for k in range(0, n, width(lanes)):
        total += load(lanes, pairs, (a, k)) * load(lanes, pairs, (b, k))
    return lane_sum(total)
