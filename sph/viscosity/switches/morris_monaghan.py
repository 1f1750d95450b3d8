"""Alpha rises with the compression of the flow and decays behind it.

Seed eqs 6, 27, 28, 31 (Morris & Monaghan 1997; the source term as in Rosswog et al. 2000).
"""

from typing import NamedTuple

from sph.compiled import larger


class MorrisMonaghan(NamedTuple):
    """`min`: where alpha decays to; `max`: where strong compression drives it."""

    min: float
    max: float

    evolves = True

    def start(self):
        return self.min

    def largest(self):
        return self.max

    def pair_alpha(self, alpha_i, alpha_j):
        return 0.5 * (alpha_i + alpha_j)  # eq 24 prints alpha = 1.0; the pair takes the mean

    def alpha_rate(self, alpha, h, sound_speed, divergence):
        decay = (alpha - self.min) * 0.25 * sound_speed / h  # eq 27
        source = larger(-divergence * (self.max - alpha), 0.0 * alpha)  # eq 28
        return source - decay
