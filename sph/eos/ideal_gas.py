"""Ideal gas of constant adiabatic index (eqs 19-20)."""

from typing import Annotated, NamedTuple

import numpy as np

from sph.eos import Defaults
from sph.model import Parameter, model


@model(Defaults)
class IdealGas(NamedTuple):
    """`gamma`: adiabatic index, the ratio of specific heats, above 1."""

    gamma: Annotated[float, Parameter("adiabatic index, the ratio of specific heats", above=1.0)]

    p_inf = 0.0  # not a parameter: the value of a stiffened gas that is ideal

    def pressure(self, density, internal_energy):
        return (self.gamma - 1.0) * density * internal_energy  # eq 19

    def sound_speed(self, density, pressure):
        return np.sqrt(self.gamma * pressure / density)  # eq 20

    def internal_energy(self, density, pressure):
        return pressure / ((self.gamma - 1.0) * density)
