"""Thermal relaxation: du/dt = (u_eq - u)/tau, solved exactly over a step."""

from typing import NamedTuple

import numpy as np


class Relaxation(NamedTuple):
    """`energy`: u_eq, per unit mass, that the gas relaxes to; `time`: tau it takes."""

    energy: float
    time: float

    def heated(self, internal_energy, dt):
        return self.energy + (internal_energy - self.energy) * np.exp(-dt / self.time)
