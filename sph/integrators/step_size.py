"""The global time step (eq 32), what else bounds it, and the particle that sets it.

Each bound that eq 32 lacks, and why:

- "support", "growth". v_sig counts approach alone; gas that parts fast could lose its neighbours in
  one step. A support may change by SUPPORT_CHANGE of itself: by dH/dt = H div v/D where the scene
  has the divergence, else as far as it changed in the last step. A step may be GROWTH times as long
  as the one before, so that a flow that has just been stiff is not left in one leap.
- "acceleration". A force that sends no signal bounds the step by C (H/|a|)^(1/2).
- "approach". v_sig counts neighbours alone; gas that is still apart may overlap in one step. Such a
  pair may come 2C/3 of H deep, as far as eq 32 lets neighbours approach (neighbours/approach.py).
- Terms that damp differences between neighbours, at a rate lambda, hold C itself. With
  a = -w^2 x - lambda v, where a takes the predicted v of eq 4, one step maps
  (x, v dt, a dt^2) -> x' = x + v dt + a dt^2/2, a' dt^2 = -(w dt)^2 x' - lambda dt (v dt + a dt^2),
  v' = v + (a + a') dt/2. At the limit of stability the map has the eigenvalue -1, which makes v = 0
  and a dt^2 = -4x, so the leapfrog is stable where

      lambda dt + (w dt)^2 / 4 < 1.

  With lambda = alpha v_sig/H and w = 2 v_sig/H a step of C 2H/v_sig is stable while
  2 alpha C + 4 C^2 < 1, and C is held there. (Eq 24 damps velocities that alternate along a line of
  particles H/2.6 apart by 0.84 alpha v_sig/H; what is left is for other kernels and for approach,
  which doubles lambda where v_sig is mostly w_ij.) alpha is the largest that the switch allows: it
  may rise to that within a step. Each part says where it holds C (`Part.largest_courant`). What
  was measured is in docs/measurements.md, "Time step and viscosity".
- A part may bound each particle's step by itself (`Part.step_limit`).
- "end". No step is longer than the run.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.neighbours.approach import first_contact
from sph.part import Part
from sph.state import State

# Of every scene; those of parts are named by them.
CRITERIA = ("signal_speed", "energy", "acceleration", "support", "growth", "end", "approach")

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
    """Of a run: the Courant number that it takes, C or less, and the criterion of its signals;
    whether u/|du/dt| and |a| bound the step; and its end."""

    courant: float
    criterion: str
    energy: bool
    acceleration: bool
    end: float


class Past(NamedTuple):
    """The step just made: its length, and the limit it was cut from."""

    dt: float
    limit: float


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


def limit(bounds: Bounds, state: State, parts: tuple[Part, ...], past: Past | None) -> StepLimit:
    """The coming step; there is no past at the start."""
    s = state
    dt, particle, index = _smallest(
        s.support, s.signal_speed, s.internal_energy, s.energy_rate,
        s.acceleration if bounds.acceleration else None, s.id, bounds.energy,
    )  # fmt: skip
    dt, criterion = bounds.courant * dt, CRITERIA[index] if index else bounds.criterion
    for part in parts:
        times = part.step_limit(s)
        if times is not None and times.min() < dt:
            dt, criterion = float(times.min()), part.name
            particle = s.id[times == dt].min()
    rate, changed = _rate_of_supports(s, past)
    if rate * dt > SUPPORT_CHANGE:
        dt, particle, criterion = SUPPORT_CHANGE / rate, changed, "support"
    if past is not None and dt > GROWTH * past.limit:
        dt, particle, criterion = GROWTH * past.limit, 0, "growth"
    if dt > bounds.end:
        dt, particle, criterion = bounds.end, 0, "end"
    return StepLimit(dt, int(particle), criterion)


def before_contact(limit: StepLimit, bounds: Bounds, particles: State, domain) -> StepLimit:
    """`limit`, cut where particles that are no neighbours yet would meet too deep in that step."""
    p = particles
    part, particle = first_contact(
        p.position, p.velocity, p.acceleration, p.support, p.id, domain.images,
        domain.longest_reach, limit.dt, 2.0 / 3.0 * bounds.courant,
    )  # fmt: skip
    return StepLimit(part * limit.dt, int(particle), "approach") if part < 1.0 else limit


def _rate_of_supports(state: State, past: Past | None) -> tuple[float, int]:
    """Largest |dH/dt|/H, and whose it is: from div v where the scene has it."""
    divergence = state.get("div_v")
    if divergence is not None:
        rate, particle = _fastest_change(divergence, state.id)
        return rate / state.dimension, particle
    if past is None:
        return 0.0, 0
    change, particle = _largest_change(state.support, state.support_before, state.id)
    # less than this cannot become too much in one step; it may be the iteration of H, which goes on
    # however short the step
    return (change / past.dt if change > SUPPORT_CHANGE / GROWTH else 0.0), particle
