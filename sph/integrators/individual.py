"""Individual (block) time steps: each particle has its own step, a power of two of ticks.

A long step of the simulation has TICKS ticks and begins and ends with all particles at one time.
Checkpoints, sums, the watchdog and the history see only these times. Within a long step the
simulation proceeds from one time at which steps end to the next. There, all particles are
predicted, but only the active particles, whose steps end, get new densities and rates. Density and
support of the others follow drho/dt = -rho div v.

A step is at most twice as long as the particle's last one, and begins at a multiple of its own
length. `limiter` restricts the steps of neighbours, and wakes particles with long steps: their
steps then end early.

The rate of a pair acts on the active particle alone, so total energy and momentum are conserved to
the accuracy of the time steps, not to round-off.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable

from sph import faults
from sph.compiled import COMPILED
from sph.integrators import leapfrog, limiter, step_size
from sph.integrators.step_size import CRITERIA, SUPPORT_CHANGE, StepLimit
from sph.part import Pass
from sph.state import Field, Public

TICKS = 2.0**40  # of a long step: exact in floating point

# The longest step is at most this multiple of the shortest. Particles whose own steps could be
# longer cost little if they are computed once in so many shortest steps.
DEPTH = 128.0

LONGER = 2.0  # largest ratio of a step to the last step of the particle

PREDICTION = 0.6  # largest |div v| dt for which the change of a density is predicted

FIELDS = (
    Field(
        "time_step",
        above=0.0,
        remade=True,
        public=Public("TimeSteps", 0, 0, 1, 0, "Time step that the state of the particle allows"),
    ),
    Field("step_begin", stored=False),  # in ticks of the present long step
    Field("step_end", stored=False),
    Field("own_step", stored=False),  # length of the step that ends now, or 0
    Field("active", stored=False),  # see `sph.passes.active`
)


def fields(of_parts: tuple[Field, ...], passes: tuple[Pass, ...]) -> tuple[Field, ...]:
    """Return the fields of a scene with individual steps, from those that its parts declare.

    A tick writes the fields of passes for active particles only, and reads them for all. Therefore
    checkpoints must contain them.
    """
    written = {name for one in passes for name in one.fields_written}
    written -= {one.swaps[1] for one in passes if one.swaps is not None}
    found = (
        field._replace(stored=True, remade=field.remade or not field.stored)
        if field.name in written else field
        for field in of_parts
    )  # fmt: skip
    return (*found, *FIELDS)


class Individual:
    """The individual time steps of a simulation."""

    def __init__(self, simulation: Any):
        self._simulation = simulation
        particles = simulation.particles
        self.updates = 0  # of particles, in the last long step
        self.shortest = 0.0  # step of the last long step
        # of the present long step when it begins: the shortest step, and the share of particles
        # that are active at its multiples
        self._shortest = 0.0
        self.share = 1.0
        self._since = np.empty(particles.number)
        self._length = np.empty(particles.number)
        self._allowed = np.empty(particles.number)
        self._of_blocks = limiter.Blocks.empty(simulation.sweep.wanted.size)
        particles.active[:] = 1.0

    def begin(self) -> None:
        """Choose the first steps. The rates of all particles are known."""
        p = self._simulation.particles
        p.own_step[:] = np.inf  # so that no earlier step limits the first
        self._choose(1.0)

    def limit(self) -> StepLimit:
        """Return the length of the next long step, and what sets the shortest step."""
        s = self._simulation
        p, bounds = s.particles, s.scene.step_bounds
        longest = float(p.time_step.max())
        part, particle = self._first_contact(longest)
        if part < 1.0:
            p.time_step *= part
            self._found = float(p.time_step.min()), particle, "approach"
        shortest, particle, criterion = self._found
        longest = min(shortest * DEPTH, float(p.time_step.max()), bounds.end)
        return StepLimit(longest, int(particle), criterion)

    def advance(self, until: float) -> None:
        """Take one long step, which ends at `until` or earlier. Raises NumericalError."""
        s = self._simulation
        length, lands = step_size.next_step(s.time, s.limit.dt, until)
        self._begin_long_step(length)
        now = 0.0
        while now < TICKS:
            now = self._proceed(now, length / TICKS)
        s.end_step(length, until if lands else s.time + length)

    def columns(self) -> dict[str, float]:
        """Return the columns of the history of runs with individual steps."""
        return {"shortest_step": self.shortest, "updates": self.updates}

    # --- the parts of a long step ---

    def _begin_long_step(self, length: float) -> None:
        s, p = self._simulation, self._simulation.particles
        self.updates, self.shortest = 0, length
        with s.clock.phase("predict, correct"):
            s.split(length / 2)
            arrays = p.time_step, p.step_begin, p.step_end
            found = s.team.chunks(_begin, p.number, TICKS / length, *arrays)
        shortest, rates = zip(*found, strict=True)
        self._shortest = min(shortest) * length / TICKS
        self.share = sum(rates) * min(shortest) / p.number
        if not min(shortest) >= 1.0:
            least = int(np.argmin(p.time_step))
            raise self._collapsed(float(p.time_step[least]), int(p.id[least]))

    def _proceed(self, before: float, tick: float) -> float:
        """Proceed to the next time at which steps end, and return it, in ticks."""
        s, p = self._simulation, self._simulation.particles
        with s.clock.phase("predict, correct"):
            now = min(s.team.chunks(_first_end, p.number, p.step_end))
            dt = (now - before) * tick
            times = p.step_begin, p.step_end, p.active, self._since, p.own_step
            self.updates += sum(s.team.chunks(_activate, p.number, now, tick, *times))
            drifting = p.div_v, p.density, p.support
            s.team.chunks(_drift, p.number, dt, p.dimension, s.scene.max_support, *drifting)
            given = leapfrog.predict_each(p, s.evolved, dt, self._since, p.own_step, s.team)
            s.energy_injected += given
        s.renew_lists(self._shortest)
        s.sweep.dt = p.own_step
        s.make_passes()
        with s.clock.phase("predict, correct"):
            s.energy_injected += leapfrog.correct_each(p, s.evolved, p.own_step, s.team)
        self._choose(tick)
        self._begin_steps(now, tick)
        return now

    def _choose(self, tick: float) -> None:
        """Choose steps for active particles, limited by their neighbours."""
        s, p = self._simulation, self._simulation.particles
        with s.clock.phase("step size, sums"):
            bounds, n = s.scene.step_bounds, p.number
            acceleration = p.acceleration if bounds.acceleration else None
            found = min(s.team.chunks(
                _allow, n, bounds.courant, bounds.energy, p.dimension, p.active, p.own_step, p.id,
                p.support, p.signal_speed, p.internal_energy, p.energy_rate, acceleration, p.div_v,
                p.time_step,
            ))  # fmt: skip
            shortest, particle, index = found
            if not shortest > 0.0:
                s.measure()  # names what is not finite
                raise self._collapsed(shortest, particle)
            self._found = shortest, particle, CRITERIA[index] if index else bounds.criterion
            for part in s.scene.all_parts:
                self._limit_by_part(part)
            s.team.chunks(_lengths, n, tick, p.time_step, p.active, p.step_begin, p.step_end,
                          self._length)  # fmt: skip
            self._limit_by_neighbours()
            self.shortest = min(self.shortest, shortest)

    def _limit_by_part(self, part) -> None:
        p = self._simulation.particles
        times = part.step_limit(p)
        if times is None:
            return
        np.minimum(p.time_step, times, out=p.time_step, where=p.active > 0.0)
        # the order of this comparison lets NaN pass, for the watchdog to find
        if not times.min() >= self._found[0]:
            self._found = float(times.min()), int(p.id[np.argmin(times)]), part.name

    def _limit_by_neighbours(self) -> None:
        s, p = self._simulation, self._simulation.particles
        blocks = self._of_blocks
        s.team.run(limiter.survey, blocks.shortest.size, self._length, p.support, p.active,
                   blocks)  # fmt: skip
        s.sweep.neighbours = s.neighbours()
        arrays = p.position, p.support, self._length, blocks, self._allowed
        s.sweep.run(limiter.limit, None, *arrays)
        s.sweep.neighbours = None

    def _begin_steps(self, now: float, tick: float) -> None:
        """Begin the new steps of active particles, and wake others whose steps are too long."""
        s, p = self._simulation, self._simulation.particles
        with s.clock.phase("step size, sums"):
            s.team.chunks(_begin_next, p.number, now, tick, self._length, self._allowed, p.active,
                          p.time_step, p.step_begin, p.step_end)  # fmt: skip

    def _collapsed(self, shortest: float, particle: int) -> Exception:
        what = f"the time step of particle {particle} fell to {shortest:.3g}"
        return faults.fault(self._simulation, what, faults.longer_steps(self._simulation), particle)

    def _first_contact(self, longest: float) -> tuple[float, int]:
        """As `step_size.before_contact`, for gas that would meet within its own steps."""
        s, p = self._simulation, self._simulation.particles
        share = p.time_step / longest
        return step_size.contact(
            s.scene.step_bounds, p, p.velocity * share, p.acceleration * share**2, s.scene.domain,
            longest,
        )  # fmt: skip


@register_jitable
def power_of_two(x: float) -> float:
    """Return the largest power of two up to x > 0."""
    return math.ldexp(1.0, math.frexp(x)[1] - 1)


# Each function below considers particles [first, last); arrays are (N,).


@njit(**COMPILED)
def _begin(first, last, per_tick, time_step, begin, end):
    """Begin a step for each particle. Return the shortest step, in ticks, and the sum of 1/step."""
    shortest, rates = np.inf, 0.0
    for i in range(first, last):
        length = min(power_of_two(max(time_step[i] * per_tick, 0.5)), TICKS)
        begin[i], end[i] = 0.0, length
        shortest = min(shortest, length)
        rates += 1.0 / length
    return shortest, rates


@njit(**COMPILED)
def _first_end(first, last, end):
    least = end[first]
    for i in range(first, last):
        least = min(least, end[i])
    return least


@njit(**COMPILED)
def _activate(first, last, now, tick, begin, end, active, since, own):
    """Set active, since and own for the time `now`; return the number of active particles."""
    number = 0
    for i in range(first, last):
        since[i] = (now - begin[i]) * tick
        ends = end[i] == now
        active[i] = 1.0 if ends else 0.0
        own[i] = since[i] if ends else 0.0
        number += ends
    return number


@njit(**COMPILED)
def _drift(first, last, dt, dimension, largest, divergence, density, support):
    """Predict density and support after dt, by drho/dt = -rho div v and dH/dt = H div v/D."""
    for i in range(np.uint64(first), np.uint64(last)):
        half = 0.5 * min(max(divergence[i] * dt, -PREDICTION), PREDICTION)
        # as good as exponentials for changes that are so small, and inverse to each other
        density[i] *= (1.0 - half) / (1.0 + half)
        half /= dimension
        support[i] = min(support[i] * (1.0 + half) / (1.0 - half), largest)


@njit(**COMPILED)
def _allow(
    first, last, courant, energy_limit, dimension, active, own, identity, support, signal_speed,
    energy, energy_rate, acceleration, divergence, time_step,
):  # fmt: skip
    """Set the steps that active particles allow: eq 32 and the limits of `step_size`.

    Returns the shortest, the ID of its particle, and the index of its criterion. The shortest is 0
    if a step is not positive.
    """
    best, particle, criterion = np.inf, 0, 0
    for i in range(first, last):
        if active[i] == 0.0:
            continue
        dt, reason = 2.0 * support[i] / signal_speed[i], 0
        if energy_limit and energy[i] > 0.0 and energy[i] < dt * abs(energy_rate[i]):
            dt, reason = energy[i] / abs(energy_rate[i]), 1
        if acceleration is not None:
            squared = 0.0
            for d in range(acceleration.shape[0]):
                squared += acceleration[d, i] ** 2
            by_acceleration = np.sqrt(support[i] / np.sqrt(squared))
            if by_acceleration < dt:
                dt, reason = by_acceleration, 2
        dt *= courant
        if abs(divergence[i]) * dt > SUPPORT_CHANGE * dimension:
            dt, reason = SUPPORT_CHANGE * dimension / abs(divergence[i]), 3
        if LONGER * own[i] < dt:
            dt, reason = LONGER * own[i], 4
        time_step[i] = dt
        if not dt > 0.0:  # NaN, too
            return 0.0, identity[i], reason
        if dt < best or (dt == best and identity[i] < particle):
            best, particle, criterion = dt, identity[i], reason
    return best, particle, criterion


@njit(**COMPILED)
def _lengths(first, last, tick, time_step, active, begin, end, length):
    """Set the lengths of steps in ticks: those allowed if active, otherwise the present ones."""
    for i in range(first, last):
        length[i] = time_step[i] / tick if active[i] > 0.0 else end[i] - begin[i]


@njit(**COMPILED)
def _begin_next(first, last, now, tick, length, allowed, active, time_step, begin, end):
    """Begin the next steps of active particles, and end the steps of others early if necessary."""
    for i in range(first, last):
        if active[i] > 0.0:
            if allowed[i] < length[i]:
                time_step[i] = allowed[i] * tick
            step = min(power_of_two(max(min(length[i], allowed[i]), 1.0)), TICKS)
            while math.floor(now / step) * step != now:  # steps begin at multiples of their length
                step *= 0.5
            begin[i], end[i] = now, now + step
        elif allowed[i] < length[i]:
            step = power_of_two(max(allowed[i], 1.0))
            end[i] = min(end[i], (math.floor(now / step) + 1.0) * step)
