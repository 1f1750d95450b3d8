"""Lucy's (1977) kernel."""

import math
from typing import NamedTuple

from sph.compiled import larger
from sph.kernels import Defaults
from sph.model import model


@model(Defaults)
class Lucy(NamedTuple):
    """No parameters."""

    def normalisation(self, dim):
        if len(dim) == 1:
            return 5 / 4
        return 5 / math.pi if len(dim) == 2 else 105 / (16 * math.pi)

    def w(self, dim, q):
        u = larger(1.0 - q, 0.0)
        return (1.0 + 3.0 * q) * u * u * u

    def dw_over_q(self, dim, q):
        u = larger(1.0 - q, 0.0)
        return -12.0 * u * u

    force_over_q = dw_over_q
