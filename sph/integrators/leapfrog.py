"""Prediction and correction (seed eqs 1-6 and 29-31), in place."""

from numba import njit

from sph.compiled import COMPILED


@njit(**COMPILED)
def predict(dt, position, velocity, acceleration, velocity_full):
    """Move positions by a full step (eq 1), velocities by half of one (eq 2).

    velocity_full (D, N) receives the full-step prediction (eq 4).
    """
    D, n = position.shape
    for d in range(D):
        for i in range(n):
            a = acceleration[d, i]
            v = velocity[d, i]
            position[d, i] += v * dt + 0.5 * a * dt * dt
            velocity_full[d, i] = v + a * dt
            velocity[d, i] = v + 0.5 * a * dt


@njit(**COMPILED)
def predict_scalar(dt, value, rate, value_full):
    """Half a step in place, the full step into value_full: eqs 3, 5, 6 and the first of 31."""
    for i in range(value.size):
        start = value[i]
        value_full[i] = start + rate[i] * dt
        value[i] = start + 0.5 * rate[i] * dt


@njit(**COMPILED)
def correct(dt, value, rate):
    """The second half step with the new rate, arrays of any one shape (eqs 29-31)."""
    flat, flat_rate = value.reshape(-1), rate.reshape(-1)
    for i in range(flat.size):
        flat[i] += 0.5 * flat_rate[i] * dt
