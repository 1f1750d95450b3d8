"""Artificial conductivity: heat that flows between neighbours to smooth a contact.

A conductivity is a file that holds a NamedTuple with the method

    exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij)    speed of the exchange

where w_ij <= 0 is the speed of approach (eq 26). The pair then exchanges energy at the rate
m_j exchange_speed (u_i - u_j) / rho_ij (dW/dr), equal and opposite for the two. A field `switched`
tells whether that is times the mean of the two particles' shares, found by the pass over contacts.
The class attribute `suits_gravity` tells whether it rests in equilibrium with an external field.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, smaller, verb

TINY = 1e-300  # cold gas of one energy has no contact: zero over zero is none


@verb
def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
    return self.exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij)


@njit(**COMPILED, forceinline=True)
def share(h, laplacian, energy, signal_speed):
    """What part of the conductivity acts on a particle, 0 to 1, from the Laplacian of its energy.

    Price (2008; Price & Monaghan 2005) lets a coefficient grow by 0.1 h |lap u| / sqrt(u) and decay
    in h/(0.1 v_sig). This is where the two balance, so it needs no memory: it acts at once where a
    contact begins, while there is a jump of pressure to drive it. h is the smoothing length.
    """
    return smaller(h * h * abs(laplacian) / (signal_speed * np.sqrt(energy) + TINY), 1.0)
