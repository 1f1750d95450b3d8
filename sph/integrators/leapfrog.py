"""The leapfrog: prediction and correction of all evolved fields (eqs 1-6 and 29-31).

Internal energy and other positive quantities are kept positive. If a change c would take more than
half of u, u + c is replaced by u/2 e^(1 + 2 c/u), which has the same value and slope at c = -u/2
and never reaches zero. This adds energy; the functions return its sum over particles, which the
history records as energy_injected. With the time step limit u/|du/dt| this does not occur.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, INLINED
from sph.part import Evolved, Rule
from sph.state import State


def predict(state: State, evolved: tuple[Evolved, ...], dt: float) -> float:
    """Advance positions by a full step, and velocities and evolved fields by half a step.

    Writes the values after a full step to the predicted fields. Returns the energy that was added
    in addition to the rates.
    """
    s, given = state, 0.0
    _move(dt, s.position, s.velocity, s.acceleration, s.predicted_velocity)
    for one in evolved:
        given += one.rule.predict(
            dt, getattr(s, one.value), getattr(s, one.rate), s.mass, getattr(s, one.predicted)
        )
    return given


def correct(state: State, evolved: tuple[Evolved, ...], dt: float) -> float:
    """Advance by the second half step with the new rates. Return the energy added beyond these."""
    s, given = state, 0.0
    _straight_correct(dt, s.velocity, s.acceleration, s.mass)
    for one in evolved:
        given += one.rule.correct(dt, getattr(s, one.value), getattr(s, one.rate), s.mass)
    return given


def keep(state: State, evolved: tuple[Evolved, ...]) -> None:
    """Set predicted fields to the initial values."""
    state.predicted_velocity[:] = state.velocity
    for one in evolved:
        getattr(state, one.predicted)[:] = getattr(state, one.value)


@njit(**COMPILED)
def _move(dt, position, velocity, acceleration, velocity_full):
    """Advance positions by a full step (eq 1) and velocities by half a step (eq 2).

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
def _straight_predict(dt, value, rate, mass, value_full) -> float:
    """Advance `value` by half a step; write the full step to value_full (eqs 6 and 31)."""
    flat, flat_rate, flat_full = value.reshape(-1), rate.reshape(-1), value_full.reshape(-1)
    for i in range(flat.size):
        start = flat[i]
        flat_full[i] = start + flat_rate[i] * dt
        flat[i] = start + 0.5 * flat_rate[i] * dt
    return 0.0


@njit(**COMPILED)
def _straight_correct(dt, value, rate, mass) -> float:
    """Advance `value` by the second half step with the new rate (eqs 29 and 31); equal shapes."""
    flat, flat_rate = value.reshape(-1), rate.reshape(-1)
    for i in range(flat.size):
        flat[i] += 0.5 * flat_rate[i] * dt
    return 0.0


@njit(**COMPILED)
def _positive_predict(dt, energy, rate, mass, energy_full) -> float:
    """Advance `energy` by half a step (eq 3); write the full step to energy_full (eq 5).

    Both are kept positive. Returns the energy added to the half step.
    """
    given = 0.0
    for i in range(energy.size):
        energy_full[i], _ = _kept_positive(energy[i], rate[i] * dt)
        energy[i], extra = _kept_positive(energy[i], 0.5 * rate[i] * dt)
        given += mass[i] * extra
    return given


@njit(**COMPILED)
def _positive_correct(dt, energy, rate, mass) -> float:
    """Advance `energy` by the second half step (eq 30), kept positive; return the energy added."""
    given = 0.0
    for i in range(energy.size):
        energy[i], extra = _kept_positive(energy[i], 0.5 * rate[i] * dt)
        given += mass[i] * extra
    return given


@njit(**INLINED)
def _kept_positive(energy, change):
    """Return u + change kept positive, and the energy that this added."""
    # the order of this comparison lets NaN pass, for the watchdog to find
    if change < -0.5 * energy:
        # u = 0 gives change/energy = -inf and e^-inf = 0
        kept = 0.5 * energy * np.exp(1.0 + 2.0 * change / energy)
        return kept, kept - (energy + change)
    return energy + change, 0.0


STRAIGHT = Rule(_straight_predict, _straight_correct)
POSITIVE = Rule(_positive_predict, _positive_correct)
