"""Quantities of one particle from density and energy: EOS, Balsara factor, rate of alpha.

The density pass calls these functions for each particle after its sums; the pair loops of the rate
pass use only their results. Arrays are (N,), i is the particle.
"""

from numba import njit

from sph.compiled import COMPILED
from sph.eos import pressure as pressure_of
from sph.eos import sound_speed as sound_speed_of
from sph.formulations.gas.schemes import summed_terms
from sph.formulations.gas.terms import alpha_rate as alpha_rate_of
from sph.formulations.gas.terms import balsara_factor


# fastmath is inherited by what a function calls unless it is set there: here the order of products
# is that of the formula, in whatever company it is compiled.
@njit(nogil=True, error_model="numpy", fastmath=False, forceinline=True)
def _over(P, Omega, rho):
    return P / (Omega * rho * rho)


@njit(**COMPILED, forceinline=True)
def equation_of_state(i, models, rho, Omega, energy, pressure, pressure_term, sound_speed):
    """Pressure, P/(Omega rho^2) and sound speed; returns the last. pressure may be None."""
    P = pressure_of(models.eos, rho, energy[i])
    c = sound_speed_of(models.eos, rho, P)
    pressure_term[i] = _over(P, Omega, rho)
    sound_speed[i] = c
    if pressure is not None:
        pressure[i] = P
    return c


@njit(**COMPILED, forceinline=True)
def summed(i, models, energy, energy_density, slope, pressure, pressure_term, energy_shift):
    """The same of a scheme that sums its pressure: from the sum of m_j u_j W_ij and its slope."""
    pressure[i], pressure_term[i], energy_shift[i] = summed_terms(
        models.scheme, models.eos, energy[i], energy_density, slope
    )


@njit(**COMPILED, forceinline=True)
def dissipation(i, models, H, c, div, curl, alpha, balsara, alpha_rate):
    """Balsara's factor (eq 21) and the rate of alpha (eqs 27-28), where the scene has them."""
    if balsara is not None:
        balsara[i] = balsara_factor(models.balsara, div, curl, c, H)
    if alpha is not None:
        alpha_rate[i] = alpha_rate_of(models.viscosity, alpha[i], H / models.support_ratio, c, div)
