"""Artificial conductivity: heat that flows between neighbours to smooth a contact.

A conductivity is a file that holds a NamedTuple with the method

    exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij)    speed of the exchange

where w_ij <= 0 is the speed of approach (eq 26). The pair then exchanges energy at the rate
m_j exchange_speed (u_i - u_j) / rho_ij (dW/dr), equal and opposite for the two.
"""

from sph.compiled import verb


@verb
def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
    return self.exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij)
