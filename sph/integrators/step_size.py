"""The global time step (seed eq 32) and the particle that sets it."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED

CRITERIA = ("signal_speed", "energy")


class StepLimit(NamedTuple):
    """The step that the criteria allow, the ID of the particle that sets it, and by which."""

    dt: float
    particle: int
    criterion: str


@njit(**COMPILED)
def _smallest(support, signal_speed, energy, energy_rate, identity, energy_limit):
    best = np.inf
    particle = -1
    criterion = 0
    for i in range(support.size):
        by_signal = 2.0 * support[i] / signal_speed[i]
        if by_signal < best or (by_signal == best and identity[i] < particle):
            best, particle, criterion = by_signal, identity[i], 0
        if energy_limit:
            by_energy = energy[i] / abs(energy_rate[i])
            if by_energy < best or (by_energy == best and identity[i] < particle):
                best, particle, criterion = by_energy, identity[i], 1
    return best, particle, criterion


def limit(courant: float, energy_limit: bool, particles, signal_speed) -> StepLimit:
    """Eq 32 for the corrected state: signal_speed (N,) is each particle's largest v_sig.

    With energy_limit False the term u/|du/dt| is left out, as in the seed's draft.
    """
    dt, particle, criterion = _smallest(
        particles.support, signal_speed, particles.internal_energy, particles.energy_rate,
        particles.id, energy_limit,
    )  # fmt: skip
    return StepLimit(courant * dt, int(particle), CRITERIA[criterion])
