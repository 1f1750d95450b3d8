"""Constant viscosity coefficient."""

from typing import NamedTuple

from sph.model import model
from sph.parts.viscosity import Coefficient


@model(Coefficient)
class ConstantAlpha(NamedTuple):
    """`alpha`: the coefficient of eq 24."""

    alpha: float

    evolves = False

    def start(self):
        return self.alpha

    def largest(self):
        return self.alpha

    def pair_alpha(self, alpha_i, alpha_j):
        return self.alpha
