"""Sums and extremes over all particles, for the history and the watchdog."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from sph.compiled import COMPILED


class Totals(NamedTuple):
    """Sums and extremes of one state, in code units."""

    kinetic_energy: float
    # of velocities relative to the mean velocity, along axes that conserve momentum
    kinetic_energy_without_bulk: float
    internal_energy: float
    energies: dict[str, float]  # of parts, by column of the history
    momentum: np.ndarray  # (D,)
    volume: float  # sum m/rho
    min_density: float
    max_density: float
    min_internal_energy: float
    max_internal_energy: float
    rates: float  # sum of all rates of velocity and energy; not finite if one of them is not

    @property
    def potential_energy(self) -> float:
        """All energy that is neither kinetic nor internal."""
        return sum(self.energies.values(), 0.0)

    @property
    def energy(self) -> float:
        return self.kinetic_energy + self.internal_energy + self.potential_energy

    @property
    def energy_without_bulk(self) -> float:
        """Energy for the energy drift; fast bulk motion would hide the drift."""
        return self.kinetic_energy_without_bulk + self.internal_energy + self.potential_energy


class Baseline(NamedTuple):
    """Initial energy without bulk motion, and the scale of the relative energy drift."""

    energy: float
    scale: float

    @classmethod
    def of(cls, kinetic_without_bulk: float, internal: float, potential: float) -> "Baseline":
        """Return the baseline of initial sums. The scale excludes cancellation by the potential."""
        energy = kinetic_without_bulk + internal + potential
        return cls(energy, max(abs(energy), kinetic_without_bulk + internal))

    @classmethod
    def at(cls, totals: Totals, added: float) -> "Baseline":
        """Return the baseline of a run with these totals, less the energy added by sources."""
        return cls.of(
            totals.kinetic_energy_without_bulk,
            totals.internal_energy - added,
            totals.potential_energy,
        )

    def drift(self, totals: Totals, added: float) -> float:
        """Return the change of energy since the start, less the energy added, over the scale."""
        return float(drift_of(totals.energy_without_bulk, added, self.energy, self.scale))


@register_jitable
def drift_of(energy: float, added: float, initial: float, scale: float) -> float:
    change = energy - added - initial
    if scale > 0.0:
        return change / scale
    return math.copysign(math.inf, change) if change != 0.0 else 0.0


class Budget(NamedTuple):
    """Energies counted since the start of a run, and the baseline of its energy drift."""

    injected: float  # to keep internal energies positive
    added: float  # by sources
    baseline: Baseline


def of(state, parts, keeps_momentum) -> Totals:
    """Return the totals of a state. parts: parts whose energies belong to the total.

    keeps_momentum: (D,), 1.0 for axes along which momentum is conserved, 0.0 for others.
    """
    s = state
    momentum = np.empty(s.dimension)
    kinetic, relative, internal, *others = sums(
        s.mass, s.velocity, s.internal_energy, s.density, s.acceleration, s.energy_rate,
        keeps_momentum, momentum,
    )  # fmt: skip
    energies = {
        name: float(s.mass @ each) for part in parts for name, each in part.energies(s).items()
    }
    return Totals(kinetic, relative, internal, energies, momentum, *others)


@njit(**COMPILED)
def sums(mass, velocity, energy, density, acceleration, energy_rate, keeps_momentum, momentum):
    """Return the numbers of `Totals` except `energies` and momentum, which is written, (D,)."""
    D, n = velocity.shape
    kinetic = relative = internal = volume = rates = all_mass = 0.0
    lowest_density = lowest_energy = np.inf
    highest_density = highest_energy = -np.inf
    for i in range(n):
        all_mass += mass[i]
        internal += mass[i] * energy[i]
        volume += mass[i] / density[i]
        rates += energy_rate[i]
        lowest_energy = min(lowest_energy, energy[i])
        highest_energy = max(highest_energy, energy[i])
        lowest_density = min(lowest_density, density[i])
        highest_density = max(highest_density, density[i])
    for d in range(D):
        along = squares = 0.0
        for i in range(n):
            along += mass[i] * velocity[d, i]
            squares += mass[i] * velocity[d, i] ** 2
            rates += acceleration[d, i]
        momentum[d] = along
        kinetic += 0.5 * squares
        # not a difference of two sums, which would lose all digits at very large Mach numbers
        bulk = keeps_momentum[d] * along / all_mass
        squares = 0.0
        for i in range(n):
            squares += mass[i] * (velocity[d, i] - bulk) ** 2
        relative += 0.5 * squares
    return (
        kinetic, relative, internal, volume, lowest_density, highest_density,
        lowest_energy, highest_energy, rates,
    )  # fmt: skip
