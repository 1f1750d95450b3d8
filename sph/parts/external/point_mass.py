"""Gravity of a point mass at rest at the origin (G = 1), with Plummer softening.

a = -M r/(r^2 + s^2)^(3/2) and phi = -M/(r^2 + s^2)^(1/2), in any dimension.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.model import Parameter, model
from sph.parts.external import Field


@model(Field)
class PointMass(NamedTuple):
    """`mass`: M; `softening`: the length s."""

    mass: Annotated[float, Parameter("mass M, with G = 1", at_least=0.0)]
    softening: Annotated[
        float, Parameter("distance below which gravity is weaker than M/r^2", at_least=0.0)
    ] = 0.0

    def acceleration(self, position):
        squared = self._softened(position)
        # at the centre of an unsoftened mass the acceleration is set to 0
        return -self.mass * position / np.where(squared > 0.0, squared, np.inf) ** 1.5

    def potential(self, position):
        with np.errstate(divide="ignore"):
            return -self.mass / np.sqrt(self._softened(position))

    def misfit(self, boundaries):
        if "periodic" in boundaries:
            return (
                "expected no periodic axis: the mass has no periodic images, so the potential of a "
                "particle, and total energy, would jump when it crosses a periodic boundary. Try: "
                'problem.boundary = "open" or "mirror", or another problem'
            )
        return None

    def _softened(self, position):
        return (position**2).sum(axis=0) + self.softening**2
