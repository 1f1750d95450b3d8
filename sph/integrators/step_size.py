"""The global time step (seed eq 32), what else bounds it, and the particle that sets it.

Eq 32 knows of no gas that parts: v_sig counts approach alone, and in a fast expansion it would let
particles leave each other in one step. So a support may change by SUPPORT_CHANGE of itself: by
dH/dt = H div v/D where the scene has the divergence, else as far as it changed in the last step. A
step may be GROWTH times as long as the one before, so that a flow that has just been stiff is not
left in one leap. A field from outside, where there is one, bounds it by C (H/|a|)^(1/2). No step is
longer than the run.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED

CRITERIA = ("signal_speed", "energy", "acceleration", "support", "growth", "end")

SUPPORT_CHANGE = 0.2
GROWTH = 1.5


class StepLimit(NamedTuple):
    """The step that the criteria allow, the ID of the particle that sets it, and by which.

    The particle is 0 where none does: "growth" and "end".
    """

    dt: float
    particle: int
    criterion: str


class Bounds(NamedTuple):
    """Of a run: the Courant number C, whether u/|du/dt| and |a| bound the step, and its end."""

    courant: float
    energy: bool
    acceleration: bool
    end: float


class Past(NamedTuple):
    """The step just made: its length, the limit it was cut from, and H (N,) before it."""

    dt: float
    limit: float
    support: np.ndarray


@njit(**COMPILED)
def _smallest(support, signal_speed, energy, energy_rate, acceleration, identity, energy_limit):
    best = np.inf
    particle = 0
    criterion = 0
    for i in range(support.size):
        by_signal = 2.0 * support[i] / signal_speed[i]
        if by_signal < best or (by_signal == best and identity[i] < particle):
            best, particle, criterion = by_signal, identity[i], 0
        # cold gas without any energy has none to lose, and heating it is no matter of accuracy
        if energy_limit and energy[i] > 0.0:
            by_energy = energy[i] / abs(energy_rate[i])
            if by_energy < best or (by_energy == best and identity[i] < particle):
                best, particle, criterion = by_energy, identity[i], 1
        if acceleration is not None:
            squared = 0.0
            for d in range(acceleration.shape[0]):
                squared += acceleration[d, i] ** 2
            by_acceleration = np.sqrt(support[i] / np.sqrt(squared))
            if by_acceleration < best or (by_acceleration == best and identity[i] < particle):
                best, particle, criterion = by_acceleration, identity[i], 2
    return best, particle, criterion


@njit(**COMPILED)
def _largest_change(support, before, identity):
    """Largest |H/H_before - 1| or its inverse, and whose it is."""
    largest = 0.0
    particle = 0
    for i in range(support.size):
        change = abs(support[i] - before[i]) / min(support[i], before[i])
        if change > largest or (change == largest and identity[i] < particle):
            largest, particle = change, identity[i]
    return largest, particle


@njit(**COMPILED)
def _fastest_change(divergence, identity):
    """Largest |div v|, and whose it is."""
    largest = 0.0
    particle = 0
    for i in range(divergence.size):
        rate = abs(divergence[i])
        if rate > largest or (rate == largest and identity[i] < particle):
            largest, particle = rate, identity[i]
    return largest, particle


def limit(bounds: Bounds, particles, signal_speed, divergence, past: Past | None) -> StepLimit:
    """The coming step; signal_speed (N,) is each particle's largest v_sig.

    divergence (N,) of velocity, None in scenes without; no past at the start.
    """
    p = particles
    dt, particle, criterion = _smallest(
        p.support, signal_speed, p.internal_energy, p.energy_rate,
        p.acceleration if bounds.acceleration else None, p.id, bounds.energy,
    )  # fmt: skip
    dt, criterion = bounds.courant * dt, CRITERIA[criterion]
    rate, changed = _rate_of_supports(p, divergence, past)
    if rate * dt > SUPPORT_CHANGE:
        dt, particle, criterion = SUPPORT_CHANGE / rate, changed, "support"
    if past is not None and dt > GROWTH * past.limit:
        dt, particle, criterion = GROWTH * past.limit, 0, "growth"
    if dt > bounds.end:
        dt, particle, criterion = bounds.end, 0, "end"
    return StepLimit(dt, int(particle), criterion)


def _rate_of_supports(particles, divergence, past: Past | None) -> tuple[float, int]:
    """Largest |dH/dt|/H, and whose it is."""
    if divergence is not None:
        rate, particle = _fastest_change(divergence, particles.id)
        return rate / particles.position.shape[0], particle
    if past is None:
        return 0.0, 0
    change, particle = _largest_change(particles.support, past.support, particles.id)
    # less than this cannot become too much in one step; it may be the iteration of H, which goes on
    # however short the step
    return (change / past.dt if change > SUPPORT_CHANGE / GROWTH else 0.0), particle
