"""Expansion to octupoles (eqs 308 and 309)."""

from typing import NamedTuple

from sph.model import model
from sph.parts.gravity import OPENING_ANGLE, Angle, Constant, Expansion, Softening
from sph.simd import dot, minus, plus, times


@model(Expansion)
class Octupole(NamedTuple):
    """The error of a group is that of its next moment."""

    G: Constant = 1.0
    softening: Softening = "adaptive"
    opening_angle: Angle = OPENING_ANGLE

    def moments(self):
        return 12

    def attraction(self, m, Q, OCT, r, r_inv):
        x, y, z = r
        xx, xy, xz, yy, yz = Q
        xxx, xxy, xxz, xyy, xyz, yyy, yyz = OCT
        Qr = (
            xx * x + xy * y + xz * z,
            xy * x + yy * y + yz * z,
            xz * x + yz * y - (xx + yy) * z,  # traceless
        )
        # the octupole times r by pair of axes (xx, xy, xz, yy, yz), and times r r
        a = xxx * x + xxy * y + xxz * z
        b = xxy * x + xyy * y + xyz * z
        c = xxz * x + xyz * y - (xxx + xyy) * z
        d = xyy * x + yyy * y + yyz * z
        e = xyz * x + yyz * y - (xxy + yyy) * z
        Orr = a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y - (a + d) * z
        inverse_2 = r_inv * r_inv
        inverse_5 = r_inv * inverse_2 * inverse_2
        half = 0.5 * (inverse_5 * inverse_2)
        rQr = dot(r, Qr) * inverse_5
        rOrr = dot(r, Orr) * half * (1.0 / 3.0)
        along = (m * r_inv + 2.5 * rQr + 7.0 * rOrr) * inverse_2
        pull = minus(times(r, along), plus(times(Qr, inverse_5), times(Orr, half)))
        return pull, m * r_inv + 0.5 * rQr + rOrr
