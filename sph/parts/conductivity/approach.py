"""Conductivity at the speed of approach of the pair (Wadsley, Veeravalli & Couchman 2008).

It acts where gas converges and nowhere in equilibrium, so it may be used with gravity.
"""

from typing import Annotated, NamedTuple

from sph.model import Parameter, model
from sph.parts.conductivity import Exchange


@model(Exchange)
class Approach(NamedTuple):
    """`strength`: 1 exchanges heat as fast as the pair approaches. `switched`: at contacts only."""

    strength: Annotated[float, Parameter("1 is the value of the paper", at_least=0.0)] = 1.0
    switched: Annotated[bool, Parameter("at contacts only")] = False

    def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
        return -self.strength * w_ij
