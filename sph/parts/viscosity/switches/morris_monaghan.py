"""Alpha rises in compression and decays elsewhere (Morris & Monaghan 1997).

Eqs 6, 27, 28 and 31, with the source term of Rosswog et al. (2000).
"""

from typing import Annotated, NamedTuple

from sph.compiled import larger
from sph.model import model
from sph.parts.viscosity import HIGHEST, LOWEST, Switch


@model(Switch)
class MorrisMonaghan(NamedTuple):
    """`min`: value to which alpha decays; `max`: value that alpha approaches in strong shocks."""

    min: Annotated[float, LOWEST]
    max: Annotated[float, HIGHEST]

    def alpha_rate(self, alpha, h, sound_speed, divergence):
        decay = (alpha - self.min) * 0.25 * sound_speed / h  # eq 27
        source = larger(-divergence * (self.max - alpha), 0.0 * alpha)  # eq 28
        return source - decay
