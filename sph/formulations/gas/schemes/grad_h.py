"""Grad-h SPH with the average of both kernel gradients (eqs 22-23)."""

from typing import NamedTuple

from sph.formulations.gas.schemes import Scheme
from sph.model import model


@model(Scheme)
class GradH(NamedTuple):
    """Conserves energy and momentum of each pair to round-off; entropy drifts in smooth flow."""

    def pair(self, term_i, term_j, slope_i, slope_j, Pi):
        slope = slope_i + slope_j
        return slope * (term_i + term_j + Pi), slope * (term_i + 0.5 * Pi)
