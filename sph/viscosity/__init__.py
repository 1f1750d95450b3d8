"""Artificial viscosity: how the coefficient alpha of a pair comes about, and Balsara's factor.

A viscosity is a file that holds a NamedTuple with the methods

    pair_alpha(alpha_i, alpha_j)                     alpha of the pair (eq 24)
    alpha_rate(alpha, h, sound_speed, divergence)    its rate of change (eqs 27-28), if it evolves
    start()                                          alpha of every particle at t = 0

and the class attribute `evolves`: False where alpha is one number, which then costs no array.
"""

from sph.compiled import verb


@verb
def pair_alpha(self, alpha_i, alpha_j):
    return self.pair_alpha(alpha_i, alpha_j)


@verb
def alpha_rate(self, alpha, h, sound_speed, divergence):
    return self.alpha_rate(alpha, h, sound_speed, divergence)


@verb
def balsara_factor(self, divergence, curl, sound_speed, support):
    return self.balsara_factor(divergence, curl, sound_speed, support)
