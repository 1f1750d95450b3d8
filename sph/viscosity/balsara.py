"""Balsara's factor: viscosity where the flow converges, none where it only shears (seed eq 21)."""

from typing import NamedTuple


class Balsara(NamedTuple):
    """No parameters."""

    def balsara_factor(self, divergence, curl, sound_speed, support):
        # 1e-300: zero over zero in cold gas at rest is no viscosity
        softening = 1e-4 * sound_speed / support + 1e-300
        return abs(divergence) / (abs(divergence) + curl + softening)
