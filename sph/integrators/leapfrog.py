"""Prediction and correction (eqs 1-6 and 29-31), in place, of whatever the parts let evolve.

A quantity that is positive by rule, such as the internal energy: where half a step of cooling would
take more than half of u, the straight line u + c is left, with its own value and slope, for
u/2 e^(1 + 2 c/u), which never reaches zero. That is more energy than the pairs exchanged; the
updates return how much, summed over particles, and the history shows it. With the step limit
u/|du/dt| it is never needed.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.part import Evolved, Rule
from sph.state import State


def predict(state: State, evolved: tuple[Evolved, ...], dt: float) -> float:
    """Positions by a full step, all else by half of one, with full steps in the predicted fields.

    Returns the energy given beyond the rates.
    """
    s, given = state, 0.0
    _move(dt, s.position, s.velocity, s.acceleration, s.predicted_velocity)
    for one in evolved:
        given += one.rule.predict(
            dt, getattr(s, one.value), getattr(s, one.rate), s.mass, getattr(s, one.predicted)
        )
    return given


def correct(state: State, evolved: tuple[Evolved, ...], dt: float) -> float:
    """The second half step, with the new rates. Returns the energy given beyond them."""
    s, given = state, 0.0
    _straight_correct(dt, s.velocity, s.acceleration, s.mass)
    for one in evolved:
        given += one.rule.correct(dt, getattr(s, one.value), getattr(s, one.rate), s.mass)
    return given


def keep(state: State, evolved: tuple[Evolved, ...]) -> None:
    """At the start the predicted values are the values themselves."""
    state.predicted_velocity[:] = state.velocity
    for one in evolved:
        getattr(state, one.predicted)[:] = getattr(state, one.value)


@njit(**COMPILED)
def _move(dt, position, velocity, acceleration, velocity_full):
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
def _straight_predict(dt, value, rate, mass, value_full) -> float:
    """Half a step in place, the full step into value_full: eq 6 and the first of 31."""
    flat, flat_rate, flat_full = value.reshape(-1), rate.reshape(-1), value_full.reshape(-1)
    for i in range(flat.size):
        start = flat[i]
        flat_full[i] = start + flat_rate[i] * dt
        flat[i] = start + 0.5 * flat_rate[i] * dt
    return 0.0


@njit(**COMPILED)
def _straight_correct(dt, value, rate, mass) -> float:
    """The second half step with the new rate, arrays of any one shape (eqs 29 and 31)."""
    flat, flat_rate = value.reshape(-1), rate.reshape(-1)
    for i in range(flat.size):
        flat[i] += 0.5 * flat_rate[i] * dt
    return 0.0


@njit(**COMPILED)
def _positive_predict(dt, energy, rate, mass, energy_full) -> float:
    """Half a step in place (eq 3), the full step into energy_full (eq 5), both kept positive.

    Returns the energy that the half step was given beyond rate dt/2.
    """
    given = 0.0
    for i in range(energy.size):
        energy_full[i], _ = _kept_positive(energy[i], rate[i] * dt)
        energy[i], extra = _kept_positive(energy[i], 0.5 * rate[i] * dt)
        given += mass[i] * extra
    return given


@njit(**COMPILED)
def _positive_correct(dt, energy, rate, mass) -> float:
    """The same for the second half (eq 30), kept positive; returns the energy given."""
    given = 0.0
    for i in range(energy.size):
        energy[i], extra = _kept_positive(energy[i], 0.5 * rate[i] * dt)
        given += mass[i] * extra
    return given


@njit(**COMPILED, forceinline=True)
def _kept_positive(energy, change):
    """(u + change kept positive, what that added)."""
    # in this order a number that is not one passes through, for the watchdog to find
    if change < -0.5 * energy:
        # from u = 0 there is nothing to take, and -inf gives e^-inf = 0
        kept = 0.5 * energy * np.exp(1.0 + 2.0 * change / energy)
        return kept, kept - (energy + change)
    return energy + change, 0.0


STRAIGHT = Rule(_straight_predict, _straight_correct)
POSITIVE = Rule(_positive_predict, _positive_correct)
