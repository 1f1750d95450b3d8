"""Alpha rises with compression as in Morris & Monaghan (1997), and decays at a rate one can set."""

from typing import Annotated, NamedTuple

from sph.compiled import larger
from sph.model import Parameter, model
from sph.parts.viscosity import HIGHEST, LOWEST, Switch


@model(Switch)
class Patient(NamedTuple):
    """`patience`: alpha decays over `patience` h/c."""

    min: Annotated[float, LOWEST]
    max: Annotated[float, HIGHEST]
    patience: Annotated[float, Parameter("decay time in units of h/c", above=0.0)] = 8.0

    def alpha_rate(self, alpha, h, sound_speed, divergence):
        source = larger(-divergence * (self.max - alpha), 0.0 * alpha)
        return source - (alpha - self.min) * sound_speed / (self.patience * h)
