"""The gradient pass: kernel correction, velocity gradient and rate of density (eqs 402-407)."""

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED
from sph.formulations.continuum.matter import (
    H_INV,
    VOLUME,
    H,
    copy_matter,
    of_pair,
    power,
)
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.passes.gather import (
    fastest,
    largest_of,
    longest_list,
    middle,
    near_blocks,
    near_particles,
    own_box,
    scratch,
    unit,
    unpacked,
)
from sph.simd import (
    at,
    filled,
    full_dim,
    lane_sum,
    lane_sums,
    load,
    load_spatial,
    minus,
    outer,
    plus,
    symmetric_dim,
    symmetric_outer,
    times,
    width,
    zeros,
)

# Ratio of volumes half a step ago and now below which eq 416 is not used.
LEAST_VOLUME = 0.1

# Condition number of M above which order 1 falls back to order 0; relative to the identity, M is
# zero below the inverse of this number.
SINGULAR = 1e6


@njit(**COMPILED)
def gradients(
    first, last, dim, models, neighbours, position, velocity, mass, density, support, before,
    kernel_factor, kernel_gradient, kernel_matrix, velocity_gradient, div_v, density_rate, dt,
):  # fmt: skip
    """Gradient pass over superblocks [first, last): eqs 402-407 and 416.

    Reads the velocity (D, N) in the middle of the step of length dt, the predicted density (N,) and
    the density (N,) `before` the step. Writes velocity_gradient (D, D, N), div_v (N,) and
    density_rate (N,) in the middle of the step, and the correction of the kernel, of which the
    arrays are None that its order does not need: order 0 has kernel_factor (N,) and kernel_gradient
    (D, N), order 1 has kernel_matrix (D, D, N) and kernel_gradient, which is not zero where it
    falls back to order 0.
    """
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    kernel, sym, full = models.kernel, symmetric_dim(dim), full_dim(dim)
    C = normalisation(kernel, dim)
    rest = 2 * D
    fields = dim + dim + (0, 0, 0)
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    M, B, L = empty((D, D), np.float64), empty((D, D), np.float64), empty((D, D), np.float64)
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        x_0, v_0 = middle(dim, neighbours, begin, end), at(dim, velocity, i_0)
        per_length = unit(largest_of(support, i_0, i_end))
        per_velocity = unit(fastest(dim, velocity, i_0, i_end))
        per_rate = per_velocity / per_length
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            to = t * len(fields) * BLOCK
            copy_matter(
                lanes, dim, copied, to, boxes, t, block, neighbours, image, position, velocity,
                mass, density, support, x_0, v_0, per_length, per_velocity, C,
            )  # fmt: skip
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            nc = near_particles(
                lanes, dim, copied, fields, rest + H_INV, chosen, blocks, low, high, reach, near
            )
            for i in range(i_first, i_last):
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                v_i = times(minus(at(dim, velocity, i), v_0), per_velocity)
                H_i = support[i] * per_length
                volume = filled(lanes, 0.0)  # sum V_j W_j
                slope = zeros(lanes, dim)  # sum V_j grad W_j
                mixed = zeros(lanes, dim)  # sum V_j W_j v_ij
                moments = zeros(lanes, sym)  # sum V_j grad W_j (x) r_ij
                shear = zeros(lanes, full)  # sum V_j v_ij (x) grad W_j
                for k in range(0, nc, width(lanes)):
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    v_ij = minus(v_i, load_spatial(lanes, dim, near, D, k))
                    q, H_inv = of_pair(lanes, r_ij, H_i, load(lanes, near, (rest + H, k)))
                    V_j = load(lanes, near, (rest + VOLUME, k)) * power(dim, H_inv)
                    F = V_j * H_inv * H_inv * dw_over_q(kernel, dim, q)
                    gradient = times(r_ij, F)
                    shear = plus(shear, outer(v_ij, gradient))
                    if kernel_gradient is not None:
                        W = V_j * w(kernel, dim, q)
                        volume += W
                        slope = plus(slope, gradient)
                        mixed = plus(mixed, times(v_ij, W))
                    if kernel_matrix is not None:
                        moments = plus(moments, symmetric_outer(gradient, r_ij))
                # L of eq 405 without its sign, first uncorrected
                _fill_full(M, lane_sums(shear))
                if kernel_gradient is None:
                    _negate(M, L)
                else:
                    alpha = 1.0 / lane_sum(volume)
                    grad_alpha = times(lane_sums(slope), -alpha * alpha)  # eq 403
                    is_regular = False
                    if kernel_matrix is not None:
                        _fill_symmetric(B, lane_sums(moments))
                        is_regular = inverted(B)  # eq 404
                    if is_regular:
                        grad_alpha = times(grad_alpha, 0.0)
                        _times_matrix(M, B, L)
                    else:
                        _corrected(M, alpha, lane_sums(mixed), grad_alpha, L)
                    for d in range(D):
                        kernel_gradient[d, i] = grad_alpha[d] * per_length
                    if kernel_factor is not None:
                        kernel_factor[i] = alpha
                    if kernel_matrix is not None:
                        for a in range(D):
                            for b in range(D):
                                identity = alpha if a == b else 0.0
                                kernel_matrix[a, b, i] = B[a, b] if is_regular else identity
                _centred(L, B, M, 0.5 * dt / per_rate)
                divergence = 0.0
                for a in range(D):
                    divergence += M[a, a] / per_rate
                    for b in range(D):
                        velocity_gradient[a, b, i] = M[a, b] / per_rate
                div_v[i] = divergence
                growth = np.expm1(-divergence * dt) / dt if dt > 0.0 else -divergence
                density_rate[i] = before[i] * growth  # eq 407


# --- small matrices (D, D) ---


@njit(**INLINED)
def _fill_full(matrix, parts):
    D = matrix.shape[0]
    for a in range(D):
        for b in range(D):
            matrix[a, b] = parts[a * D + b]


@njit(**INLINED)
def _fill_symmetric(matrix, parts):
    """Set a matrix to minus the symmetric tensor with these components."""
    k = 0
    for a in range(matrix.shape[0]):
        for b in range(a, matrix.shape[0]):
            matrix[a, b] = matrix[b, a] = -parts[k]
            k += 1


@njit(**INLINED)
def _negate(M, L):
    for a in range(M.shape[0]):
        for b in range(M.shape[0]):
            L[a, b] = -M[a, b]


@njit(**INLINED)
def _times_matrix(M, B, L):
    """Set L to -M B, eq 405 at order 1."""
    D = M.shape[0]
    for a in range(D):
        for b in range(D):
            total = 0.0
            for c in range(D):
                total += M[a, c] * B[c, b]
            L[a, b] = -total


@njit(**INLINED)
def _corrected(M, alpha, mixed, grad_alpha, L):
    """Set L to eq 405 at order 0."""
    D = M.shape[0]
    for a in range(D):
        for b in range(D):
            L[a, b] = -alpha * M[a, b] - mixed[a] * grad_alpha[b]


@njit(**INLINED)
def _centred(L, B, M, half):
    """Set M to L (I - half L)^-1, eq 416; B is overwritten.

    M is L where half a step backwards would turn the matter inside out, or nearly so.
    """
    D = L.shape[0]
    for a in range(D):
        for b in range(D):
            B[a, b] = (1.0 if a == b else 0.0) - half * L[a, b]
    if D == 1:
        determinant = B[0, 0]
        adjugate = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    elif D == 2:
        determinant = B[0, 0] * B[1, 1] - B[0, 1] * B[1, 0]
        adjugate = (B[1, 1], -B[0, 1], -B[1, 0], B[0, 0], 0.0, 0.0, 0.0, 0.0, 0.0)
    else:
        adjugate = (
            B[1, 1] * B[2, 2] - B[1, 2] * B[2, 1],
            B[0, 2] * B[2, 1] - B[0, 1] * B[2, 2],
            B[0, 1] * B[1, 2] - B[0, 2] * B[1, 1],
            B[1, 2] * B[2, 0] - B[1, 0] * B[2, 2],
            B[0, 0] * B[2, 2] - B[0, 2] * B[2, 0],
            B[0, 2] * B[1, 0] - B[0, 0] * B[1, 2],
            B[1, 0] * B[2, 1] - B[1, 1] * B[2, 0],
            B[0, 1] * B[2, 0] - B[0, 0] * B[2, 1],
            B[0, 0] * B[1, 1] - B[0, 1] * B[1, 0],
        )
        determinant = B[0, 0] * adjugate[0] + B[0, 1] * adjugate[3] + B[0, 2] * adjugate[6]
    is_regular = determinant > LEAST_VOLUME
    for a in range(D):
        for b in range(D):
            total = 0.0
            for c in range(D):
                total += L[a, c] * adjugate[c * D + b]
            M[a, b] = total / determinant if is_regular else L[a, b]


@njit(**INLINED)
def inverted(matrix):
    """Replace a symmetric matrix (D, D) by its inverse, unless it is singular; return whether.

    That is, unless its norm is below 1/SINGULAR, which is small beside the identity, or its
    condition number is above SINGULAR. The norm is that of Frobenius; in 1-D the condition number
    of any other number is 1.
    """
    D = matrix.shape[0]
    norm = 0.0
    for a in range(D):
        for b in range(D):
            norm += matrix[a, b] ** 2
    if not norm * SINGULAR * SINGULAR > 1.0:
        return False
    if D == 1:
        matrix[0, 0] = 1.0 / matrix[0, 0]
        return True
    other = 0.0
    if D == 2:
        a, b, c = matrix[0, 0], matrix[0, 1], matrix[1, 1]
        determinant = a * c - b * b
        inverse = (c, -b, a, 0.0, 0.0, 0.0)
        other = c * c + 2.0 * b * b + a * a
    else:
        a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
        d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
        inverse = (
            d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b
        )  # fmt: skip
        determinant = a * inverse[0] + b * inverse[1] + c * inverse[2]
        for k in range(6):
            other += inverse[k] ** 2 * (1.0 if k == 0 or k == 3 or k == 5 else 2.0)
        # Of neighbours on a line, such as a lone pair, adjugate and determinant are both round-off,
        # and their ratio looks regular. The adjugate has the two largest of the singular values.
        if not norm * norm < SINGULAR * SINGULAR * other:
            return False
    # condition number |M| |M^-1|, squared, with M^-1 = adjugate/determinant
    if not norm * other < (SINGULAR * determinant) ** 2:
        return False
    k = 0
    for p in range(D):
        for q in range(p, D):
            matrix[p, q] = matrix[q, p] = inverse[k] / determinant
            k += 1
    return True
