"""Quantities of one particle from density and energy: EOS, Balsara factor, rate of alpha.

The density pass calls these functions for each particle after its sums; the pair loops of the rate
pass use only their results. Arrays are (N,), i is the particle.
"""

from numba import njit

from sph.compiled import INLINED
from sph.eos import pressure as pressure_of
from sph.eos import sound_speed as sound_speed_of
from sph.formulations.gas.schemes import summed_terms
from sph.formulations.gas.terms import alpha_rate as alpha_rate_of
from sph.formulations.gas.terms import balsara_factor


# A function that is called from compiled code takes over `fastmath` unless it sets its own. Here
# fastmath is off, so that the order of the products never depends on the calling function.
@njit(nogil=True, error_model="numpy", fastmath=False, forceinline=True)
def _over(P, Omega, rho):
    return P / (Omega * rho * rho)


@njit(**INLINED)
def equation_of_state(i, models, rho, Omega, energy, pressure, pressure_term, sound_speed):
    """Set pressure, P/(Omega rho^2) and sound speed, and return the sound speed.

    pressure may be None.
    """
    P = pressure_of(models.eos, rho, energy[i])
    c = sound_speed_of(models.eos, rho, P)
    pressure_term[i] = _over(P, Omega, rho)
    sound_speed[i] = c
    if pressure is not None:
        pressure[i] = P
    return c


@njit(**INLINED)
def summed(i, models, energy, energy_density, slope, pressure, pressure_term, energy_shift):
    """Set the pressure terms of a scheme that sums its pressure.

    energy_density: the sum of m_j u_j W_ij; slope: see `sph.formulations.gas.schemes`.
    """
    pressure[i], pressure_term[i], energy_shift[i] = summed_terms(
        models.scheme, models.eos, energy[i], energy_density, slope
    )


@njit(**INLINED)
def dissipation(i, models, H, c, div, curl, alpha, balsara, alpha_rate):
    """Set Balsara's factor (eq 21) and the rate of alpha (eqs 27-28), if the scene has them."""
    if balsara is not None:
        balsara[i] = balsara_factor(models.balsara, div, curl, c, H)
    if alpha is not None:
        alpha_rate[i] = alpha_rate_of(models.viscosity, alpha[i], H / models.support_ratio, c, div)
