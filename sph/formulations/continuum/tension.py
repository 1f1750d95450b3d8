"""Tensor of the tensile correction: the tensile principal stresses, with a factor (eq 436).

Monaghan (2000), J. Comput. Phys. 159, 290; with principal stresses Gray, Monaghan & Swift (2001),
Comput. Methods Appl. Mech. Eng. 190, 6641. In 1-D and 2-D the principal stresses are those in the
space of the particles.
"""

import numpy as np
from numba import njit

from sph.compiled import INLINED, larger

# Sweeps of Jacobi's method; convergence is cubic, and symmetric 3 x 3 matrices take 4 to 6.
MAX_SWEEPS = 12

# An entry off the diagonal below this part of the diagonal changes no principal stress.
ROUND_OFF = 1e-17


@njit(**INLINED)
def tensile(dim, strength, stress, i, scratch, tensor):
    """Write R = -strength max(0, sigma) of particle i, with max(0, ) of each principal stress.

    stress, tensor: (D, D, N); scratch: (2, 3, 3) in 3-D, else unused.
    """
    D = len(dim)
    if D == 1:
        tensor[0, 0, i] = -strength * larger(stress[0, 0, i], 0.0)
    elif D == 2:
        _tensile_2(strength, stress, i, tensor)
    else:
        _tensile_3(strength, stress, i, scratch[0], scratch[1], tensor)


@njit(**INLINED)
def _tensile_2(strength, stress, i, tensor):
    """As `tensile`, in closed form."""
    xx, yy = stress[0, 0, i], stress[1, 1, i]
    xy = 0.5 * (stress[0, 1, i] + stress[1, 0, i])
    mean, apart = 0.5 * (xx + yy), 0.5 * (xx - yy)
    radius = np.sqrt(apart * apart + xy * xy)
    high, low = mean + radius, mean - radius
    if low >= 0.0:  # sigma itself
        xx, xy, yy = -strength * xx, -strength * xy, -strength * yy
    elif high > 0.0:
        # high (sigma - low I)/(high - low), the part of one principal direction
        share = 0.5 * strength * high / radius
        xx, xy, yy = -share * (radius + apart), -share * xy, -share * (radius - apart)
    else:
        xx = xy = yy = 0.0
    tensor[0, 0, i], tensor[1, 1, i] = xx, yy
    tensor[0, 1, i] = tensor[1, 0, i] = xy


@njit(**INLINED)
def _tensile_3(strength, stress, i, matrix, axes, tensor):
    """As `tensile`; matrix, axes: (3, 3) of scratch."""
    for a in range(3):
        for b in range(3):
            matrix[a, b] = 0.5 * (stress[a, b, i] + stress[b, a, i])
            axes[a, b] = 1.0 if a == b else 0.0
    _diagonalise(matrix, axes)
    for a in range(3):
        for b in range(a, 3):
            total = 0.0
            for k in range(3):
                total += larger(matrix[k, k], 0.0) * axes[a, k] * axes[b, k]
            tensor[a, b, i] = tensor[b, a, i] = -strength * total


@njit(**INLINED)
def _diagonalise(matrix, axes):
    """Rotate a symmetric (3, 3) matrix to its principal axes, the columns of `axes` (Jacobi)."""
    for _ in range(MAX_SWEEPS):
        if matrix[0, 1] == 0.0 and matrix[0, 2] == 0.0 and matrix[1, 2] == 0.0:
            return
        for p in range(2):
            for q in range(p + 1, 3):
                _annihilate(matrix, axes, p, q)


@njit(**INLINED)
def _annihilate(matrix, axes, p, q):
    """Rotate so that matrix[p, q] is zero."""
    mixed = matrix[p, q]
    if abs(mixed) <= ROUND_OFF * (abs(matrix[p, p]) + abs(matrix[q, q])):
        matrix[p, q] = matrix[q, p] = 0.0
        return
    apart = 0.5 * (matrix[q, q] - matrix[p, p]) / mixed
    slope = np.sqrt(apart * apart + 1.0) + abs(apart)
    slope = 1.0 / slope if apart >= 0.0 else -1.0 / slope
    cosine = 1.0 / np.sqrt(slope * slope + 1.0)
    sine = slope * cosine
    r = 3 - p - q
    matrix[p, p] -= slope * mixed
    matrix[q, q] += slope * mixed
    matrix[p, q] = matrix[q, p] = 0.0
    from_p, from_q = matrix[r, p], matrix[r, q]
    matrix[r, p] = matrix[p, r] = cosine * from_p - sine * from_q
    matrix[r, q] = matrix[q, r] = sine * from_p + cosine * from_q
    for a in range(3):
        from_p, from_q = axes[a, p], axes[a, q]
        axes[a, p] = cosine * from_p - sine * from_q
        axes[a, q] = sine * from_p + cosine * from_q
