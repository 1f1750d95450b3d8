"""Schemes: how a pair of particles push and heat each other. One file each.

A scheme is a NamedTuple with the method

    pair(term_i, term_j, slope_i, slope_j, Pi)    (force, heating) of particle i by j

where term = P/(Omega rho^2) of either, Pi is the viscous term f_ij Pi_ij, and slope_i, slope_j are
m_j/2 (dW/dr)/r at H_i and at H_j. The acceleration of i is minus the sum of force r_ij, its rate of
energy the sum of heating v_ij . r_ij.
"""

from sph import registry
from sph.compiled import verb


@verb
def pair(self, term_i, term_j, slope_i, slope_j, Pi):
    return self.pair(term_i, term_j, slope_i, slope_j, Pi)


def make(name: str):
    """The scheme of that name, e.g. make("grad_h")."""
    return registry.model_class("sph.schemes", name)()
