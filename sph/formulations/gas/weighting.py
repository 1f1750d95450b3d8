"""Weights of the density sum: masses, or 1 per particle (`physics.density`).

Each particle has a weight w_i, its mass (eqs 7 and 15) or 1, and with the sum of weights

    n_i = sum w_j W_ij(H_i),   rho_i = (m_i/w_i) n_i,   H_i = (H/h) eta (w_i/n_i)^(1/D)
    Omega_i = 1 + H_i/(D n_i) dn_i/dH_i,   dn_i/dt = 1/Omega_i sum w_j v_ij . grad W_ij(H_i)

where the second line includes the dependence of n_i on H_i. With w = m, the density of a particle
beside heavier particles contains their mass: at a contact with unequal masses, density and pressure
are too high by orders of magnitude. With w = 1 they are not. For equal masses the results of both
weights are identical.

The forces follow from the Lagrangian sum m_i (v_i^2/2 - u_i) with du_i = P_i/rho_i^2 drho_i at
constant entropy and drho_i = (m_i/w_i) dn_i (Springel & Hernquist 2002, with w in place of m):

    m_i dv_i/dt = -sum [w_j m_i^2/w_i P_i/(Omega_i rho_i^2) grad W_i
                        + w_i m_j^2/w_j P_j/(Omega_j rho_j^2) grad W_j]
    m_i du_i/dt = sum w_j m_i^2/w_i P_i/(Omega_i rho_i^2) v_ij . grad W_i

This is the force for w = m with P_i/(Omega_i rho_i^2) multiplied by s_ij = (m_i/w_i) (w_j/m_j), and
the term of j by s_ji = 1/s_ij. The forces are equal and opposite for any pair of gradients, so
averaged gradients conserve as well. div v = -(dn_i/dt)/n_i, and curl v is weighted likewise.

The pressure-energy scheme sums energies, not weights; w enters its f_ij = 1 - g_ij/u_j (Hopkins
2013, eq 12, with w_j for the quantity that determines H), where g_ij = s_ij g_i.

A weighting is a NamedTuple with the methods

    weight(mass)                          w of a particle
    mass_per_weight(mass)                 m/w of a particle
    by_share(of_i, of_j, mass_i, mass_j)  (s_ij of_i, s_ji of_j), of masses in any unit
"""

from typing import NamedTuple

from numba import njit

from sph.compiled import INLINED, verb
from sph.neighbours.order import BLOCK
from sph.passes.gather import read
from sph.simd import block_width, select, store


@verb
def weight(self, mass):
    return self.weight(mass)


@verb
def mass_per_weight(self, mass):
    return self.mass_per_weight(mass)


@verb
def by_share(self, of_i, of_j, mass_i, mass_j):
    return self.by_share(of_i, of_j, mass_i, mass_j)


@njit(**INLINED)
def copy_weights(lanes, copied, begin, weighting, mass, block, factor):
    """Copy the weights of a block to `copied`, times factor."""
    for lane in range(0, BLOCK, block_width(lanes)):
        m = read(lanes, mass, block, lane, 0.0)  # 0 outside the array
        store(copied, begin + lane, select(m > 0.0, weight(weighting, m) * factor, 0.0))


class ByMass(NamedTuple):
    """Eqs 7, 8 and 15."""

    def weight(self, mass):
        return mass

    def mass_per_weight(self, mass):
        return 1.0

    def by_share(self, of_i, of_j, mass_i, mass_j):
        return of_i, of_j


class ByNumber(NamedTuple):
    """For unequal masses of neighbours."""

    def weight(self, mass):
        return 1.0

    def mass_per_weight(self, mass):
        return mass

    def by_share(self, of_i, of_j, mass_i, mass_j):
        inverse = 1.0 / (mass_i * mass_j)  # one division serves both
        return of_i * (mass_i * mass_i * inverse), of_j * (mass_j * mass_j * inverse)
