"""Density-independent SPH in pressure-energy form (Hopkins 2013; Saitoh & Makino 2013).

The pressure is a sum over neighbours, P_i = (gamma - 1) sum m_j u_j W_ij(H_i). The pressure is
therefore smooth across a contact for any jump of density. With grad W_i for grad_i W_ij(H_i),
Hopkins' eqs 21-22 are

    dv_i/dt = -sum m_j (gamma - 1)^2 u_i u_j [f_ij/P_i grad W_i + f_ji/P_j grad W_j]
    du_i/dt = sum m_j (gamma - 1)^2 u_i u_j f_ij/P_i v_ij . grad W_i

f_ij = 1 - g_i/u_j follows from Hopkins' eq 12 for supports that contain a given mass (eqs 7 and 15;
his contain a given number of particles): g_i = (H_i/D) (dP_i/dH_i) / [(gamma - 1) Omega_i rho_i].
For uniform u this is the variational scheme.
"""

from typing import NamedTuple

from sph.formulations.gas.schemes import Scheme
from sph.formulations.gas.schemes.variational import Variational
from sph.model import model


@model(Scheme)
class PressureEnergy(NamedTuple):
    """Only for ideal gases. No surface tension at contacts, but noise at very large jumps of u."""

    sums_pressure = True
    pair = Variational.pair

    def summed_terms(self, eos, energy, density_of_energy, slope):
        # (gamma - 1) cancels in g_i; P_i = 0 only where all energies are, and then so is the force
        factor = (eos.gamma - 1.0) * energy / (density_of_energy + 1e-300)
        return (eos.gamma - 1.0) * density_of_energy, factor, slope
