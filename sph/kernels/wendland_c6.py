"""Wendland C6 kernel (Dehnen & Aly 2012, table 1).

For the smallest errors, with many neighbours (eta of about 2.4 or more in 3-D).
"""

import math
from typing import NamedTuple

from sph.compiled import larger
from sph.kernels import Defaults
from sph.model import model


@model(Defaults)
class WendlandC6(NamedTuple):
    """No parameters."""

    def normalisation(self, dim):
        if len(dim) == 1:
            return 55 / 32
        return 78 / (7 * math.pi) if len(dim) == 2 else 1365 / (64 * math.pi)

    def w(self, dim, q):
        u = larger(1.0 - q, 0.0)
        u2 = u * u
        u4 = u2 * u2
        if len(dim) == 1:
            return u4 * u2 * u * (1.0 + 7.0 * q + 19.0 * q * q + 21.0 * q * q * q)
        return u4 * u4 * (1.0 + 8.0 * q + 25.0 * q * q + 32.0 * q * q * q)

    def dw_over_q(self, dim, q):
        u = larger(1.0 - q, 0.0)
        u2 = u * u
        u4 = u2 * u2
        if len(dim) == 1:
            return -6.0 * u4 * u2 * (3.0 + 18.0 * q + 35.0 * q * q)
        return -22.0 * u4 * u2 * u * (1.0 + 7.0 * q + 16.0 * q * q)

    force_over_q = dw_over_q

    def enclosed_over_q3(self, q):
        # in powers of 1 - q, of which less cancels than in powers of q
        u = 1.0 - q
        u2 = u * u
        u4 = u2 * u2
        u8 = u4 * u4
        return (
            1.0
            + 3.0 * u
            + u2 * (6.0 + 10.0 * u)
            + u4 * (15.0 + 21.0 * u + u2 * (28.0 + 36.0 * u))
            + u8 * (45.0 - 570.625 * u + u2 * (629.0625 - 195.0 * u))
        )

    def potential_depth(self, q):
        u = 1.0 - q
        u2 = u * u
        u4 = u2 * u2
        u8 = u4 * u4
        return (
            1.0
            + u
            + u2 * (1.0 + u)
            + u4 * (1.0 + u + u2 * (1.0 + u))
            + u8 * (1.0 + u + u2 * (-61.5625 + 109.0625 * u) + u4 * (-68.671875 + 15.0 * u))
        )
