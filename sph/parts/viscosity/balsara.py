"""Balsara's factor: viscosity where the flow converges, none where it only shears (seed eq 21).

Where there is no curl, as in 1-D, the factor is 1 but for the softening: it falls to 0 where
|div v| is below 1e-4 c/H, as in a sound wave of amplitude 1e-6, and not in one of 1e-2.
"""

from typing import NamedTuple

from sph.model import Model, model


@model(Model)
class Balsara(NamedTuple):
    """No parameters."""

    def balsara_factor(self, divergence, curl, sound_speed, support):
        # 1e-300: zero over zero in cold gas at rest is no viscosity
        softening = 1e-4 * sound_speed / support + 1e-300
        return abs(divergence) / (abs(divergence) + curl + softening)
