"""Integration of the deviatoric stress, with the rotation of a step (eqs 430-431).

The usual Jaumann rate, in which the spin enters as one more rate, changes |S| in a pure rotation; a
rotation of the stress does not.
"""

from numba import njit

from sph.compiled import INLINED


@njit(**INLINED)
def advance(dim, stress, velocity_gradient, div_v, stiffness, dt, i):
    """Advance the deviatoric stress (D, D, N) of particle i by dt (eqs 430-431).

    velocity_gradient (D, D, N) and div_v (N,) are those in the middle of the step; stiffness: 2 G.
    """
    half = 0.5 * stiffness * dt
    if len(dim) == 1:
        stress[0, 0, i] += 2.0 * half * (velocity_gradient[0, 0, i] - div_v[i] / 3.0)
    elif len(dim) == 2:
        change = _strained_2(velocity_gradient, div_v[i], i, half)
        turn = _rotation_2(velocity_gradient, i, dt)
        _write_2(stress, i, _sum_2(_turned_2(turn, _sum_2(_of_2(stress, i), change)), change))
    else:
        change_3 = _strained_3(velocity_gradient, div_v[i], i, half)
        turn_3 = _rotation_3(velocity_gradient, i, dt)
        after = _turned_3(turn_3, _sum_3(_of_3(stress, i), change_3))
        _write_3(stress, i, _sum_3(after, change_3))


# --- two dimensions: a symmetric tensor is (xx, xy, yy), a rotation its cosine and sine ---


@njit(**INLINED)
def _of_2(tensor, i):
    return tensor[0, 0, i], tensor[0, 1, i], tensor[1, 1, i]


@njit(**INLINED)
def _strained_2(L, divergence, i, factor):
    """Return factor times the deviatoric rate of strain."""
    third, mixed = divergence / 3.0, 0.5 * (L[0, 1, i] + L[1, 0, i])
    return factor * (L[0, 0, i] - third), factor * mixed, factor * (L[1, 1, i] - third)


@njit(**INLINED)
def _write_2(tensor, i, s):
    tensor[0, 0, i], tensor[0, 1, i], tensor[1, 0, i], tensor[1, 1, i] = s[0], s[1], s[1], s[2]


@njit(**INLINED)
def _sum_2(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(**INLINED)
def _rotation_2(L, i, time):
    """Return cosine and sine of 2 arctan(x), x = half the spin times time (eq 431)."""
    x = 0.25 * (L[0, 1, i] - L[1, 0, i]) * time
    scale = 1.0 / (1.0 + x * x)
    return (1.0 - x * x) * scale, 2.0 * x * scale


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
def _of_3(t, i):
    return t[0, 0, i], t[0, 1, i], t[0, 2, i], t[1, 1, i], t[1, 2, i], t[2, 2, i]


@njit(**INLINED)
def _strained_3(L, divergence, i, factor):
    """Return factor times the deviatoric rate of strain."""
    third, half = divergence / 3.0, 0.5 * factor
    return (
        factor * (L[0, 0, i] - third), half * (L[0, 1, i] + L[1, 0, i]),
        half * (L[0, 2, i] + L[2, 0, i]), factor * (L[1, 1, i] - third),
        half * (L[1, 2, i] + L[2, 1, i]), factor * (L[2, 2, i] - third),
    )  # fmt: skip


@njit(**INLINED)
def _write_3(t, i, s):
    t[0, 0, i], t[0, 1, i], t[0, 2, i] = s[0], s[1], s[2]
    t[1, 0, i], t[1, 1, i], t[1, 2, i] = s[1], s[3], s[4]
    t[2, 0, i], t[2, 1, i], t[2, 2, i] = s[2], s[4], s[5]


@njit(**INLINED)
def _sum_3(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@njit(**INLINED)
def _rotation_3(L, i, time):
    """Return (I - A)^-1 (I + A) = I + 2 (A + A^2)/(1 + |A|^2/2), A = half the spin times time."""
    a = 0.25 * (L[0, 1, i] - L[1, 0, i]) * time
    b = 0.25 * (L[0, 2, i] - L[2, 0, i]) * time
    c = 0.25 * (L[1, 2, i] - L[2, 1, i]) * time
    k = 2.0 / (1.0 + a * a + b * b + c * c)
    return (
        (1.0 - k * (a * a + b * b), k * (a - b * c), k * (b + a * c)),
        (-k * (a + b * c), 1.0 - k * (a * a + c * c), k * (c - a * b)),
        (k * (a * c - b), -k * (c + a * b), 1.0 - k * (b * b + c * c)),
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
