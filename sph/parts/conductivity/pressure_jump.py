"""Conductivity with the speed sqrt(|P_i - P_j|/rho) of a pressure jump (Price 2008).

Price's eqs 27-28. This conductivity acts at jumps of pressure: at a contact until the pressure is
uniform there, and at the start of a shock. A configuration must not combine it with an external
field, in which pressure varies in equilibrium.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.model import Parameter, model
from sph.parts.conductivity import Exchange


@model(Exchange)
class PressureJump(NamedTuple):
    """`strength`: 1 is the value of Price (2008). `switched`: limit the exchange to contacts."""

    strength: Annotated[float, Parameter("1 is the value of the paper", at_least=0.0)] = 1.0
    switched: Annotated[bool, Parameter("at contacts only")] = False

    suits_gravity = False

    def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
        rho_ij = 0.5 * (density_i + density_j)
        return self.strength * np.sqrt(abs(pressure_i - pressure_j) / rho_ij)
