"""The watchdog: checks after each step that the state is finite and physical.

Most checks use sums that the history needs anyway. Individual particles are examined only after a
check has failed, in open domains, and for gas that can be under tension.
"""

import math

import numpy as np
from numba.extending import register_jitable

from sph.faults import (
    LARGEST,
    NEARER_UNITS,
    NOT_NEGATIVE,
    drift_remedy,
    endless_sum,
    fault,
    fault_of,
    longer_steps,
    of_numbers,
    smaller_steps,
    what_sets,
)  # fmt: skip
from sph.state import COMMON

# Number of steps over which progress in time is compared with the best earlier progress, and the
# smallest ratio of both. Cold gas at a shock may need some hundred very short steps.
WINDOW = 1000
COLLAPSE = 1e-6

# Largest distance of a particle from an open domain, in lengths of the domain along that axis.
FAR = 100.0

# Largest factor between sum m/rho and the volume of a box filled with gas, and the steps before
# this is checked. Shipped problems are within 5 %. Random positions start at 0.3 to 0.9 and reach
# 0.97 within 100 steps; eta = 0.8 stays below 0.7 in 2-D and 3-D.
MOST_VOLUME = 4.0 / 3.0
SETTLING = 100

# Number of remaining windows above which a run cannot end within the lifetime of a machine.
MOST_WINDOWS = 1e12


class Watchdog:
    """Checks the states of one run; `check` raises NumericalError for an unphysical state."""

    def __init__(self, scene):
        self.max_drift = scene.config.physics.max_energy_drift
        (energy,) = (one for one in scene.formulation.fields if one.name == "internal_energy")
        self.lowest_energy = -math.inf if energy.at_least is None else energy.at_least
        box, kinds = scene.domain.box, scene.domain.boundaries
        open_axes = [axis for axis, kind in enumerate(kinds) if kind == "open"]
        self.fences = [
            (axis, lo - FAR * (hi - lo), hi + FAR * (hi - lo))
            for axis in open_axes
            for lo, hi in [box[axis]]
        ]
        self.end = scene.config.time.end  # of the run, which `check_pace` looks ahead to
        self._marked = None  # (time, step) at which the present window began
        self._longest = 0.0  # time covered by the best window

    def check_range(self, simulation) -> None:
        """Raise NumericalError if initial values are so extreme that sums could overflow."""
        box = simulation.scene.domain.box
        for axis, length in zip("xyz", box[:, 1] - box[:, 0], strict=False):
            if not 1.0 / LARGEST < length < LARGEST:
                what = f"the length of the domain along {axis} is {length:g}"
                raise fault(simulation, what, NEARER_UNITS, 0)
        if not 1.0 / LARGEST < self.end < LARGEST:
            raise fault(simulation, f"time.end is {self.end:g}", NEARER_UNITS, 0)
        p = simulation.particles
        for name, values, smallest in (
            ("mass", p.mass, 1.0 / LARGEST),
            ("position", p.position, -LARGEST),
            ("velocity", p.velocity, -LARGEST),
            ("internal energy", p.internal_energy, max(self.lowest_energy, -LARGEST)),
        ):
            bad = ~((values >= smallest) & (values < LARGEST))
            if bad.any():
                is_negative = smallest >= 0.0 and (values[bad] < 0.0).all()
                remedy = NOT_NEGATIVE if is_negative else NEARER_UNITS
                raise fault_of(simulation, name, values, bad, remedy)

    def check(self, simulation) -> None:
        """Raise NumericalError, which names a particle, if the state is unphysical."""
        for part in simulation.scene.all_parts:
            part.check(simulation)
        self._check_numbers(simulation)
        self._check_energy(simulation)
        self._check_volume(simulation)
        self._check_fences(simulation)
        self.check_pace(simulation)

    def check_fields(self, simulation) -> None:
        """Raise NumericalError for values of stored fields that no checkpoint may hold.

        Called before a checkpoint is written. Every step checks the fields of all formulations.
        """
        p = simulation.particles
        for field in p.fields:
            if field in COMMON or not field.stored:
                continue
            values = getattr(p, field.name)
            bad = ~np.isfinite(values)
            if field.above is not None:
                bad |= ~(values > field.above)
            if field.at_least is not None:
                bad |= ~(values >= field.at_least)
            if bad.any():
                raise fault_of(simulation, field.name, values, bad, of_numbers(simulation))

    def _check_numbers(self, simulation) -> None:
        totals, dt = simulation.totals, simulation.limit.dt
        sums = (totals.energy, totals.max_density, totals.rates)
        lowest = (totals.min_density, totals.min_internal_energy)
        if is_sound(*sums, dt, *lowest, simulation.time, self.lowest_energy):
            return
        p = simulation.particles
        tests = (
            ("density", p.density, ~(p.density > 0) | ~np.isfinite(p.density)),
            ("internal energy", p.internal_energy, ~(p.internal_energy >= self.lowest_energy)),
            ("velocity", p.velocity, ~np.isfinite(p.velocity)),
            ("acceleration", p.acceleration, ~np.isfinite(p.acceleration)),
            ("rate of energy", p.energy_rate, ~np.isfinite(p.energy_rate)),
        )
        for name, values, bad in tests:
            if bad.any():
                raise fault_of(simulation, name, values, bad, of_numbers(simulation))
        if not all(map(math.isfinite, sums)):
            raise endless_sum(simulation)
        why = "too small to advance time" if math.isfinite(dt) else "which is not finite"
        raise fault(
            simulation,
            f"the time step fell to {dt:.3g}, {why}; it is {what_sets(simulation)}",
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
            f"physics.max_energy_drift = {self.max_drift:g}; particle {p.id[i]} has most energy",
            drift_remedy(simulation),
            int(p.id[i]),
        )

    def _check_volume(self, simulation) -> None:
        ratio = simulation.volume_ratio
        if ratio is None or simulation.step < SETTLING or fits_box(ratio):
            return
        raise fault(
            simulation,
            f"the densities do not fit the box: the sum of m/rho is {ratio:.3g} of its volume",
            f"a larger {simulation.scene.formulation.neighbours_key}, so that kernels contain more "
            "neighbours, or more particles",
            0,
        )

    def _check_fences(self, simulation) -> None:
        p = simulation.particles
        for axis, low, high in self.fences:
            x = p.position[axis]
            if x.min() < low or x.max() > high:
                i = int(np.argmax(np.maximum(low - x, x - high)))
                raise fault(
                    simulation,
                    f"particle {p.id[i]} is at {'xyz'[axis]} = {x[i]:.6g}, outside the open domain "
                    f"by more than {FAR:g} times its length",
                    f"{smaller_steps(simulation)}, or a wider problem.domain if this is expected",
                    int(p.id[i]),
                )

    def steps_to_mark(self, step: int) -> int:
        """Return the number of steps until the next check of the pace that may find something."""
        return 1 if self._marked is None else max(1, self._marked[1] + WINDOW - step)

    def check_pace(self, simulation) -> None:
        """Raise NumericalError if steps have become so short that the run cannot end."""
        if self._marked is None:
            self._marked = simulation.time, simulation.step
        time, step = self._marked
        if simulation.step - step < WINDOW:
            return
        covered = simulation.time - time
        if covered < COLLAPSE * self._longest:
            raise fault(
                simulation,
                f"the time step has collapsed to {simulation.limit.dt:.3g}, "
                f"{what_sets(simulation)}. The last {WINDOW} steps advanced time by "
                f"{covered:.3g}, earlier ones by {self._longest:.3g}",
                longer_steps(simulation),
                simulation.limit.particle,
            )
        left = self.end - simulation.time
        if covered * MOST_WINDOWS < left:
            raise fault(
                simulation,
                f"the run cannot reach time.end: the last {WINDOW} steps advanced time by "
                f"{covered:.3g}, and {left:.3g} remains. The time step is {what_sets(simulation)}",
                "an earlier time.end, or settings closer to their defaults",
                simulation.limit.particle,
            )
        self._longest = max(self._longest, covered)
        self._marked = simulation.time, simulation.step


# --- conditions that Python and compiled steps (`sph.steps`) share ------------------------------


@register_jitable
def is_sound(
    energy, max_density, rates, dt, min_density, min_energy, time, lowest_energy
) -> bool:  # fmt: skip
    """Whether sums are finite, density and internal energy physical, and dt advances time."""
    return (
        min_density > 0.0
        and min_energy >= lowest_energy
        and abs(energy) < math.inf
        and abs(max_density) < math.inf
        and abs(rates) < math.inf
        and abs(dt) < math.inf
        and time + dt > time
    )


@register_jitable
def fits_box(ratio: float) -> bool:
    """Whether sum m/rho over the volume of the box is physical."""
    return 1 / MOST_VOLUME < ratio < MOST_VOLUME
