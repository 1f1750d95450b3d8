"""Uniform field: a constant acceleration g everywhere.

Its potential is -g.r, which is zero at the origin (eq 92).
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.model import Parameter, model
from sph.parts.external import Field


@model(Field)
class Uniform(NamedTuple):
    """`g`: acceleration (D,), one number per axis."""

    g: Annotated[list[float], Parameter("acceleration, one number per axis", example=[0.0, -9.81])]

    def acceleration(self, position):
        return np.broadcast_to(np.array(self.g)[:, None], position.shape)

    def potential(self, position):
        return -(np.array(self.g)[:, None] * position).sum(axis=0)

    def misfit(self, boundaries):
        if len(self.g) != len(boundaries):
            return f"g has length {len(self.g)}: expected {len(boundaries)}, one number per axis"
        along = zip("xyz", boundaries, self.g, strict=False)
        if crossed := [axis for axis, boundary, g in along if boundary == "periodic" and g]:
            return (
                f"g has a component along {crossed[0]}, a periodic axis: the potential of a "
                "particle, and total energy, would jump when it crosses the periodic boundary. "
                "Try: 0 for this component of g, or another problem.boundary"
            )
        return None
