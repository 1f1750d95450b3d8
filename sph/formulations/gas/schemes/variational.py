"""Grad-h SPH from a Lagrangian, with both kernel gradients (Springel & Hernquist 2002).

Each pressure is multiplied by the kernel gradient of the same particle, their eq 7:

    dv_i/dt = -sum m_j [P_i/(Omega_i rho_i^2) grad W_i + P_j/(Omega_j rho_j^2) grad W_j].
"""

from typing import NamedTuple

from sph.formulations.gas.schemes import Scheme
from sph.model import model


@model(Scheme)
class Variational(NamedTuple):
    """Conserves energy, momentum and, without viscosity, entropy."""

    def pair(self, term_i, term_j, slope_i, slope_j, Pi):
        # slopes contain the 1/2 of the average in eq 22, which applies only to viscosity
        viscous = (slope_i + slope_j) * Pi
        own = 2.0 * slope_i * term_i
        return own + 2.0 * slope_j * term_j + viscous, own + 0.5 * viscous
