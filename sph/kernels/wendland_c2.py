"""Wendland C2 kernel (eqs 11-14; Dehnen & Aly 2012, table 1)."""

import math
from typing import NamedTuple

from sph.compiled import larger
from sph.kernels import Defaults
from sph.model import model


@model(Defaults)
class WendlandC2(NamedTuple):
    """No parameters."""

    def normalisation(self, dim):
        if len(dim) == 1:
            return 5 / 4
        return 7 / math.pi if len(dim) == 2 else 21 / (2 * math.pi)

    def w(self, dim, q):
        u = larger(1.0 - q, 0.0)
        if len(dim) == 1:
            return u * u * u * (1.0 + 3.0 * q)  # eq 11
        return (u * u) * (u * u) * (1.0 + 4.0 * q)  # eq 13

    def dw_over_q(self, dim, q):
        u = larger(1.0 - q, 0.0)
        if len(dim) == 1:
            return -12.0 * u * u  # eq 12: 3 [u^3 - u^2 (1 + 3q)] = -12 q u^2
        return -20.0 * u * u * u  # eq 14: 4 [u^4 - u^3 (1 + 4q)] = -20 q u^3

    force_over_q = dw_over_q

    def enclosed_over_q3(self, q):
        # in powers of 1 - q, of which less cancels than in powers of q
        u = 1.0 - q
        u2 = u * u
        u4 = u2 * u2
        return 1.0 + 3.0 * u + u2 * (6.0 + 10.0 * u) + u4 * (15.0 - 21.0 * u)

    def potential_depth(self, q):
        u = 1.0 - q
        u2 = u * u
        u4 = u2 * u2
        return 1.0 + u + u2 * (1.0 + u) + u4 * (1.0 + u + u2 * (-6.0 + 3.0 * u))
