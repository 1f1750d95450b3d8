"""Schemes, one file each: the force and the heating between a pair of particles.

A scheme is a NamedTuple with the method

    pair(term_i, term_j, slope_i, slope_j, Pi)    (force, work) of particle i by j

where term = P/(Omega rho^2) of each particle, Pi is the viscous term f_ij Pi_ij, and slope_i and
slope_j are m_j/2 (dW/dr)/r at H_i and H_j. The acceleration of i is minus the sum of force r_ij,
and du/dt is the sum of work v_ij . r_ij.

A scheme whose pressure is itself a sum over neighbours has the class attribute `sums_pressure` and

    summed_terms(eos, energy, density_of_energy, slope)    (pressure, factor, energy_shift)

of a particle. density_of_energy is the sum E_i of m_j u_j W_ij(H_i), and slope is
(H_i/D) (dE_i/dH_i) / (Omega_i rho_i). The terms of a pair are then
factor_i (u_j - energy_shift_i) and factor_j (u_i - energy_shift_j).
"""

from sph import registry
from sph.compiled import verb
from sph.model import Model


class Scheme(Model):
    """Defaults of a scheme."""

    sums_pressure = False

    @classmethod
    def required(cls):
        return ("pair", "summed_terms") if cls.sums_pressure else ("pair",)


@verb
def pair(self, term_i, term_j, slope_i, slope_j, Pi):
    return self.pair(term_i, term_j, slope_i, slope_j, Pi)


@verb
def summed_terms(self, eos, energy, density_of_energy, slope):
    return self.summed_terms(eos, energy, density_of_energy, slope)


summed_terms.takes_vectors = False  # type: ignore[attr-defined]


def make(name: str):
    """Return the scheme of that name, e.g. make("grad_h")."""
    return registry.model_class("sph.formulations.gas.schemes", name)()
