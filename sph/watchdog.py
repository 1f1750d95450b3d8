"""The watchdog: whether the state of a simulation still means something, after every step.

Its tests use sums that the history needs anyway; particles are only looked at once one fails,
and where a sum would not tell: in open domains, and in gas that can be torn apart.
"""

import math

import numpy as np

from sph.faults import (
    LARGEST,
    NEARER_UNITS,
    drift_remedy,
    endless_sum,
    fault,
    fault_of,
    longer_steps,
    of_numbers,
    smaller_steps,
    what_sets,
)  # fmt: skip

# Steps over which the advance of time is compared with that of the run's own past, and by how much
# it may fall behind: cold gas meeting a shock may take some hundred steps of next to no length.
WINDOW = 1000
COLLAPSE = 1e-6

# How far outside an open domain a particle may be, in lengths of the domain along that axis.
FAR = 100.0

# How far sum m/rho may be from the volume of a box that gas fills, as a factor, and the steps that
# particles at random places have to settle: shipped problems keep to 5 %, random places begin at
# 0.3 to 0.9 and come to 0.97 within 100 steps, while eta = 0.8 stays below 0.7 in 2-D and 3-D.
MOST_VOLUME = 4.0 / 3.0
SETTLING = 100

# Windows to go beyond which a run is not going anywhere: more steps than a machine lasts for.
MOST_WINDOWS = 1e12


class Watchdog:
    """Knows what a run began with; `check` raises NumericalError where its state means nothing."""

    def __init__(self, scene):
        self.max_drift = scene.config.physics.max_energy_drift
        box, kinds = scene.domain.box, scene.domain.boundaries
        open_axes = [axis for axis, kind in enumerate(kinds) if kind == "open"]
        self._fences = [
            (axis, lo - FAR * (hi - lo), hi + FAR * (hi - lo))
            for axis in open_axes
            for lo, hi in [box[axis]]
        ]
        self._end = scene.config.time.end
        self._marked = None  # (time, step) at which the present window began
        self._longest = 0.0  # time covered by the best window

    def check_range(self, simulation) -> None:
        """Raise NumericalError, before anything is summed, where sums could not be numbers."""
        box = simulation.scene.domain.box
        for axis, length in zip("xyz", box[:, 1] - box[:, 0], strict=False):
            if not 1.0 / LARGEST < length < LARGEST:
                raise fault(simulation, f"the domain is {length:g} long in {axis}", NEARER_UNITS, 0)
        if not 1.0 / LARGEST < self._end < LARGEST:
            raise fault(simulation, f"time.end is {self._end:g}", NEARER_UNITS, 0)
        p = simulation.particles
        for name, values, smallest in (
            ("mass", p.mass, 1.0 / LARGEST),
            ("position", p.position, -LARGEST),
            ("velocity", p.velocity, -LARGEST),
            ("internal energy", p.internal_energy, 0.0),
        ):
            bad = ~((values >= smallest) & (values < LARGEST))
            if bad.any():
                raise fault_of(simulation, name, values, bad, NEARER_UNITS)

    def check(self, simulation) -> None:
        """Raise NumericalError, which names a particle, where `simulation` cannot go on."""
        for part in simulation.scene.all_parts:
            part.check(simulation)
        self._check_numbers(simulation)
        self._check_energy(simulation)
        self._check_volume(simulation)
        self._check_fences(simulation)
        self._check_pace(simulation)

    def _check_numbers(self, simulation) -> None:
        totals, dt = simulation.totals, simulation.limit.dt
        sums = (totals.energy, totals.max_density, totals.rates, dt)
        positive = totals.min_density > 0 and totals.min_internal_energy >= 0
        finite = all(map(math.isfinite, sums))
        if positive and finite and simulation.time + dt > simulation.time:
            return
        p = simulation.particles
        tests = (
            ("density", p.density, ~(p.density > 0) | ~np.isfinite(p.density)),
            ("internal energy", p.internal_energy, ~(p.internal_energy >= 0)),
            ("velocity", p.velocity, ~np.isfinite(p.velocity)),
            ("acceleration", p.acceleration, ~np.isfinite(p.acceleration)),
            ("rate of energy", p.energy_rate, ~np.isfinite(p.energy_rate)),
        )
        for name, values, bad in tests:
            if bad.any():
                raise fault_of(simulation, name, values, bad, of_numbers(simulation))
        if not finite:
            raise endless_sum(simulation)
        raise fault(
            simulation,
            f"the time step fell to {dt:.3g}, too small to advance time: {what_sets(simulation)}",
            longer_steps(simulation),
            simulation.limit.particle,
        )

    def _check_energy(self, simulation) -> None:
        if abs(simulation.energy_drift) <= self.max_drift:
            return
        p = simulation.particles
        i = int(np.argmax(p.mass * (0.5 * (p.velocity**2).sum(axis=0) + p.internal_energy)))
        raise fault(
            simulation,
            f"total energy has drifted by {100 * simulation.energy_drift:.3g} %, more than "
            f"physics.max_energy_drift = {self.max_drift:g}; particle {p.id[i]} holds the most",
            drift_remedy(simulation),
            int(p.id[i]),
        )

    def _check_volume(self, simulation) -> None:
        ratio = simulation.volume_ratio
        if ratio is None or simulation.step < SETTLING or 1 / MOST_VOLUME < ratio < MOST_VOLUME:
            return
        raise fault(
            simulation,
            f"the densities do not fit the box: the sum of m/rho is {ratio:.3g} of its volume",
            "a larger physics.eta, as kernels reach too few neighbours, or more particles",
            0,
        )

    def _check_fences(self, simulation) -> None:
        p = simulation.particles
        for axis, low, high in self._fences:
            x = p.position[axis]
            if x.min() < low or x.max() > high:
                i = int(np.argmax(np.maximum(low - x, x - high)))
                raise fault(
                    simulation,
                    f"particle {p.id[i]} is lost: its {'xyz'[axis]} = {x[i]:.6g} is more than "
                    f"{FAR:g} lengths of the open domain outside it",
                    f"a wider problem.domain if it belongs there, else {smaller_steps(simulation)}",
                    int(p.id[i]),
                )

    def _check_pace(self, simulation) -> None:
        if self._marked is None:
            self._marked = simulation.time, simulation.step
        time, step = self._marked
        if simulation.step - step < WINDOW:
            return
        covered = simulation.time - time
        if covered < COLLAPSE * self._longest:
            raise fault(
                simulation,
                f"the time step has collapsed to {simulation.limit.dt:.3g}: "
                f"{what_sets(simulation)}. The last {WINDOW} steps covered {covered:.3g} of "
                f"time, where {WINDOW} steps of this run have covered {self._longest:.3g}",
                longer_steps(simulation),
                simulation.limit.particle,
            )
        left = self._end - simulation.time
        if covered * MOST_WINDOWS < left:
            raise fault(
                simulation,
                f"the run will not come to its end: the last {WINDOW} steps covered {covered:.3g} "
                f"of time, and {left:.3g} of it are left; {what_sets(simulation)}",
                "a shorter time.end, or a setting that is not so far from its default",
                simulation.limit.particle,
            )
        self._longest = max(self._longest, covered)
        self._marked = simulation.time, simulation.step
