"""Sums and extremes over all particles, for the history and the watchdog."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from sph.compiled import COMPILED
from sph.threads import ALONE, Team


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
    """Return the drift of `Baseline.drift`; compiled steps (`sph.steps`) call this function too."""
    change = energy - added - initial
    if scale > 0.0:
        return change / scale
    return math.copysign(math.inf, change) if change != 0.0 else 0.0


class Budget(NamedTuple):
    """Energies counted since the start of a run, and the baseline of its energy drift."""

    injected: float  # to keep internal energies positive
    added: float  # by sources
    baseline: Baseline


def of(state, parts, keeps_momentum, team: Team = ALONE) -> Totals:
    """Return the totals of a state. parts: parts whose energies belong to the total.

    keeps_momentum: (D,), 1.0 for axes along which momentum is conserved, 0.0 for others.
    """
    s = state
    chunks = team.chunks(_of_chunk, s.mass.size, s, keeps_momentum)
    momentum, numbers = chunks[0] if len(chunks) == 1 else _combined(chunks, keeps_momentum)
    kinetic, relative, internal, *others, _ = numbers
    energies = {
        name: s.total(each, team) for part in parts for name, each in part.energies(s).items()
    }
    return Totals(kinetic, relative, internal, energies, momentum, *others)


def _of_chunk(first, last, state, keeps_momentum):
    s, momentum = state, np.empty(state.position.shape[0])
    return momentum, sums(
        first, last, s.mass, s.velocity, s.internal_energy, s.density, s.acceleration,
        s.energy_rate, keeps_momentum, momentum,
    )  # fmt: skip


def _combined(chunks, keeps_momentum):
    """Return (momentum, results of `sums`) of all particles from those of the chunks."""
    momentum = np.array([each for each, _ in chunks])
    columns = map(np.array, zip(*(numbers for _, numbers in chunks), strict=True))
    kinetic, relative, internal, volume, low, high, least, most, rates, mass = columns
    with np.errstate(invalid="ignore", over="ignore"):  # for the watchdog to find
        # sum m (v - bulk)^2 of a chunk is that about its own mean, and M (mean - bulk)^2
        means = keeps_momentum * momentum / mass[:, None]
        bulk = keeps_momentum * momentum.sum(axis=0) / mass.sum()
        apart = 0.5 * (mass[:, None] * (means - bulk) ** 2).sum()
        numbers = (
            kinetic.sum(), relative.sum() + apart, internal.sum(), volume.sum(), low.min(),
            high.max(), least.min(), most.max(), rates.sum(), mass.sum(),
        )  # fmt: skip
    return momentum.sum(axis=0), tuple(map(float, numbers))


@njit(**COMPILED)
def sums(
    first, last, mass, velocity, energy, density, acceleration, energy_rate, keeps_momentum,
    momentum,
):  # fmt: skip
    """Return the numbers of `Totals` except `energies`, and the mass, of particles [first, last).

    Sets momentum, (D,). The kinetic energy without bulk motion is relative to the mean velocity of
    these particles.
    """
    D = velocity.shape[0]
    kinetic = relative = internal = volume = rates = all_mass = 0.0
    lowest_density = lowest_energy = np.inf
    highest_density = highest_energy = -np.inf
    for i in range(np.uint64(first), np.uint64(last)):
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
        for i in range(np.uint64(first), np.uint64(last)):
            along += mass[i] * velocity[d, i]
            squares += mass[i] * velocity[d, i] ** 2
            rates += acceleration[d, i]
        momentum[d] = along
        kinetic += 0.5 * squares
        # not a difference of two sums, which would lose all digits at very large Mach numbers
        bulk = keeps_momentum[d] * along / all_mass
        squares = 0.0
        for i in range(np.uint64(first), np.uint64(last)):
            squares += mass[i] * (velocity[d, i] - bulk) ** 2
        relative += 0.5 * squares
    return (
        kinetic, relative, internal, volume, lowest_density, highest_density, lowest_energy,
        highest_energy, rates, all_mass,
    )  # fmt: skip
