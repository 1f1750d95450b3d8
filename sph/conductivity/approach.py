"""Conductivity at the speed of approach of the pair (Wadsley, Veeravalli & Couchman 2008).

It acts where gas converges and nowhere in equilibrium, so it may be used with gravity.
"""

from typing import NamedTuple


class Approach(NamedTuple):
    """`strength`: 1 exchanges heat as fast as the pair approaches. `switched`: at contacts only."""

    strength: float = 1.0
    switched: bool = False

    suits_gravity = True

    def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
        return -self.strength * w_ij
