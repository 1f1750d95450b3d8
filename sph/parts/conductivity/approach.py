"""Conductivity with the speed of approach of the pair (Wadsley, Veeravalli & Couchman 2008).

This conductivity acts only in converging flow, not in equilibrium, so a configuration may combine
it with an external field.
"""

from typing import Annotated, NamedTuple

from sph.model import Parameter, model
from sph.parts.conductivity import Exchange


@model(Exchange)
class Approach(NamedTuple):
    """`strength`: factor of the speed of approach. `switched`: limit the exchange to contacts."""

    strength: Annotated[float, Parameter("1 is the value of the paper", at_least=0.0)] = 1.0
    switched: Annotated[bool, Parameter("at contacts only")] = False

    def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
        return -self.strength * w_ij
