"""Integration of the deviatoric stress, with the exact rotation of a step (eqs 430-431).

The rate of the stress (D, D) holds two things: its symmetric part is the rate by Hooke's law, and
its antisymmetric part the spin of the material, (L - L^T)/2 with L the velocity gradient. The usual
Jaumann rate, in which the spin enters as one more rate, changes |S| in a pure rotation; a rotation
of the stress does not.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, INLINED, larger
from sph.integrators.leapfrog import STRAIGHT
from sph.part import Rule

# sin(x)/x is 1 to the last bit below this angle.
SMALLEST_ANGLE = 1e-8


@njit(**COMPILED)
def predict_turned(first, last, dt, stress, rate, mass, predicted) -> float:
    """Advance the stress by half a step; write the full step to `predicted`. Arrays: (D*D, N)."""
    half = 0.5 * dt
    for i in range(first, last):
        if stress.shape[0] == 1:
            after = stress[0, i] + half * rate[0, i]
            predicted[0, i] = after + half * rate[0, i]
            stress[0, i] = after
        elif stress.shape[0] == 4:
            turn = _rotation_2(rate, i, half)
            change = _symmetric_2(rate, i, half)
            after_2 = _turned_2(turn, _sum_2(_symmetric_2(stress, i, 1.0), change))
            _write_2(predicted, i, _sum_2(_turned_2(turn, after_2), change))
            _write_2(stress, i, after_2)
        else:
            rotation = _rotation_3(rate, i, half)
            change_3 = _symmetric_3(rate, i, half)
            after_3 = _turned_3(rotation, _sum_3(_symmetric_3(stress, i, 1.0), change_3))
            _write_3(predicted, i, _sum_3(_turned_3(rotation, after_3), change_3))
            _write_3(stress, i, after_3)
    return 0.0


@njit(**COMPILED)
def correct_turned(first, last, dt, stress, rate, mass) -> float:
    """Advance the stress by the second half step, with the new rate. Arrays: (D*D, N)."""
    half = 0.5 * dt
    for i in range(first, last):
        if stress.shape[0] == 1:
            stress[0, i] += half * rate[0, i]
        elif stress.shape[0] == 4:
            after_2 = _turned_2(_rotation_2(rate, i, half), _symmetric_2(stress, i, 1.0))
            _write_2(stress, i, _sum_2(after_2, _symmetric_2(rate, i, half)))
        else:
            after_3 = _turned_3(_rotation_3(rate, i, half), _symmetric_3(stress, i, 1.0))
            _write_3(stress, i, _sum_3(after_3, _symmetric_3(rate, i, half)))
    return 0.0


# Individual time steps are refused with this formulation, so the last two functions never run.
JAUMANN = Rule(predict_turned, correct_turned, STRAIGHT.predict_each, STRAIGHT.correct_each)


# --- two dimensions: a symmetric tensor is (xx, xy, yy), a rotation its cosine and sine ---


@njit(**INLINED)
def _symmetric_2(tensor, i, factor):
    mixed = 0.5 * (tensor[1, i] + tensor[2, i])
    return factor * tensor[0, i], factor * mixed, factor * tensor[3, i]


@njit(**INLINED)
def _write_2(tensor, i, s):
    tensor[0, i], tensor[1, i], tensor[2, i], tensor[3, i] = s[0], s[1], s[1], s[2]


@njit(**INLINED)
def _sum_2(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(**INLINED)
def _rotation_2(rate, i, time):
    angle = 0.5 * (rate[1, i] - rate[2, i]) * time
    return np.cos(angle), np.sin(angle)


@njit(**INLINED)
def _turned_2(turn, s):
    """Return R S R^T with R = ((cos, sin), (-sin, cos))."""
    c, n = turn
    across = 2.0 * c * n * s[1]
    xx = c * c * s[0] + across + n * n * s[2]
    xy = c * n * (s[2] - s[0]) + (c * c - n * n) * s[1]
    yy = n * n * s[0] - across + c * c * s[2]
    return xx, xy, yy


# --- three dimensions: a symmetric tensor is (xx, xy, xz, yy, yz, zz), a rotation three rows ---


@njit(**INLINED)
def _symmetric_3(tensor, i, factor):
    half = 0.5 * factor
    return (
        factor * tensor[0, i], half * (tensor[1, i] + tensor[3, i]),
        half * (tensor[2, i] + tensor[6, i]), factor * tensor[4, i],
        half * (tensor[5, i] + tensor[7, i]), factor * tensor[8, i],
    )  # fmt: skip


@njit(**INLINED)
def _write_3(tensor, i, s):
    tensor[0, i], tensor[1, i], tensor[2, i] = s[0], s[1], s[2]
    tensor[3, i], tensor[4, i], tensor[5, i] = s[1], s[3], s[4]
    tensor[6, i], tensor[7, i], tensor[8, i] = s[2], s[4], s[5]


@njit(**INLINED)
def _sum_3(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@njit(**INLINED)
def _rotation_3(rate, i, time):
    """Return exp(spin time) by Rodrigues' formula: I + (sin t/t) A + ((1 - cos t)/t^2) A^2."""
    a = 0.5 * (rate[1, i] - rate[3, i]) * time
    b = 0.5 * (rate[2, i] - rate[6, i]) * time
    c = 0.5 * (rate[5, i] - rate[7, i]) * time
    angle = larger(np.sqrt(a * a + b * b + c * c), SMALLEST_ANGLE)
    s = np.sin(angle) / angle
    k = np.sin(0.5 * angle) / angle
    k = 2.0 * k * k
    return (
        (1.0 - k * (a * a + b * b), s * a - k * b * c, s * b + k * a * c),
        (-s * a - k * b * c, 1.0 - k * (a * a + c * c), s * c - k * a * b),
        (-s * b + k * a * c, -s * c - k * a * b, 1.0 - k * (b * b + c * c)),
    )


@njit(**INLINED)
def _turned_3(rotation, s):
    """Return R S R^T."""
    x, y, z = rotation
    sx, sy, sz = _applied_3(s, x), _applied_3(s, y), _applied_3(s, z)
    return (
        _dot_3(x, sx), _dot_3(x, sy), _dot_3(x, sz), _dot_3(y, sy), _dot_3(y, sz), _dot_3(z, sz),
    )  # fmt: skip


@njit(**INLINED)
def _applied_3(s, v):
    """Return S v."""
    return (
        s[0] * v[0] + s[1] * v[1] + s[2] * v[2],
        s[1] * v[0] + s[3] * v[1] + s[4] * v[2],
        s[2] * v[0] + s[4] * v[1] + s[5] * v[2],
    )


@njit(**INLINED)
def _dot_3(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
