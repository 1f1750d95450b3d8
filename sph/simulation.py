"""The simulation: one time step after another. The parts of the scene hold the physics."""

from typing import Any

import numpy as np

from sph import compile_cache, declarations, faults, passes, resolution, totals
from sph.clock import PLACING, STARTING, Clock
from sph.individual import Individual
from sph.integrators import leapfrog, step_size
from sph.neighbours.order import number_of_blocks
from sph.neighbours.search import Origin, Search
from sph.part import Pass
from sph.passes import nearest
from sph.problems.base import Relaxation
from sph.scene import Scene
from sph.state import State
from sph.steps import Steps, rows
from sph.threads import Team
from sph.watchdog import Watchdog

# Each widening extends lists at least to the requested radius. A request is at most twice the
# radius of the last one.
MAX_WIDENINGS = 60


class Simulation:
    """The state of a run and the methods that advance it.

    Public attributes: particles, time, step (number of steps), limit (the next step and its
    criterion), totals, energy_drift, energy_added, energy_injected, scene, search.origin, clock,
    watchdog.
    """

    def __init__(self, scene: Scene, particles: State, threads: int, clock: Clock):
        with clock.phase(STARTING):
            compile_cache.start_numba()  # here, where it adds no time to other phases
        self.scene = scene
        self.particles = particles
        self.clock = clock
        self.team = Team(threads)
        self.search = Search(scene.domain, self.team)
        self.time = 0.0
        self.step = 0
        self.steps_here = 0  # since the start or the last restart
        self.updates_here = 0  # of particles, in these steps
        self.list_builds = 0
        self.held_supports = 0  # number of particles whose support is limited by max_support
        # set by `begin` or `resume`
        self.limit: step_size.StepLimit = None  # type: ignore[assignment]
        self.totals: totals.Totals = None  # type: ignore[assignment]
        # reference of the energy drift; set at the start or by `go_on_from`
        self.baseline: totals.Baseline | None = None
        self.energy_drift = 0.0
        self.energy_added = 0.0  # by sources such as heating, since the start of the run
        self.energy_injected = 0.0  # to keep internal energies positive, since the start
        self.relaxation: Relaxation | None = None  # before the start; unknown after a restart
        self.watchdog = Watchdog(scene)
        missing = particles.declare(scene.fields)
        for part in scene.all_parts:
            part.remake(particles, missing)
        self.evolved = tuple(one for part in scene.all_parts for one in part.evolved)
        # with individual steps, passes write the fields of active particles only
        names = tuple(field.name for field in scene.fields)
        self._carried = names if scene.has_individual_steps else carried(scene)
        self._reflected = [
            field for field in scene.fields if field.rank and field.name in self._carried
            and field.name != "position"
        ]  # fmt: skip
        self.sweep = passes.Sweep(
            particles, self.team, number_of_blocks(particles.number), scene.formulation.models
        )
        self.individual = Individual(self) if scene.has_individual_steps else None
        self.rows: list[rows.Columns] = []  # of the history, not yet recorded
        self._steps = Steps(self)

    @classmethod
    def start(cls, scene: Scene, threads: int, clock: Clock) -> "Simulation":
        """Return a simulation ready for its first step. Raises NumericalError."""
        self = cls.of_problem(scene, threads, clock)
        self.begin()
        return self

    @classmethod
    def of_problem(cls, scene: Scene, threads: int, clock: Clock) -> "Simulation":
        """Return a simulation with the problem's initial state, before `begin`."""
        with clock.phase(PLACING):
            start = scene.initial_state()
            particles = State.at_start(scene.fields, *start.particles)
            for part in scene.all_parts:
                part.start(particles)
        self = cls(scene, particles, threads, clock)
        self.relaxation = start.relaxation
        return self

    def begin(self) -> None:
        """Compute converged supports, rates, and the first step size. Raises NumericalError."""
        self.watchdog.check_range(self)
        resolution.check_extent(self)
        leapfrog.keep(self.particles, self.evolved)
        self._build_lists(dt=0.0, guess=True)
        self.sweep.is_start = True
        for one in self.scene.passes:
            if one.at_start:
                self._make(one)
            if one.widens:
                resolution.check(self)
        self.sweep.is_start = False
        declarations.check_returned(self.scene.all_parts, self.particles)
        if self.individual is not None:
            self.individual.begin()
        self.measure()
        self.check_fields()

    @classmethod
    def resume(
        cls, scene: Scene, particles: State, time: float, step: int, next_step: float,
        origin: Origin, threads: int, clock: Clock, budget: totals.Budget | None = None,
    ) -> "Simulation":  # fmt: skip
        """Return a simulation that continues a checkpoint bit for bit.

        budget: the energy budget of the checkpoint; None starts a new budget.
        """
        self = cls(scene, particles, threads, clock)
        self.time, self.step = time, step
        self.limit = step_size.StepLimit(next_step, 0, "checkpoint")
        with clock.phase("lists"):
            self.search.build(origin, particles.id)
        declarations.check_returned(scene.all_parts, particles)
        self.totals = totals.of(particles, scene.all_parts, scene.keeps_momentum)
        anew = totals.Budget(0.0, 0.0, totals.Baseline.at(self.totals, 0.0))
        self.go_on_from(anew if budget is None else budget)
        return self

    @property
    def budget(self) -> totals.Budget:
        """The energy budget that a restart continues."""
        baseline = self.baseline or totals.Baseline(0.0, 0.0)  # of a run that failed at its start
        return totals.Budget(self.energy_injected, self.energy_added, baseline)

    def go_on_from(self, budget: totals.Budget) -> None:
        """Continue the energy sums of `budget`, and measure energy drift from its baseline."""
        self.energy_injected, self.energy_added, self.baseline = budget
        self.energy_drift = self.baseline.drift(self.totals, self.energy_added)

    def advance(self, until: float) -> None:
        """Take one time step (steps 1-9 of docs/equations.md), which ends at `until` or earlier.

        With individual steps, that is one long step. Raises NumericalError if the new state is
        unphysical.
        """
        if self.individual is not None:
            self.individual.advance(until)
            return
        dt, lands = step_size.next_step(self.time, self.limit.dt, until)
        p = self.particles
        with self.clock.phase("predict, correct"):
            self.split(dt / 2)
            self.energy_injected += leapfrog.predict(p, self.evolved, dt, self.team)
            for part in self.scene.all_parts:
                part.split_predicted(p, dt / 2)
        self.renew_lists(dt)
        self.complete(dt, until if lands else self.time + dt)

    def proceed(self, until: float, most: int, pause: float = np.inf) -> None:
        """Take one or more steps, up to `most`, which end at `until` or earlier.

        `pause` changes no step: the step that reaches this time is the last one taken. Keeps
        the rows of the history of valid steps for `take_rows`. Raises NumericalError.
        """
        if self._steps.may_begin():
            self._steps.take(until, most, pause)
        else:
            self.advance(until)
            self.keep_row()

    def keep_row(self) -> None:
        """Keep the row of the history of the present state. Raises NumericalError."""
        self._steps.pour()
        self.rows.append(rows.of_simulation(self))

    def take_rows(self) -> list[rows.Columns]:
        """Return the rows of the history that were kept since the last call, as columns."""
        self._steps.pour()
        kept, self.rows = self.rows, []
        return kept

    def renew_lists(self, dt: float) -> None:
        """Build the lists of a step of length dt if the old ones do not serve it."""
        p = self.particles
        with self.clock.phase("predict, correct"):
            stale = self.search.stale(p.position, p.support)
        if stale:
            self._build_lists(dt)

    def complete(self, dt: float, end: float) -> None:
        """Do what follows the lists in a step of length dt, which ends at the time `end`."""
        p, allowed = self.particles, self.limit.dt
        self.sweep.dt = dt
        self.make_passes()
        with self.clock.phase("predict, correct"):
            self.energy_injected += leapfrog.correct(p, self.evolved, dt, self.team)
        self.make_last_passes()
        self.end_step(dt, end, step_size.Past(dt, allowed))

    def make_passes(self) -> None:
        """Run the passes before the correction, with the lists that they need."""
        for one in self.scene.rate_passes:
            self._make(one)

    def make_last_passes(self) -> None:
        """Run the passes after the correction."""
        for one in self.scene.last_passes:
            self._make(one)

    def split(self, dt: float) -> None:
        """Apply the sources that are integrated apart from the flow, for half a step."""
        for part in self.scene.all_parts:
            self.energy_added += part.split(self.particles, dt)

    def end_step(self, dt: float, end: float, past: step_size.Past | None = None) -> None:
        """Do what follows the correction in a step of length dt, which ends at the time `end`."""
        with self.clock.phase("predict, correct"):
            self.split(dt / 2)
        self.step += 1
        self.steps_here += 1
        self.updates_here += self.individual.updates if self.individual else self.particles.number
        self.time = end
        self.measure(past)

    def measure(self, past: step_size.Past | None = None) -> None:
        """Do step 8: totals, energy drift, the next step, and the watchdog's checks."""
        with self.clock.phase("step size, sums"):
            scene, p = self.scene, self.particles
            self.totals = totals.of(p, scene.all_parts, scene.keeps_momentum, self.team)
            if self.baseline is None:
                self.baseline = totals.Baseline.at(self.totals, self.energy_added)
            self.energy_drift = self.baseline.drift(self.totals, self.energy_added)
            if self.individual is not None:
                self.limit = self.individual.limit()
            else:
                limit = step_size.limit(scene.step_bounds, p, scene.all_parts, past, self.team)
                self.limit = step_size.before_contact(limit, scene.step_bounds, p, scene.domain)
            self.watchdog.check(self)

    def check_fields(self) -> None:
        """Raise an error for a stored field that could not be read back from a checkpoint."""
        declarations.check_arrays(self.scene.all_parts, self.particles)
        self.watchdog.check_fields(self)
        for part in self.scene.all_parts:
            part.check_output(self)

    @property
    def volume_ratio(self) -> float | None:
        """Sum of m/rho over the volume of the box; None unless gas fills a closed box."""
        return self.totals.volume / self.scene.domain.volume if self.scene.is_filled else None

    def nearest(self) -> np.ndarray:
        """Return the distance (N,) to the nearest neighbour, in particle spacings.

        inf if there is no neighbour within the support radius.
        """
        p = self.particles
        found = np.empty(p.number)
        self.sweep.neighbours = self.neighbours()
        self.sweep.run(nearest.nearest, None, p.position, p.support, p.mass, p.density, found)
        return found

    def columns(self) -> dict[str, float]:
        """Return the columns of the history that only some scenes have (`Scene.columns`)."""
        scene = self.scene
        found: dict[str, Any] = dict(self.totals.energies)
        if scene.max_support < np.inf:
            found["held_supports"] = self.held_supports
        if scene.is_filled:
            found["volume_ratio"] = self.volume_ratio
        if scene.adds_energy:
            found["energy_added"] = self.energy_added
        if self.individual is not None:
            found |= self.individual.columns()
        for part in scene.all_parts:
            found |= part.sums(self.particles)
        for name, value in found.items():
            if not np.isfinite(value):  # a restart could not read the history
                raise faults.fault(self, f"{name} is {value}", faults.of_numbers(self), 0)
        return {name: found[name] for name in scene.columns}

    def end(self) -> None:
        """Free the work arrays, which only further steps need, before the results are judged."""
        self.particles.declare(field for field in self.particles.fields if field.stored)

    def close(self) -> None:
        self.team.close()

    # --- the parts of a step ---

    def _build_lists(self, dt: float, guess: bool = False) -> None:
        """Reorder the particles and build the candidate lists."""
        p = self.particles
        self.list_builds += 1
        with self.clock.phase("order"):
            self.search.forget()
            self._bring_inside()
            p.reorder(self.search.order(p.position, p.id), self._carried, self.team)
        with self.clock.phase("lists"):
            if guess:
                models = self.scene.formulation.models
                p.support = self.search.guess(p.position, models.support_ratio * models.eta)
            share = 1.0 if self.individual is None else self.individual.share
            skin = self.search.skin_for(p.predicted_velocity, p.support, dt, share)
            self.search.build(Origin(p.position.copy(), p.support.copy(), skin), p.id)
        self._steps.has_new_lists = True

    def _bring_inside(self) -> None:
        p = self.particles
        self.scene.domain.bring_inside(p.position, [getattr(p, f.name) for f in self._reflected])

    def neighbours(self) -> passes.Neighbours:
        search: Any = self.search  # whose lists are built before the first pass
        return passes.Neighbours(
            search.lists,
            search.images,
            search.boxes,
            search.origin.support,
            search.reach_factor,
            self.scene.lanes,
            self.particles.get("active"),
        )

    def _make(self, one: Pass) -> None:
        """Run a pass, and repeat it with wider lists as long as it requests them."""
        sweep, p = self.sweep, self.particles
        sweep.want_all(one)
        for _ in range(MAX_WIDENINGS if one.widens else 1):
            sweep.neighbours = self.neighbours()
            with self.clock.phase(one.phase):
                sweep.make(one)
            sweep.neighbours = None  # so that `build` can free the lists
            if not one.widens:
                return
            if not sweep.wanted.max() > 0.0:
                self._check_found()
                return
            with self.clock.phase("lists"):
                self.search.widen(sweep.wanted, p.id)
            self._steps.has_new_lists = True
        raise faults.starved(self, int(np.argmax(sweep.wanted)))

    def _check_found(self) -> None:
        """Count supports limited by max_support. Raise NumericalError if one was not found."""
        p, most = self.particles, self.scene.max_support
        if most < np.inf:
            self.held_supports = int(np.count_nonzero(p.support == most))
        if p.density.min() < 0.0:
            raise faults.crowded(self)


def carried(scene: Scene) -> tuple[str, ...]:
    """Return the fields that must be reordered: those that a step reads before writing."""
    read: set[str] = set()
    written: set[str] = set()
    for one in scene.passes:
        read |= one.fields_read - written
        written |= one.fields_written
    return tuple(
        field.name for field in scene.fields if field.name in read or field.name not in written
    )
