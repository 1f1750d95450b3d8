"""Quintic spline kernel (Schoenberg 1946; Morris 1996). Particles form pairs at large eta.

Recommended for smooth flow, with eta below `pairs_above`.
"""

import math
from types import MappingProxyType
from typing import NamedTuple

from numba.extending import register_jitable

from sph.compiled import INLINED, larger, smaller
from sph.kernels import Defaults
from sph.model import model


@model(Defaults)
class QuinticSpline(NamedTuple):
    """No parameters."""

    pairs_above = MappingProxyType({2: 1.8, 3: 1.6})

    def normalisation(self, dim):
        if len(dim) == 1:
            return 3**5 / 40
        return 3**7 * 7 / (478 * math.pi) if len(dim) == 2 else 3**7 / (40 * math.pi)

    def w(self, dim, q):
        a = larger(1.0 - q, 0.0)
        b = larger(2 / 3 - q, 0.0)
        c = larger(1 / 3 - q, 0.0)
        a2, b2, c2 = a * a, b * b, c * c
        return a2 * a2 * a - 6.0 * b2 * b2 * b + 15.0 * c2 * c2 * c

    def dw_over_q(self, dim, q):
        # For q > 1/3: -5 [a^4 - 6 b^4] / q. For q < 1/3 the polynomial -40/9 + 40 q^2 - 50 q^3,
        # written as its value at 1/3 plus powers of c, so that nothing is divided by a small q.
        c = larger(1 / 3 - q, 0.0)
        outer = larger(q, 1 / 3)
        a = larger(1.0 - outer, 0.0)
        b = larger(2 / 3 - outer, 0.0)
        a2, b2 = a * a, b * b
        return -5.0 * (a2 * a2 - 6.0 * b2 * b2) / outer + 10.0 * c * (5.0 * c * c - c - 1.0)

    force_over_q = dw_over_q

    def enclosed_over_q3(self, q):
        return (
            729 / 560 * _enclosed(1.0, q)
            - 32 / 105 * _enclosed(1.5, q)
            + 1 / 336 * _enclosed(3.0, q)
        )

    def potential_depth(self, q):
        return 729 / 560 * _depth(1.0, q) - 32 / 105 * _depth(1.5, q) + 1 / 336 * _depth(3.0, q)


# The spline is a sum of masses with densities proportional to (1 - q/a)_+^5, where a is the
# position of a knot. The functions below are those of one such mass; `inverse` is 1/a. The mass
# acts like a point from q = a on.


@register_jitable(**INLINED)
def _enclosed(inverse, q):
    s = smaller(inverse, 1.0 / larger(q, 1e-30))
    u = 1.0 - q * s
    u2 = u * u
    u4 = u2 * u2
    return s * s * s * (1.0 + 3.0 * u + u2 * (6.0 + 10.0 * u) + u4 * (15.0 + 21.0 * u))


@register_jitable(**INLINED)
def _depth(inverse, q):
    s = smaller(inverse, 1.0 / larger(q, 1e-30))
    u = 1.0 - q * s
    u2 = u * u
    u4 = u2 * u2
    return s * (1.0 + u + u2 * (1.0 + u) + u4 * (1.0 + u + u2 * (1.0 - 3.0 * u)))
