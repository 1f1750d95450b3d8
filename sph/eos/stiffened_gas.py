"""Stiffened gas: a liquid or solid under shocks, as an ideal gas whose pressure is offset.

Harlow & Amsden (1971), LANL report LA-4700: P = (gamma - 1) rho u - gamma p_inf. In P + p_inf it is
an ideal gas: the same sound speed, isentropes and shocks. Water is near gamma = 4.4,
p_inf = 6e8 Pa.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.eos import Defaults
from sph.model import Parameter, model


@model(Defaults)
class StiffenedGas(NamedTuple):
    """`gamma` above 1; `p_inf`, a pressure, at least 0: the gas holds together down to -p_inf.

    u is positive well before that: the bound is u > p_inf/rho, where P = -p_inf and sound stops.
    """

    gamma: Annotated[float, Parameter("the ratio of specific heats of the gas", above=1.0)]
    p_inf: Annotated[float, Parameter("pressure that holds the gas together", at_least=0.0)]

    def pressure(self, density, internal_energy):
        return (self.gamma - 1.0) * density * internal_energy - self.gamma * self.p_inf

    def sound_speed(self, density, pressure):
        return np.sqrt(self.gamma * (pressure + self.p_inf) / density)

    def lowest_energy(self, density):
        return self.p_inf / density

    def internal_energy(self, density, pressure):
        return (pressure + self.gamma * self.p_inf) / ((self.gamma - 1.0) * density)
