"""Pair force with the geometric mean of the two pressure terms in place of the arithmetic one."""

from typing import NamedTuple

import numpy as np

from sph.formulations.gas.schemes import Scheme
from sph.model import model


@model(Scheme)
class Geometric(NamedTuple):
    """Conserves energy and momentum pair by pair; for positive pressures."""

    def pair(self, term_i, term_j, slope_i, slope_j, Pi):
        slope = slope_i + slope_j
        mean = np.sqrt(term_i * term_j)
        return slope * (2.0 * mean + Pi), slope * (mean + 0.5 * Pi)
