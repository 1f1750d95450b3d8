"""Cubic spline kernel (Monaghan & Lattanzio 1985). Particles form pairs at large eta."""

import math
from typing import Annotated, NamedTuple

from numba.extending import register_jitable

from sph.compiled import INLINED, larger, smaller
from sph.kernels import Defaults
from sph.model import Parameter, model


@model(Defaults)
class CubicSpline(NamedTuple):
    """`flattened`: in the pair force (eqs 22-23), use the gradient at q = 1/3 for all q below 1/3.

    Then close particles still repel each other (Thomas & Couchman 1992).
    """

    flattened: Annotated[bool, Parameter("keep the gradient below q = 1/3 in the force")] = False

    @property
    def pairs_above(self) -> dict[int, float]:
        # with the flattened gradient particles stay at least 0.77 spacings apart
        return {} if self.flattened else {2: 1.4, 3: 1.2}

    def normalisation(self, dim):
        if len(dim) == 1:
            return 4 / 3
        return 40 / (7 * math.pi) if len(dim) == 2 else 8 / math.pi

    def w(self, dim, q):
        u = larger(1.0 - q, 0.0)
        v = larger(0.5 - q, 0.0)
        return 2.0 * u * u * u - 8.0 * v * v * v

    def dw_over_q(self, dim, q):
        # 18 q - 12 below q = 1/2 and -6 (1 - q)^2 / q above, in one line without cancellation
        outer = larger(q, 0.5)
        u = larger(1.0 - outer, 0.0)
        v = larger(0.5 - q, 0.0)
        return -6.0 * u * u / outer - 18.0 * v

    def force_over_q(self, dim, q):
        floor = 1 / 3 if self.flattened else 0.0
        clipped = larger(q, floor)
        outer = larger(clipped, 0.5)
        u = larger(1.0 - outer, 0.0)
        v = larger(0.5 - clipped, 0.0)
        # dw/dq at the clipped q, over the true q; 1e-30 matters only for coincident particles
        return (-6.0 * u * u / outer - 18.0 * v) * (clipped / larger(q, 1e-30))

    def enclosed_over_q3(self, q):
        return 16 / 15 * _enclosed(1.0, q) - 1 / 15 * _enclosed(2.0, q)

    def potential_depth(self, q):
        return 16 / 15 * _depth(1.0, q) - 1 / 15 * _depth(2.0, q)


# The spline is a sum of masses with densities proportional to (1 - q/a)_+^3, where a is the
# position of a knot. The functions below are those of one such mass; `inverse` is 1/a. The mass
# acts like a point from q = a on.


@register_jitable(**INLINED)
def _enclosed(inverse, q):
    s = smaller(inverse, 1.0 / larger(q, 1e-30))
    u = 1.0 - q * s
    u2 = u * u
    return s * s * s * (1.0 + 3.0 * u + u2 * (6.0 + 10.0 * u))


@register_jitable(**INLINED)
def _depth(inverse, q):
    s = smaller(inverse, 1.0 / larger(q, 1e-30))
    u = 1.0 - q * s
    u2 = u * u
    u4 = u2 * u2
    return s * (1.0 + u + u2 * (1.0 + u) + u4 * (1.0 - 2.0 * u))
