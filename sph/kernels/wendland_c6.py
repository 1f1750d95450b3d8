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
