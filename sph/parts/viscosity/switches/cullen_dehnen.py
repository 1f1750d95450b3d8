"""Alpha rises ahead of a shock, where compression increases (Cullen & Dehnen 2010).

The h of Cullen & Dehnen is the support radius, here H. Their alpha decays to 0; here alpha decays
to `min`.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.compiled import larger
from sph.model import Parameter, model
from sph.parts.viscosity import HIGHEST, LOWEST, Switch

DECAY = (
    "alpha decays in the time H/(2 ell v_sig), with H the support radius and v_sig the signal speed"
)
TINY = 1e-300  # gives 0 instead of 0/0 in gas at rest


@model(Switch)
class CullenDehnen(NamedTuple):
    """`min`, `max`: the range of alpha; `ell`: alpha decays in the time H/(2 ell v_sig)."""

    min: Annotated[float, LOWEST]
    max: Annotated[float, HIGHEST]
    ell: Annotated[float, Parameter(DECAY, above=0.0)] = 0.05

    finds_shocks = True

    def alpha_after(
        self, alpha, dt, support, signal_speed, divergence, divergence_rate, shear, signs
    ):
        converging = (2.0 * (1.0 - signs) ** 4 * divergence) ** 2
        limiter = converging / (converging + shear + TINY)  # eq 74
        A = limiter * larger(-divergence_rate, 0.0 * alpha)  # eq 75
        shock = support * support * A
        target = self.max * shock / (signal_speed * signal_speed + shock + TINY)  # eq 77
        target = larger(target, self.min + 0.0 * alpha)
        # eq 16: alpha rises at once to a larger target, else dalpha/dt = (target - alpha)/tau
        decay = np.exp(-2.0 * self.ell * signal_speed * dt / support)  # tau = H/(2 ell v_sig)
        return target + larger(alpha - target, 0.0 * alpha) * decay
