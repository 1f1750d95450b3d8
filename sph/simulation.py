"""The simulation: steps 1-9 of the seed, in its order, on whatever the scene has."""

import numpy as np
from numba.core.registry import cpu_target

from sph import faults, passes, resolution, totals
from sph.clock import Clock
from sph.integrators import leapfrog, step_size
from sph.neighbours.order import number_of_blocks
from sph.neighbours.search import Origin, Search
from sph.particles import Particles
from sph.passes import contacts, density, nearest, rates, shocks
from sph.scene import Scene
from sph.threads import Team
from sph.watchdog import Watchdog

# Each widening lists to at least the radius that was asked for, which grows by 2 at the most.
MAX_WIDENINGS = 60

# Arrays that a step fills before it reads them: a new order need not carry them along.
NEW_EACH_STEP = ("acceleration", "energy_rate", "alpha_rate", "density", "omega", "pressure")


class Simulation:
    """Particles and the means to move them on.

    Attributes of use to others: particles, time, step (steps taken), limit (the coming step and
    what sets it), totals, energy_drift, energy_added, energy_injected, scene, search.origin,
    clock, watchdog.
    """

    def __init__(self, scene: Scene, particles: Particles, threads: int, clock: Clock):
        with clock.phase("start of Numba"):
            # its tables are filled on first use; here, so that no phase of a step pays for it
            cpu_target.target_context.refresh()
        self.scene = scene
        self.particles = particles
        self.clock = clock
        self.team = Team(threads)
        self.search = Search(scene.domain, self.team)
        self.time = 0.0
        self.step = 0
        self.steps_here = 0  # of this session, which a restart begins anew
        self.list_builds = 0
        self.held_supports = 0  # particles too lonely for a support within physics.max_support
        self.limit = None
        self.totals = None
        self.baseline = None  # of the energy drift: set at the start, or by `go_on_from`
        self.energy_drift = 0.0
        self.energy_added = 0.0  # by heating, since the run began
        self.energy_injected = 0.0  # to keep internal energies positive, since the run began
        self.watchdog = Watchdog(scene)
        n, blocks = particles.number, number_of_blocks(particles.number)
        if not scene.sums_pressure:
            particles.pressure = None
        elif particles.pressure is None:  # a start, or a restart that has changed the scheme
            particles.pressure = particles.pressure_by(scene.eos)
        if not scene.evolves_alpha or scene.finds_shocks:
            particles.alpha_rate = None
        elif particles.alpha_rate is None:  # a restart that has changed the switch
            particles.alpha_rate = np.zeros(n)
        self._dim = (0,) * scene.dimension
        self._support = np.zeros(n)
        self._velocity = np.empty_like(particles.velocity)  # full-step predictions (eqs 4-6)
        self._energy = np.empty(n)
        self._alpha = None if particles.alpha_rate is None else np.empty(n)
        self._pressure_term = np.empty(n)
        self._energy_shift = np.empty(n) if scene.sums_pressure else None
        self._sound_speed = np.empty(n)
        self._signal_speed = np.empty(n)
        self._wanted = np.empty(blocks)
        self._shares = np.empty(n) if scene.finds_contacts else None
        self._div_v = np.empty(n) if scene.needs_divergence else None
        self._curl_v = np.empty(n) if scene.needs_curl else None
        self._balsara = np.empty(n) if scene.config.physics.balsara else None

    @classmethod
    def start(cls, scene: Scene, threads: int, clock: Clock) -> "Simulation":
        """From the problem's initial state, ready for the first step. Raises NumericalError."""
        self = cls.of_problem(scene, threads, clock)
        self.begin()
        return self

    @classmethod
    def of_problem(cls, scene: Scene, threads: int, clock: Clock) -> "Simulation":
        """The problem's initial state, of which nothing has been computed yet."""
        with clock.phase("initial state"):
            initial = scene.initial_state()
            alpha = float(scene.viscosity.start()) if scene.evolves_alpha else None
            particles = Particles.at_start(*initial, alpha=alpha)
        return cls(scene, particles, threads, clock)

    def begin(self) -> None:
        """Converged supports, rates, and the first step. Raises NumericalError."""
        self.watchdog.check_range(self)
        resolution.check_extent(self)
        self._keep_predictions()
        self._build_lists(dt=0.0, guess=True)
        self._density(self.scene.starting_models)
        resolution.check(self)
        self._rates(self.scene.starting_models)
        self._measure(past=None)

    @classmethod
    def resume(
        cls, scene: Scene, particles: Particles, time: float, step: int, next_step: float,
        origin: Origin, threads: int, clock: Clock,
    ) -> "Simulation":  # fmt: skip
        """From a checkpoint, to go on bit for bit as if there had been no stop."""
        self = cls(scene, particles, threads, clock)
        self.time, self.step = time, step
        self.limit = step_size.StepLimit(next_step, 0, "checkpoint")
        with clock.phase("lists"):
            self.search.build(origin, particles.id)
        self.totals = totals.of(particles, scene.external, scene.keeps_momentum)
        self.go_on_from(totals.Baseline.at(self.totals, 0.0))
        return self

    def go_on_from(self, baseline: totals.Baseline) -> None:
        """Measure the energy drift from `baseline`."""
        self.baseline = baseline
        self.energy_drift = baseline.drift(self.totals, self.energy_added)

    def advance(self, until: float) -> None:
        """One step (steps 1-9 of the seed), cut where it would pass `until`.

        Raises NumericalError where the new state means nothing.
        """
        allowed = self.limit.dt
        dt, landing = allowed, False
        # a remainder of a billionth of a step is rounding, not a step
        if self.time + dt * (1 + 1e-9) >= until:
            dt, landing = until - self.time, True
        p = self.particles
        with self.clock.phase("predict, correct"):
            self._heat(dt / 2)
            leapfrog.predict(dt, p.position, p.velocity, p.acceleration, self._velocity)
            self.energy_injected += leapfrog.predict_energy(
                dt, p.internal_energy, p.energy_rate, p.mass, self._energy
            )
            if self.scene.heating is not None:
                self._energy = self.scene.heating.heated(self._energy, dt / 2)
            if p.alpha_rate is not None:
                leapfrog.predict_scalar(dt, p.alpha, p.alpha_rate, self._alpha)
            stale = self.search.stale(p.position, p.support)
        if stale:
            self._build_lists(dt)
        self._density(self.scene.models)
        if self.scene.finds_shocks:
            self._find_shocks(dt)
        self._rates(self.scene.models)
        with self.clock.phase("predict, correct"):
            leapfrog.correct(dt, p.velocity, p.acceleration)
            self.energy_injected += leapfrog.correct_energy(
                dt, p.internal_energy, p.energy_rate, p.mass
            )
            self._heat(dt / 2)
            if p.alpha_rate is not None:
                leapfrog.correct(dt, p.alpha, p.alpha_rate)
        self.step += 1
        self.steps_here += 1
        self.time = until if landing else self.time + dt
        self._measure(step_size.Past(dt, allowed, self._support))

    @property
    def volume_ratio(self) -> float | None:
        """Sum of m/rho over the volume of the box, None where gas does not fill a closed box."""
        return self.totals.volume / self.scene.domain.volume if self.scene.is_filled else None

    def nearest(self) -> np.ndarray:
        """(N,) distance of each particle to its nearest neighbour, in particle spacings.

        inf where no neighbour lies within the support.
        """
        p = self.particles
        found = np.empty(p.number)
        self.team.run(
            nearest.nearest, self._wanted.size, self._dim, self._neighbours(), p.position,
            p.support, p.mass, p.density, found,
        )  # fmt: skip
        return found

    def close(self) -> None:
        self.team.close()

    # --- the parts of a step ---

    def _keep_predictions(self) -> None:
        """At the start the predicted values are the values themselves."""
        p = self.particles
        self._velocity[:] = p.velocity
        self._energy[:] = p.internal_energy
        if p.alpha_rate is not None:
            self._alpha[:] = p.alpha

    def _build_lists(self, dt: float, guess: bool = False) -> None:
        """Order the particles anew and list their candidates."""
        p = self.particles
        self.list_builds += 1
        with self.clock.phase("order"):
            self._bring_inside()
            order = self.search.order(p.position, p.id)
            kept = ("acceleration",) if self.scene.finds_shocks else ()
            for name, array in p.arrays().items():
                if name in kept or name not in NEW_EACH_STEP:
                    setattr(p, name, np.ascontiguousarray(array[..., order]))
            self._velocity = np.ascontiguousarray(self._velocity[:, order])
            self._energy = self._energy[order]
            if p.alpha_rate is not None:
                self._alpha = self._alpha[order]
        with self.clock.phase("lists"):
            if guess:
                models = self.scene.models
                p.support = self.search.guess(p.position, models.support_ratio * models.eta)
            skin = self.search.skin_for(self._velocity, p.support, dt)
            self.search.build(Origin(p.position.copy(), p.support.copy(), skin), p.id)

    def _bring_inside(self) -> None:
        p = self.particles
        vectors = (p.velocity, self._velocity)
        if self.scene.finds_shocks:  # the last step's, whose gradient this step needs
            vectors += (p.acceleration,)
        self.scene.domain.bring_inside(p.position, vectors)

    def _neighbours(self) -> passes.Neighbours:
        search = self.search
        return passes.Neighbours(
            search.lists, search.images, search.origin.support, search.reach_factor
        )

    def _gas(self) -> passes.Gas:
        p = self.particles
        return passes.Gas(p.position, self._velocity, p.mass, self._energy, p.support)

    def _fields(self, support) -> passes.Fields:
        p = self.particles
        return passes.Fields(support, p.density, p.omega, self._pressure_term, self._sound_speed)

    def _summed(self) -> passes.SummedPressure | None:
        if self._energy_shift is None:
            return None
        return passes.SummedPressure(self.particles.pressure, self._energy_shift)

    def _density(self, models) -> None:
        """Steps 2-4 and 6: density, support, Omega, div and curl, EOS, Balsara, alpha's rate."""
        p = self.particles
        self._wanted.fill(1.0)
        for _ in range(MAX_WIDENINGS):
            with self.clock.phase("density"):
                self.team.run(
                    density.density, self._wanted.size, self._dim, models, self._neighbours(),
                    self._gas(), self._alpha, self._fields(self._support),
                    self._summed(), self._div_v, self._curl_v, self._balsara, p.alpha_rate,
                    self._wanted,
                )  # fmt: skip
            if not self._wanted.max() > 0.0:
                p.support, self._support = self._support, p.support
                self._check_found(models)
                return
            with self.clock.phase("lists"):
                self._bring_inside()
                self.search.widen(p.position, self._wanted, p.id)
        raise faults.starved(self, int(np.argmax(self._wanted)))

    def _check_found(self, models) -> None:
        """Count the supports that are held; raise where one has no root however small it is."""
        p = self.particles
        if models.max_support < np.inf:
            self.held_supports = int(np.count_nonzero(p.support == models.max_support))
        if p.density.min() < 0.0:
            raise faults.crowded(self)

    def _find_shocks(self, dt: float) -> None:
        """Alpha at the end of the step dt, from gradients of velocity and acceleration."""
        p = self.particles
        with self.clock.phase("viscosity"):
            self.team.run(
                shocks.shocks, self._wanted.size, self._dim, self.scene.models, self._neighbours(),
                self._gas(), p.alpha, self._fields(p.support), self._div_v, p.acceleration, dt,
            )  # fmt: skip

    def _find_contacts(self, models) -> None:
        """What part of the conductivity acts on each particle."""
        with self.clock.phase("conductivity"):
            self.team.run(
                contacts.contacts, self._wanted.size, self._dim, models, self._neighbours(),
                self._gas(), self._shares, self._fields(self.particles.support),
            )  # fmt: skip

    def _rates(self, models) -> None:
        """Step 5: acceleration, rate of energy, and each particle's signal speed."""
        p = self.particles
        if self._shares is not None:
            self._find_contacts(models)
        with self.clock.phase("rates"):
            self.team.run(
                rates.rates, self._wanted.size, self._dim, models, self._neighbours(),
                self._gas(), p.alpha if self.scene.finds_shocks else self._alpha,
                self._fields(p.support), self._summed(),
                self._balsara, self._energy if self.scene.conducts else None, self._shares,
                p.acceleration, p.energy_rate, self._signal_speed,
            )  # fmt: skip
            if self.scene.external is not None:
                p.acceleration += self.scene.external.acceleration(p.position)

    def _heat(self, dt: float) -> None:
        """What heating does to the internal energies in dt, and its sum over the run."""
        if self.scene.heating is None:
            return
        p = self.particles
        before = p.internal_energy
        p.internal_energy = self.scene.heating.heated(before, dt)
        self.energy_added += float(p.mass @ (p.internal_energy - before))

    def _measure(self, past: step_size.Past | None) -> None:
        """Step 8, the sums of the history, and whether the state means anything."""
        with self.clock.phase("step size, sums"):
            self.totals = totals.of(self.particles, self.scene.external, self.scene.keeps_momentum)
            if self.baseline is None:
                self.baseline = totals.Baseline.at(self.totals, self.energy_added)
            self.energy_drift = self.baseline.drift(self.totals, self.energy_added)
            bounds, p = self.scene.step_bounds, self.particles
            limit = step_size.limit(bounds, p, self._signal_speed, self._div_v, past)
            self.limit = step_size.before_contact(limit, bounds, p, self.scene.domain)
            self.watchdog.check(self)
