"""Wendland C4 kernel (Dehnen & Aly 2012, table 1).

Needs more neighbours than C2 (eta of about 2.0 or more in 3-D) and gives smoother sums.
"""

import math
from typing import NamedTuple

from sph.compiled import larger
from sph.kernels import Defaults
from sph.model import model


@model(Defaults)
class WendlandC4(NamedTuple):
    """No parameters."""

    def normalisation(self, dim):
        if len(dim) == 1:
            return 3 / 2
        return 9 / math.pi if len(dim) == 2 else 495 / (32 * math.pi)

    def w(self, dim, q):
        u = larger(1.0 - q, 0.0)
        u2 = u * u
        if len(dim) == 1:
            return u2 * u2 * u * (1.0 + 5.0 * q + 8.0 * q * q)
        return u2 * u2 * u2 * (1.0 + 6.0 * q + 35 / 3 * q * q)

    def dw_over_q(self, dim, q):
        u = larger(1.0 - q, 0.0)
        u2 = u * u
        if len(dim) == 1:
            return -14.0 * u2 * u2 * (1.0 + 4.0 * q)
        return -56 / 3 * u2 * u2 * u * (1.0 + 5.0 * q)

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
            + u4 * (15.0 + 21.0 * u + u2 * (28.0 - 129.0 * u))
            + u8 * 65.625
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
            + u8 * (-19.625 + 21.625 * u + u2 * -6.5625)
        )
