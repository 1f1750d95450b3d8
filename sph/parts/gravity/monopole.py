"""Expansion to monopoles: a distant group acts like its mass in its centre of mass."""

from typing import NamedTuple

from sph.model import model
from sph.parts.gravity import OPENING_ANGLE, Angle, Constant, Expansion, Softening
from sph.simd import times


@model(Expansion)
class Monopole(NamedTuple):
    """The dipole about the centre of mass is zero."""

    G: Constant = 1.0
    softening: Softening = "adaptive"
    opening_angle: Angle = OPENING_ANGLE

    def moments(self):
        return 0

    def attraction(self, m, Q, OCT, r, r_inv):
        depth = m * r_inv
        return times(r, depth * (r_inv * r_inv)), depth
