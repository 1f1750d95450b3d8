"""Gravity of a point mass at rest in the origin (G = 1), softened as in Plummer (1911).

a = -M r/(r^2 + s^2)^(3/2) and phi = -M/(r^2 + s^2)^(1/2), in 1 to 3 dimensions alike.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.model import Parameter, model
from sph.parts.external import Field


@model(Field)
class PointMass(NamedTuple):
    """`mass`: G M; `softening`: s, a length."""

    mass: Annotated[float, Parameter("G M", at_least=0.0)]
    softening: Annotated[float, Parameter("length below which it is weaker", at_least=0.0)] = 0.0

    def acceleration(self, position):
        squared = self._softened(position)
        # a particle in the very centre of an unsoftened mass is pulled no way
        return -self.mass * position / np.where(squared > 0.0, squared, np.inf) ** 1.5

    def potential(self, position):
        with np.errstate(divide="ignore"):
            return -self.mass / np.sqrt(self._softened(position))

    def misfit(self, boundaries):
        if "periodic" in boundaries:
            return (
                "the mass has no periodic images, so a particle that crosses a periodic face jumps "
                "in its potential and total energy with it; expected no periodic axis. Try: "
                'problem.boundary = "open" or "mirror", or another problem'
            )
        return None

    def _softened(self, position):
        return (position**2).sum(axis=0) + self.softening**2
