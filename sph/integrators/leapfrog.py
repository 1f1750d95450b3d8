"""The leapfrog: prediction and correction of all evolved fields (eqs 1-6 and 29-31).

Internal energy and other positive quantities are kept positive. If a change c would take more than
half of u, u + c is replaced by u/2 e^(1 + 2 c/u), which has the same value and slope at c = -u/2
and never reaches zero. This adds energy; the functions return its sum over particles, which the
history records as energy_injected. With the time step limit u/|du/dt| this does not occur.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, FASTMATH, INLINED
from sph.part import Evolved, Rule
from sph.state import State
from sph.threads import ALONE, Team


def predict(state: State, evolved: tuple[Evolved, ...], dt: float, team: Team = ALONE) -> float:
    """Advance positions by a full step, and velocities and evolved fields by half a step.

    Writes the values after a full step to the predicted fields. Returns the energy that was added
    in addition to the rates.
    """
    s, n, given = state, state.mass.size, 0.0
    moved = s.position, s.velocity, s.acceleration, s.predicted_velocity
    team.chunks(move, n, dt, *moved)
    for one in evolved:
        value, rate, predicted = map(s.rows, (one.value, one.rate, one.predicted))
        given += sum(team.chunks(one.rule.predict, n, dt, value, rate, s.mass, predicted))
    return given


def correct(state: State, evolved: tuple[Evolved, ...], dt: float, team: Team = ALONE) -> float:
    """Advance by the second half step with the new rates. Return the energy added beyond these."""
    s, n, given = state, state.mass.size, 0.0
    team.chunks(straight_correct, n, dt, s.velocity, s.acceleration, s.mass)
    for one in evolved:
        value, rate = s.rows(one.value), s.rows(one.rate)
        given += sum(team.chunks(one.rule.correct, n, dt, value, rate, s.mass))
    return given


def predict_each(
    state: State, evolved: tuple[Evolved, ...], dt: float, since: np.ndarray, own: np.ndarray,
    team: Team = ALONE,
) -> float:  # fmt: skip
    """Advance positions by dt, and set the predicted fields to the present time.

    since (N,): time since the beginning of each particle's step; own (N,): length of the steps that
    end now, by half of which the evolved fields advance; 0 for other particles. Returns the energy
    that was added in addition to the rates.
    """
    s, n, given = state, state.mass.size, 0.0
    moved = s.position, s.velocity, s.acceleration, s.predicted_velocity
    team.chunks(move_each, n, dt, since, own, *moved)
    for one in evolved:
        value, rate, predicted = map(s.rows, (one.value, one.rate, one.predicted))
        arrays = value, rate, s.mass, predicted
        given += sum(team.chunks(one.rule.predict_each, n, since, own, *arrays))
    return given


def correct_each(
    state: State, evolved: tuple[Evolved, ...], own: np.ndarray, team: Team = ALONE
) -> float:
    """As `correct`, for the steps `own` (N,), which are 0 for particles whose step goes on."""
    s, n, given = state, state.mass.size, 0.0
    team.chunks(straight_correct_each, n, own, s.velocity, s.acceleration, s.mass)
    for one in evolved:
        value, rate = s.rows(one.value), s.rows(one.rate)
        given += sum(team.chunks(one.rule.correct_each, n, own, value, rate, s.mass))
    return given


def keep(state: State, evolved: tuple[Evolved, ...]) -> None:
    """Set predicted fields to the initial values."""
    state.predicted_velocity[:] = state.velocity
    for one in evolved:
        getattr(state, one.predicted)[:] = getattr(state, one.value)


# Without fused multiply-add, so that the loops with and without branches have the same results.
ROUNDED = COMPILED | {"fastmath": FASTMATH - {"contract"}}

# Each function below advances particles [first, last). Arrays: (rows, N), where a vector has D rows
# and a scalar one; mass: (N,). Unsigned indices: Numba would allow for negative ones, which stops
# the loop from being vectorised.


@njit(**COMPILED)
def move(first, last, dt, position, velocity, acceleration, velocity_full):
    """Advance positions by a full step (eq 1) and velocities by half a step (eq 2).

    velocity_full receives the full-step prediction (eq 4).
    """
    for d in range(position.shape[0]):
        for i in range(np.uint64(first), np.uint64(last)):
            a = acceleration[d, i]
            v = velocity[d, i]
            position[d, i] += v * dt + 0.5 * a * dt * dt
            velocity_full[d, i] = v + a * dt
            velocity[d, i] = v + 0.5 * a * dt


@njit(**COMPILED)
def _straight_predict(first, last, dt, value, rate, mass, value_full) -> float:
    """Advance `value` by half a step; write the full step to value_full (eqs 6 and 31)."""
    for d in range(value.shape[0]):
        for i in range(np.uint64(first), np.uint64(last)):
            start = value[d, i]
            value_full[d, i] = start + rate[d, i] * dt
            value[d, i] = start + 0.5 * rate[d, i] * dt
    return 0.0


@njit(**COMPILED)
def straight_correct(first, last, dt, value, rate, mass) -> float:
    """Advance `value` by the second half step with the new rate (eqs 29 and 31)."""
    for d in range(value.shape[0]):
        for i in range(np.uint64(first), np.uint64(last)):
            value[d, i] += 0.5 * rate[d, i] * dt
    return 0.0


@njit(**ROUNDED)
def _positive_predict(first, last, dt, energy, rate, mass, energy_full) -> float:
    """Advance `energy` by half a step (eq 3); write the full step to energy_full (eq 5).

    Both are kept positive. Returns the energy added to the half step.
    """
    given = 0.0
    for d in range(energy.shape[0]):
        if _all_are_straight(first, last, d, dt, energy, rate):
            for i in range(np.uint64(first), np.uint64(last)):
                energy_full[d, i] = energy[d, i] + rate[d, i] * dt
                energy[d, i] += 0.5 * rate[d, i] * dt
            continue
        for i in range(first, last):
            energy_full[d, i], _ = _kept_positive(energy[d, i], rate[d, i] * dt)
            energy[d, i], extra = _kept_positive(energy[d, i], 0.5 * rate[d, i] * dt)
            given += mass[i] * extra
    return given


@njit(**ROUNDED)
def _positive_correct(first, last, dt, energy, rate, mass) -> float:
    """Advance `energy` by the second half step (eq 30), kept positive; return the energy added."""
    given = 0.0
    for d in range(energy.shape[0]):
        if _all_are_straight(first, last, d, 0.5 * dt, energy, rate):
            for i in range(np.uint64(first), np.uint64(last)):
                energy[d, i] += 0.5 * rate[d, i] * dt
            continue
        for i in range(first, last):
            energy[d, i], extra = _kept_positive(energy[d, i], 0.5 * rate[d, i] * dt)
            given += mass[i] * extra
    return given


@njit(**INLINED)
def _all_are_straight(first, last, d, dt, energy, rate):
    """Return whether `_kept_positive` is u + change for all of these particles, as it mostly is."""
    others = 0
    for i in range(np.uint64(first), np.uint64(last)):
        others += rate[d, i] * dt < -0.5 * energy[d, i]
    return others == 0


@njit(**INLINED)
def _kept_positive(energy, change):
    """Return u + change kept positive, and the energy that this added."""
    # the order of this comparison lets NaN pass, for the watchdog to find
    if change < -0.5 * energy:
        # u = 0 gives change/energy = -inf and e^-inf = 0
        kept = 0.5 * energy * np.exp(1.0 + 2.0 * change / energy)
        return kept, kept - (energy + change)
    return energy + change, 0.0


@njit(**ROUNDED)
def _density_predict(first, last, dt, density, rate, mass, density_full) -> float:
    """Write the density after a full step with the last rate to density_full."""
    for d in range(density.shape[0]):
        for i in range(first, last):
            density_full[d, i] = stepped_density(density[d, i], rate[d, i] * dt)
    return 0.0


@njit(**ROUNDED)
def _density_correct(first, last, dt, density, rate, mass) -> float:
    """Advance the density by a full step with the rate in its middle."""
    for d in range(density.shape[0]):
        for i in range(first, last):
            density[d, i] = stepped_density(density[d, i], rate[d, i] * dt)
    return 0.0


@njit(**INLINED)
def stepped_density(density, change):
    """Return rho + change, kept positive."""
    found, _ = _kept_positive(density, change)
    return found


# --- individual time steps ---


@njit(**COMPILED)
def move_each(first, last, dt, since, own, position, velocity, acceleration, velocity_now):
    """Advance positions by dt, to a time `since` after the beginning of each particle's step.

    velocity_now receives the velocity at that time; `velocity` advances by half of `own`. since,
    own: (N,).
    """
    for d in range(position.shape[0]):
        for i in range(np.uint64(first), np.uint64(last)):
            a = acceleration[d, i]
            v = velocity[d, i]
            position[d, i] += (v + a * (since[i] - 0.5 * dt)) * dt
            velocity_now[d, i] = v + a * since[i]
            velocity[d, i] = v + 0.5 * a * own[i]


@njit(**COMPILED)
def _straight_predict_each(first, last, since, own, value, rate, mass, value_now) -> float:
    for d in range(value.shape[0]):
        for i in range(np.uint64(first), np.uint64(last)):
            start = value[d, i]
            value_now[d, i] = start + rate[d, i] * since[i]
            value[d, i] = start + 0.5 * rate[d, i] * own[i]
    return 0.0


@njit(**COMPILED)
def straight_correct_each(first, last, own, value, rate, mass) -> float:
    """Advance `value` by the second half of the steps `own` (N,) with the new rates."""
    for d in range(value.shape[0]):
        for i in range(np.uint64(first), np.uint64(last)):
            value[d, i] += 0.5 * rate[d, i] * own[i]
    return 0.0


@njit(**ROUNDED)
def _positive_predict_each(first, last, since, own, energy, rate, mass, energy_now) -> float:
    given = 0.0
    for d in range(energy.shape[0]):
        for i in range(first, last):
            energy_now[d, i], _ = _kept_positive(energy[d, i], rate[d, i] * since[i])
            energy[d, i], extra = _kept_positive(energy[d, i], 0.5 * rate[d, i] * own[i])
            given += mass[i] * extra
    return given


@njit(**ROUNDED)
def _positive_correct_each(first, last, own, energy, rate, mass) -> float:
    given = 0.0
    for d in range(energy.shape[0]):
        for i in range(first, last):
            energy[d, i], extra = _kept_positive(energy[d, i], 0.5 * rate[d, i] * own[i])
            given += mass[i] * extra
    return given


STRAIGHT = Rule(_straight_predict, straight_correct, _straight_predict_each, straight_correct_each)
# for a density that is integrated in time; individual steps take it from its rate (`bins`)
DENSITY = Rule(_density_predict, _density_correct, _straight_predict_each, straight_correct_each)
POSITIVE = Rule(
    _positive_predict, _positive_correct, _positive_predict_each, _positive_correct_each
)
