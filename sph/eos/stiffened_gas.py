"""Stiffened gas: an ideal gas with a pressure offset, for liquids and solids under shocks.

Harlow & Amsden (1971), LANL report LA-4700: P = (gamma - 1) rho u - gamma p_inf. Sound speed,
isentropes and shocks are those of an ideal gas with pressure P + p_inf. Water has about gamma = 4.4
and p_inf = 6e8 Pa.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.eos import Defaults
from sph.model import Parameter, model


@model(Defaults)
class StiffenedGas(NamedTuple):
    """`gamma`: adiabatic index; `p_inf`: pressure offset. The pressure may be as low as -p_inf.

    The lowest u is p_inf/rho, where P = -p_inf and the sound speed is 0.
    """

    gamma: Annotated[float, Parameter("adiabatic index, the ratio of specific heats", above=1.0)]
    p_inf: Annotated[float, Parameter("pressure offset", at_least=0.0)]

    def pressure(self, density, internal_energy):
        return (self.gamma - 1.0) * density * internal_energy - self.gamma * self.p_inf

    def sound_speed(self, density, pressure):
        return np.sqrt(self.gamma * (pressure + self.p_inf) / density)

    def lowest_energy(self, density):
        return self.p_inf / density

    def internal_energy(self, density, pressure):
        return (pressure + self.gamma * self.p_inf) / ((self.gamma - 1.0) * density)
