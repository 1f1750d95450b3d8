"""Grad-h SPH with the averaged kernel gradient: the seed's eqs 22-23, as printed."""

from typing import NamedTuple


class GradH(NamedTuple):
    """Conserves energy and momentum pair by pair to round-off; entropy drifts in smooth flow."""

    def pair(self, term_i, term_j, slope_i, slope_j, Pi):
        slope = slope_i + slope_j
        return slope * (term_i + term_j + Pi), slope * (term_i + 0.5 * Pi)
