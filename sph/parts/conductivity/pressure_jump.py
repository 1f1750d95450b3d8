"""Conductivity at the speed that a pressure jump would drive (Price 2008, eqs 27-28).

It acts where the pressure jumps and energy differs: at a contact until its pressure is even, and at
the start of a shock. It must not be used with gravity, where pressure varies in equilibrium.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.model import Parameter, model
from sph.parts.conductivity import Exchange


@model(Exchange)
class PressureJump(NamedTuple):
    """`strength`: 1 is the value of the paper. `switched`: at contacts only."""

    strength: Annotated[float, Parameter("1 is the value of the paper", at_least=0.0)] = 1.0
    switched: Annotated[bool, Parameter("at contacts only")] = False

    suits_gravity = False

    def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
        rho_ij = 0.5 * (density_i + density_j)
        return self.strength * np.sqrt(abs(pressure_i - pressure_j) / rho_ij)
