"""Sums and extremes over all particles: what the history records and the watchdog looks at."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED


class Totals(NamedTuple):
    """Of one state, in code units."""

    kinetic_energy: float
    internal_energy: float
    potential_energy: float  # in an external field, else 0
    momentum: np.ndarray  # (D,)
    min_density: float
    max_density: float
    min_internal_energy: float
    max_internal_energy: float
    rates: float  # of velocity and energy, all together: finite if each of them is

    @property
    def energy(self) -> float:
        return self.kinetic_energy + self.internal_energy + self.potential_energy


def of(particles, external) -> Totals:
    """The totals of `particles`; external: a model of `sph.external`, or None."""
    p = particles
    kinetic, internal, *others = _totals(
        p.mass, p.velocity, p.internal_energy, p.density, p.acceleration, p.energy_rate
    )
    potential = 0.0 if external is None else float(p.mass @ external.potential(p.position))
    return Totals(kinetic, internal, potential, *others)


@njit(**COMPILED)
def _totals(mass, velocity, energy, density, acceleration, energy_rate):
    D, n = velocity.shape
    momentum = np.zeros(D)
    kinetic = internal = rates = 0.0
    lowest_density = lowest_energy = np.inf
    highest_density = highest_energy = -np.inf
    for d in range(D):
        along = squares = 0.0
        for i in range(n):
            along += mass[i] * velocity[d, i]
            squares += mass[i] * velocity[d, i] ** 2
            rates += acceleration[d, i]
        momentum[d] = along
        kinetic += 0.5 * squares
    for i in range(n):
        internal += mass[i] * energy[i]
        rates += energy_rate[i]
        lowest_energy = min(lowest_energy, energy[i])
        highest_energy = max(highest_energy, energy[i])
        lowest_density = min(lowest_density, density[i])
        highest_density = max(highest_density, density[i])
    return (
        kinetic, internal, momentum, lowest_density, highest_density, lowest_energy,
        highest_energy, rates,
    )  # fmt: skip
