"""Thermal relaxation: du/dt = (u_eq - u)/tau, solved exactly over a step."""

from typing import Annotated, NamedTuple

import numpy as np

from sph.model import Model, Parameter, model


@model(Model)
class Relaxation(NamedTuple):
    """`energy`: u_eq, per unit mass, to which the gas relaxes; `time`: tau, the relaxation time."""

    energy: Annotated[float, Parameter("u_eq, energy of equilibrium per unit mass", above=0.0)]
    time: Annotated[float, Parameter("relaxation time tau", above=0.0)]

    def heated(self, internal_energy, dt):
        return self.energy + (internal_energy - self.energy) * np.exp(-dt / self.time)
