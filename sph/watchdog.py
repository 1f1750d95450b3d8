"""The watchdog: whether the state of a simulation still means something, after every step.

Its tests use sums that the history needs anyway; particles are only looked at once one fails,
and where a sum would not tell: in open domains, and in gas that can be torn apart.
"""

import numpy as np

from sph.errors import NumericalError

# Steps over which the advance of time is compared with that of the run's own past, and by how much
# it may fall behind: cold gas meeting a shock may take some hundred steps of next to no length.
WINDOW = 1000
COLLAPSE = 1e-6

# How far outside an open domain a particle may be, in lengths of the domain along that axis.
FAR = 100.0

# Windows to go beyond which a run is not going anywhere: more steps than a machine lasts for.
MOST_WINDOWS = 1e12

# Squares and cubes of what a run begins with, their sums and inverses have to be numbers too.
LARGEST = 1e100

NEARER_UNITS = (
    "code units in which it is nearer to 1: outside 1e-100 to 1e100 its square and cube are no "
    "numbers any more"
)
SMALLER_STEPS = "a smaller physics.C, a larger physics.alpha, physics.energy_limit = true"


class Watchdog:
    """Knows what a run began with; `check` raises NumericalError where its state means nothing."""

    def __init__(self, scene):
        self.max_drift = scene.config.physics.max_energy_drift
        self.energy_at_start = None  # set by the first check, or for a restart from its history
        self._scale = None
        box, kinds = scene.domain.box, scene.domain.boundaries
        open_axes = [axis for axis, kind in enumerate(kinds) if kind == "open"]
        self._fences = [
            (axis, lo - FAR * (hi - lo), hi + FAR * (hi - lo))
            for axis in open_axes
            for lo, hi in [box[axis]]
        ]
        self._lowest_energy = getattr(scene.eos, "lowest_energy", None)
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
                raise _fault_of(simulation, name, values, bad, NEARER_UNITS)

    def check(self, simulation) -> None:
        """Raise NumericalError, which names a particle, where `simulation` cannot go on."""
        self._check_gas(simulation)
        self._check_numbers(simulation)
        self._check_energy(simulation)
        self._check_fences(simulation)
        self._check_pace(simulation)

    def _check_numbers(self, simulation) -> None:
        totals, dt = simulation.totals, simulation.limit.dt
        sums = (totals.energy, totals.max_density, totals.rates, dt)
        positive = totals.min_density > 0 and totals.min_internal_energy >= 0
        if positive and np.isfinite(sums).all() and simulation.time + dt > simulation.time:
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
                remedy = SMALLER_STEPS if simulation.step else NEARER_UNITS
                raise _fault_of(simulation, name, values, bad, remedy)
        if not np.isfinite(sums).all():
            raise _endless_sum(simulation)
        raise fault(
            simulation,
            f"the time step has shrunk to {dt:.3g}, which moves time on no more: "
            f"{_what_sets(simulation.limit)}",
            SMALLER_STEPS,
            simulation.limit.particle,
        )

    def _check_gas(self, simulation) -> None:
        """Gas that is torn apart: where sound has no speed, neither forces nor steps have sense."""
        if self._lowest_energy is None:
            return
        p = simulation.particles
        above = p.internal_energy - self._lowest_energy(p.density)
        if not (above <= 0.0).any():
            return
        i = int(np.nanargmin(above))
        raise fault(
            simulation,
            f"particle {p.id[i]} is pulled apart by more than its equation of state holds: its "
            f"density is {p.density[i]:.6g}, its internal energy {p.internal_energy[i]:.6g}",
            "a boundary other than open, where the density sum misses neighbours; a weaker "
            "rarefaction; more particles",
            int(p.id[i]),
        )

    def _check_energy(self, simulation) -> None:
        totals = simulation.totals
        energy = totals.energy - simulation.energy_added
        if self.energy_at_start is None:
            self.energy_at_start = energy
        # potential energy may cancel the others: they are what an error is measured by
        scale = max(abs(self.energy_at_start), totals.kinetic_energy + totals.internal_energy)
        drift = energy - self.energy_at_start
        if abs(drift) > self.max_drift * scale:
            p = simulation.particles
            i = int(np.argmax(p.mass * (0.5 * (p.velocity**2).sum(axis=0) + p.internal_energy)))
            pulled = simulation.scene.external is not None
            raise fault(
                simulation,
                f"total energy has changed by {drift / scale:.3g} of itself, more than "
                f"physics.max_energy_drift = {self.max_drift:g}; the most is with particle "
                f"{p.id[i]}",
                f"{SMALLER_STEPS}{', a softening of physics.external' * pulled}, or a larger "
                "physics.max_energy_drift if that is good enough",
                int(p.id[i]),
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
                    f"a wider problem.domain if it belongs there, {SMALLER_STEPS} if not",
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
                f"{_what_sets(simulation.limit)}. The last {WINDOW} steps covered {covered:.3g} of "
                f"time, where {WINDOW} steps of this run have covered {self._longest:.3g}",
                "physics.energy_limit = false where cold gas sets the step, else a larger "
                "physics.alpha or more particles",
                simulation.limit.particle,
            )
        left = self._end - simulation.time
        if covered * MOST_WINDOWS < left:
            raise fault(
                simulation,
                f"the run will not come to its end: the last {WINDOW} steps covered {covered:.3g} "
                f"of time, and {left:.3g} of it are left; {_what_sets(simulation.limit)}",
                "a shorter time.end, or a setting that is not so far from its default",
                simulation.limit.particle,
            )
        self._longest = max(self._longest, covered)
        self._marked = simulation.time, simulation.step


def _what_sets(limit) -> str:
    """The particle and criterion of a step, in words."""
    if not limit.particle:
        return "it may not grow faster"
    by = {
        "signal_speed": "the speed of its signals",
        "energy": "u/|du/dt|, how fast it is heated or cooled",
        "acceleration": "its acceleration",
        "support": "how fast its support changes",
    }
    return f"particle {limit.particle} sets it by {by[limit.criterion]}"


def fault(simulation, what: str, remedy: str, particle: int) -> NumericalError:
    """The error to raise: what broke and when, what to try, and the ID of a particle (0: none)."""
    return NumericalError(
        f"step {simulation.step}, t = {simulation.time:.6g}: {what}.\nTry: {remedy}.", particle
    )


def _fault_of(simulation, name: str, values, bad, remedy: str) -> NumericalError:
    """The error of the first particle whose `values` are `bad`, arrays (N,) or (D, N)."""
    p = simulation.particles
    i = int(np.argwhere(bad)[0][-1])
    count = int(bad.any(axis=tuple(range(bad.ndim - 1))).sum())
    where = ", ".join(f"{x:.6g}" for x in p.position[:, i])
    return fault(
        simulation,
        f"{name} of particle {p.id[i]} at ({where}) is {values[..., i]}; "
        f"{count} particle(s) are so",
        remedy,
        int(p.id[i]),
    )


def _endless_sum(simulation) -> NumericalError:
    """The error to raise where what each particle has is a number, but not the sum of it."""
    p, totals, external = simulation.particles, simulation.totals, simulation.scene.external
    with np.errstate(all="ignore"):  # the very numbers that are looked for
        if external is not None and not np.isfinite(totals.potential_energy):
            name, each = "potential energy", external.potential(p.position)
            remedy = "a softening of physics.external, or no particle where its mass is"
        elif not np.isfinite(totals.kinetic_energy):
            name, each, remedy = "kinetic energy", (p.velocity**2).sum(axis=0), SMALLER_STEPS
        elif not np.isfinite(totals.internal_energy):
            name, each, remedy = "internal energy", p.internal_energy, SMALLER_STEPS
        else:
            name, each, remedy = "rate of energy", p.energy_rate, SMALLER_STEPS
        i = int(np.argmax(np.abs(each)))
    where = ", ".join(f"{x:.6g}" for x in p.position[:, i])
    return fault(
        simulation,
        f"the sum of all {name} is no number; the most is with particle {p.id[i]} at ({where})",
        remedy,
        int(p.id[i]),
    )


def crowded(simulation) -> NumericalError:
    """The error to raise where a density below zero says that a particle has no support."""
    p = simulation.particles
    i = int(np.argmin(p.density))
    here = p.position[:, i]
    images = zip(*simulation.scene.domain.images, strict=True)
    there = (s[:, None] * p.position + o[:, None] == here[:, None] for s, o in images)
    others = sum(int(same.all(axis=0).sum()) for same in there) - 1
    because = (
        f"{others} other(s) in the same place, images at walls among them, outweigh"
        if others
        else "alone it outweighs"
    )
    where = ", ".join(f"{x:.6g}" for x in here)
    return fault(
        simulation,
        f"there is no support small enough for particle {p.id[i]} at ({where}): "
        f"{because} what it is to hold",
        "a larger physics.eta, particles apart from each other, or physics.density = "
        '"number" where one is much heavier than its neighbour',
        int(p.id[i]),
    )
