"""A simulation with individual time steps (`sph.integrators.bins`).

A long step begins and ends with all particles at one time. Checkpoints, sums, the watchdog and the
history see only these times. Within a long step the simulation proceeds from one time at which
steps end to the next. There, all particles are predicted, but only the active particles, whose
steps end, get new densities and rates. Density and support of the others follow
drho/dt = -rho div v. `sph.integrators.limiter` restricts the steps of neighbours, and wakes
particles with long steps: their steps then end early.

The rate of a pair acts on the active particle alone, so total energy and momentum are conserved to
the accuracy of the time steps, not to round-off.
"""

from typing import Any

import numpy as np

from sph import faults
from sph.integrators import bins, leapfrog, limiter, step_size
from sph.integrators.bins import DEPTH, TICKS
from sph.integrators.step_size import CRITERIA, StepLimit


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
            found = s.team.chunks(bins.begin_all, p.number, TICKS / length, *arrays)
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
            now = min(s.team.chunks(bins.first_end, p.number, p.step_end))
            dt = (now - before) * tick
            times = p.step_begin, p.step_end, p.active, self._since, p.own_step
            self.updates += sum(s.team.chunks(bins.activate, p.number, now, tick, *times))
            drifting = p.div_v, p.density, p.support
            s.team.chunks(bins.drift, p.number, dt, p.dimension, s.scene.max_support, *drifting)
            given = leapfrog.predict_each(p, s.evolved, dt, self._since, p.own_step, s.team)
            s.energy_injected += given
        s.renew_lists(self._shortest)
        s.sweep.dt = p.own_step
        s.make_passes()
        with s.clock.phase("predict, correct"):
            s.energy_injected += leapfrog.correct_each(p, s.evolved, p.own_step, s.team)
        s.make_last_passes()
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
                bins.allow, n, bounds.courant, bounds.energy, p.dimension, p.active, p.own_step,
                p.id, p.support, p.signal_speed, p.internal_energy, p.energy_rate, acceleration,
                p.div_v, p.time_step,
            ))  # fmt: skip
            shortest, particle, index = found
            if not shortest > 0.0:
                s.measure()  # names what is not finite
                raise self._collapsed(shortest, particle)
            self._found = shortest, particle, CRITERIA[index] if index else bounds.criterion
            for part in s.scene.all_parts:
                self._limit_by_part(part)
            s.team.chunks(bins.lengths, n, tick, p.time_step, p.active, p.step_begin, p.step_end,
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
            s.team.chunks(bins.begin_next, p.number, now, tick, self._length, self._allowed,
                          p.active, p.time_step, p.step_begin, p.step_end)  # fmt: skip

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
