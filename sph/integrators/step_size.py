"""The global time step: eq 32, further limits, and the particle that sets it.

Limits other than eq 32, and why they are needed:

- "support", "growth". Eq 32 ignores expansion, in which gas could lose its neighbours within one
  step. The relative change of a support radius is at most SUPPORT_CHANGE, predicted by
  dH/dt = H div v/D if div v is computed, otherwise by its last change. A step is at most GROWTH
  times as long as the previous one, so that short steps do not become long at once.
- "acceleration". A force that is not in the signal speed limits the step to C (H/|a|)^(1/2).
- "approach". Eq 32 considers only neighbours; gas that is still apart could overlap in one step.
  Such a pair may penetrate by 2C/3 of H, as eq 32 allows neighbours (neighbours/approach.py).
- Terms that damp differences between neighbours, at a rate lambda, limit C itself. With
  a = -w^2 x - lambda v, where a takes the predicted v of eq 4, one step maps
  (x, v dt, a dt^2) -> x' = x + v dt + a dt^2/2, a' dt^2 = -(w dt)^2 x' - lambda dt (v dt + a dt^2),
  v' = v + (a + a') dt/2. At the limit of stability the map has the eigenvalue -1, which makes v = 0
  and a dt^2 = -4x, so the leapfrog is stable where

      lambda dt + (w dt)^2 / 4 < 1.

  With lambda = alpha v_sig/H and w = 2 v_sig/H a step of C 2H/v_sig is stable while
  2 alpha C + 4 C^2 < 1, and C is reduced to that. (Eq 24 damps velocities that alternate along a
  line of particles H/2.6 apart at 0.84 alpha v_sig/H. The margin is for other kernels and for
  approach, which doubles lambda if v_sig is mostly w_ij.) alpha is the largest that the switch
  allows, since alpha may rise to it within a step. Each part gives its limit
  (`Part.largest_courant`). Measurements: docs/measurements.md, "Time step and viscosity".
- A part may limit the step of each particle (`Part.step_limit`).
- "end". No step is longer than the run.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from sph.compiled import COMPILED
from sph.neighbours.approach import first_contact
from sph.part import Part
from sph.state import State
from sph.threads import ALONE, Team

# Criteria of every scene; those of parts have the names of the parts.
CRITERIA = ("signal_speed", "energy", "acceleration", "support", "growth", "end", "approach")

SUPPORT, GROW, END = 3, 4, 5  # indices in CRITERIA

SUPPORT_CHANGE = 0.2
GROWTH = 1.5

LESS = 1.0 - 1e-15  # if a/b <= c in floating point, then LESS a <= b c


class StepLimit(NamedTuple):
    """The allowed step, the ID of the particle that limits it (0: none), and the criterion."""

    dt: float
    particle: int
    criterion: str


class Bounds(NamedTuple):
    """Limits of a run: Courant number in use (at most C) and its criterion, whether u/|du/dt| and
    |a| limit the step, and the end time."""

    courant: float
    criterion: str
    energy: bool
    acceleration: bool
    end: float


class Past(NamedTuple):
    """The last step: its length, and the limit before it was cut for output."""

    dt: float
    limit: float


# Each function below considers particles [first, last) and returns (value, ID, ...) of the extreme
# value, and of the lowest ID among equal values. Results of ranges thus combine to that of all
# particles. Unsigned indices: see leapfrog.py.


@njit(**COMPILED)
def smallest(
    first, last, support, signal_speed, energy, energy_rate, acceleration, identity, energy_limit
):  # fmt: skip
    """Return the smallest limit but for the Courant number, the particle's ID, the criterion."""
    best = np.inf
    particle = 0
    criterion = 0
    for begin in range(first, last, 64):
        end = min(begin + 64, last)
        # First whether any of these particles can have a smaller limit, without branches and
        # divisions. The factor allows for rounding.
        near = 0
        for i in range(np.uint64(begin), np.uint64(end)):
            near += 2.0 * LESS * support[i] <= best * signal_speed[i]
            near += LESS * energy[i] <= best * abs(energy_rate[i])
        if near == 0 and acceleration is None:
            continue
        for i in range(begin, end):
            by_signal = 2.0 * support[i] / signal_speed[i]
            if by_signal < best or (by_signal == best and identity[i] < particle):
                best, particle, criterion = by_signal, identity[i], 0
            # u = 0 does not limit the step: it cannot fall, and any gain is relatively large
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
def largest_change(first, last, support, before, identity):
    """Return the largest relative change of H in either direction, and the particle's ID."""
    largest = 0.0
    particle = 0
    for i in range(np.uint64(first), np.uint64(last)):
        change = abs(support[i] - before[i]) / min(support[i], before[i])
        if change > largest or (change == largest and identity[i] < particle):
            largest, particle = change, identity[i]
    return largest, particle


@njit(**COMPILED)
def fastest_change(first, last, divergence, identity):
    """Return the largest |div v|, and the particle's ID."""
    largest = 0.0
    particle = 0
    for i in range(np.uint64(first), np.uint64(last)):
        rate = abs(divergence[i])
        if rate > largest or (rate == largest and identity[i] < particle):
            largest, particle = rate, identity[i]
    return largest, particle


def limit(
    bounds: Bounds, state: State, parts: tuple[Part, ...], past: Past | None, team: Team = ALONE
) -> StepLimit:
    """Return the next step; past: None at the start."""
    s = state
    dt, particle, index = min(team.chunks(
        smallest, s.support.size, s.support, s.signal_speed, s.internal_energy, s.energy_rate,
        s.acceleration if bounds.acceleration else None, s.id, bounds.energy,
    ))  # fmt: skip
    dt, criterion = bounds.courant * dt, CRITERIA[index] if index else bounds.criterion
    for part in parts:
        times = part.step_limit(s)
        # the order of this comparison lets NaN pass, for the watchdog to find
        if times is not None and not times.min() >= dt:
            dt, criterion = float(times.min()), part.name
            particle = s.id[~(times > dt)].min()
    rate, changed = _rate_of_supports(s, past, team)
    allowed = np.inf if past is None else past.limit
    dt, particle, index = restricted(dt, particle, 0, rate, changed, allowed, bounds.end)
    return StepLimit(dt, int(particle), CRITERIA[index] if index else criterion)


def before_contact(limit: StepLimit, bounds: Bounds, particles: State, domain) -> StepLimit:
    """Return `limit`, reduced if particles that are not neighbours yet would meet within it."""
    p = particles
    part, particle = contact(bounds, p, p.velocity, p.acceleration, domain, limit.dt)
    return StepLimit(part * limit.dt, int(particle), "approach") if part < 1.0 else limit


def contact(bounds: Bounds, particles: State, velocity, acceleration, domain, dt: float):
    """Return the fraction of dt in which particles first meet, and an ID; see `first_contact`."""
    p = particles
    return first_contact(
        p.position, velocity, acceleration, p.support, p.id, domain.images, domain.longest_reach,
        dt, 2.0 / 3.0 * bounds.courant,
    )  # fmt: skip


def _largest(found: list[tuple[float, int]]) -> tuple[float, int]:
    """Return the pair (value, ID) of the largest value, and of the lowest ID among equal values."""
    return found[0] if len(found) == 1 else min(found, key=lambda pair: (-pair[0], pair[1]))


def _rate_of_supports(state: State, past: Past | None, team: Team) -> tuple[float, int]:
    """Return the largest |dH/dt|/H, from div v if available, and the particle's ID."""
    divergence = state.get("div_v")
    if divergence is not None:
        found = team.chunks(fastest_change, divergence.size, divergence, state.id)
        change, particle = _largest(found)
        return rate_of_supports(change, True, state.dimension, 0.0), particle
    if past is None:
        return 0.0, 0
    supports = state.support, state.support_before
    found = team.chunks(largest_change, state.support.size, *supports, state.id)
    change, particle = _largest(found)
    return rate_of_supports(change, False, state.dimension, past.dt), particle


# --- formulas that Python and compiled steps (`sph.steps`) share --------------------------------


@register_jitable
def next_step(time: float, limit: float, until: float) -> tuple[float, bool]:
    """Return the length of the step from `time`, and whether it ends at `until`."""
    # a rest of a billionth of a step is a rounding error: this step covers it
    if time + limit * (1 + 1e-9) >= until:
        return until - time, True
    return limit, False


@register_jitable
def rate_of_supports(change: float, is_divergence: bool, dimension: int, dt: float) -> float:
    """Return the largest |dH/dt|/H from the largest |div v|, or from the change of H in a step."""
    if is_divergence:
        return change / dimension
    # smaller changes cannot exceed SUPPORT_CHANGE in a step; they may come from the iteration of H,
    # which continues in steps of any length
    return change / dt if change > SUPPORT_CHANGE / GROWTH else 0.0


@register_jitable
def restricted(dt, particle, criterion, rate, changed, allowed, end):
    """Return (dt, particle, criterion), changed if another limit is smaller than dt.

    criterion: index in CRITERIA; rate, changed: largest |dH/dt|/H, and its particle; allowed: the
    limit of the last step, inf at the start; end: the time at which the run ends.
    """
    if rate * dt > SUPPORT_CHANGE:
        dt, particle, criterion = SUPPORT_CHANGE / rate, changed, SUPPORT
    if dt > GROWTH * allowed:
        dt, particle, criterion = GROWTH * allowed, 0, GROW
    if dt > end:
        dt, particle, criterion = end, 0, END
    return dt, particle, criterion
