"""Expansion to quadrupoles (eqs 308 and 309)."""

from typing import NamedTuple

from sph.model import model
from sph.parts.gravity import OPENING_ANGLE, Angle, Constant, Expansion, Softening
from sph.simd import dot, minus, times


@model(Expansion)
class Quadrupole(NamedTuple):
    """The error of a group is that of its octupole."""

    G: Constant = 1.0
    softening: Softening = "adaptive"
    opening_angle: Angle = OPENING_ANGLE

    def moments(self):
        return 5

    def attraction(self, m, Q, OCT, r, r_inv):
        x, y, z = r
        xx, xy, xz, yy, yz = Q
        Qr = (
            xx * x + xy * y + xz * z,
            xy * x + yy * y + yz * z,
            xz * x + yz * y - (xx + yy) * z,  # traceless
        )
        inverse_2 = r_inv * r_inv
        inverse_5 = r_inv * inverse_2 * inverse_2
        rQr = dot(r, Qr) * inverse_5
        pull = (m * r_inv + 2.5 * rQr) * inverse_2
        return minus(times(r, pull), times(Qr, inverse_5)), m * r_inv + 0.5 * rQr
