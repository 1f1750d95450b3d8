"""Balsara's factor: viscosity where the flow converges, none where it only shears (seed eq 21)."""

from typing import NamedTuple


class Model(NamedTuple):
    """No parameters."""

    def balsara_factor(self, divergence, curl, sound_speed, support):
        softening = 1e-4 * sound_speed / support
        return abs(divergence) / (abs(divergence) + curl + softening)
