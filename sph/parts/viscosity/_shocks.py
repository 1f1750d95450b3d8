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

from sph.compiled import COMPILED, INLINED, larger, smaller, verb
from sph.formulations.gas.weighting import mass_per_weight, weight
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.passes import TINY
from sph.passes.gather import copy_in, most_candidates, place_in, unpacked

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
    first_block, last_block, dim, models, neighbours, position, velocity, mass, support, density,
    sound_speed, div_v, acceleration, alpha, dt,
):  # fmt: skip
    """Advance alpha (N,) by the step dt, in place, over blocks [first_block, last_block).

    `velocity` is the predicted velocity; `div_v` (N,) comes from the density pass, `acceleration`
    (D, N) from the last step.
    """
    D = len(dim)
    kernel, weighting, viscosity = models.kernel, models.weighting, models.viscosity
    start, count, candidates = neighbours.lists
    sign, offset = neighbours.images
    C = normalisation(kernel, dim)
    size = most_candidates(first_block, last_block, count)
    x = np.empty((D, size))
    v = np.empty((D, size))
    a = np.empty((D, size))
    m = np.empty(size)
    c_half = np.empty(size)
    signed = np.empty(size)
    q = np.empty(size)
    weights = np.empty(size)
    # differences between one particle and its neighbours
    near = np.empty(size, np.int64)
    r_ij = np.empty((D, size))
    v_ij = np.empty((D, size))
    a_ij = np.empty((D, size))
    g_r = np.empty((D, size))  # g r_ij
    matrix = np.empty((D, D))
    inverse = np.empty((D, D))
    L = np.empty((D, D))
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            j, image = unpacked(candidates[start[block] + k])
            place_in(x, k, position, j, dim, sign, offset, image)
            copy_in(v, k, velocity, j, dim, sign, image)
            copy_in(a, k, acceleration, j, dim, sign, image)
            m[k] = weight(weighting, mass[j])
            c_half[k] = 0.5 * sound_speed[j]
            signed[k] = m[k] * np.sign(div_v[j])
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            H_inv = 1.0 / support[i]
            c_half_i = 0.5 * sound_speed[i]
            signs = 0.0
            fastest = 0.0
            for k in range(nc):
                squared = TINY
                v_dot_r = 0.0
                for d in range(D):
                    r_d = position[d, i] - x[d, k]
                    squared += r_d * r_d
                    v_dot_r += (velocity[d, i] - v[d, k]) * r_d
                r = np.sqrt(squared)
                q[k] = r * H_inv
                weights[k] = -m[k] * dw_over_q(kernel, dim, r * H_inv)
                signs += signed[k] * w(kernel, dim, r * H_inv)
                v_sig = c_half_i + c_half[k] - smaller(v_dot_r, 0.0) / r  # eq 76
                fastest = larger(fastest, v_sig if r * H_inv < 1.0 else 0.0)
            # Only a third of the candidates are neighbours: the sums below are faster over a copy.
            n = 0
            for k in range(nc):
                near[n] = k
                n += q[k] < 1.0
            for d in range(D):
                for k in range(n):
                    r_ij[d, k] = (position[d, i] - x[d, near[k]]) * H_inv
                    g_r[d, k] = weights[near[k]] * r_ij[d, k]
                    v_ij[d, k] = velocity[d, i] - v[d, near[k]]
                    a_ij[d, k] = acceleration[d, i] - a[d, near[k]]
            signs *= mass_per_weight(weighting, mass[i]) * C * H_inv**D / density[i]  # eq 73
            for s in range(D):
                for t in range(s, D):
                    total = 0.0
                    for k in range(n):
                        total += r_ij[s, k] * g_r[t, k]
                    matrix[s, t] = matrix[t, s] = total
            _invert(matrix, inverse)
            divergence_rate = 0.0
            for s in range(D):
                for t in range(D):
                    total = total_a = 0.0
                    for k in range(n):
                        total += v_ij[s, k] * g_r[t, k]
                        total_a += a_ij[s, k] * g_r[t, k]
                    matrix[s, t] = total
                    divergence_rate += total_a * inverse[t, s] * H_inv
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
            alpha[i] = alpha_after(
                viscosity, alpha[i], dt, support[i], fastest, divergence, divergence_rate, shear,
                signs,
            )  # fmt: skip
