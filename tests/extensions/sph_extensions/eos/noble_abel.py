"""Noble-Abel gas: an ideal gas whose molecules take up room, P = (gamma - 1) rho u/(1 - b rho)."""

from typing import Annotated, NamedTuple

import numpy as np

from sph.eos import Defaults
from sph.model import Parameter, model


@model(Defaults)
class NobleAbel(NamedTuple):
    """`gamma`: adiabatic index; `b`: the volume of the molecules per unit mass."""

    gamma: Annotated[float, Parameter("ratio of specific heats", above=1.0)]
    b: Annotated[float, Parameter("volume of the molecules per unit mass", at_least=0.0)] = 0.0

    def pressure(self, density, internal_energy):
        return (self.gamma - 1.0) * density * internal_energy / (1.0 - self.b * density)

    def sound_speed(self, density, pressure):
        return np.sqrt(self.gamma * pressure / (density * (1.0 - self.b * density)))

    def internal_energy(self, density, pressure):
        return pressure * (1.0 - self.b * density) / ((self.gamma - 1.0) * density)
