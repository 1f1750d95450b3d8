"""Balsara factor (eq 21): full viscosity in compression, none in pure shear or rotation.

Without curl, as in 1-D, the factor is nearly 1 where |div v| is well above the softening 1e-4 c/H,
and falls to 0 below. A sound wave of amplitude 1e-6 is below the softening, one of amplitude 1e-2
is above.
"""

from typing import NamedTuple

from sph.model import Model, model


@model(Model)
class Balsara(NamedTuple):
    """No parameters."""

    def balsara_factor(self, divergence, curl, sound_speed, support):
        # 1e-300 gives 0 instead of 0/0 in cold gas at rest
        softening = 1e-4 * sound_speed / support + 1e-300
        return abs(divergence) / (abs(divergence) + curl + softening)
