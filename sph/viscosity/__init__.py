"""Artificial viscosity: how the coefficient alpha of a pair comes about, and Balsara's factor.

A viscosity is a NamedTuple with the methods

    pair_alpha(alpha_i, alpha_j)    alpha of the pair (eq 24)
    start()                         alpha of every particle at t = 0
    largest()                       the most that alpha may become

and the class attribute `evolves`: False where alpha is one number (constant.py), which then costs
no array. The others are the files of switches/, and have one method more,

    alpha_rate(alpha, h, sound_speed, divergence)    rate of change of alpha (eqs 27-28)

or, with the class attribute `finds_shocks`, which brings the pass over velocity gradients,

    alpha_after(alpha, dt, support, signal_speed, divergence, divergence_rate, shear, signs)

alpha at the end of a step dt. Of the particle's support H, signal_speed is the largest
(c_i + c_j)/2 - w_ij, divergence_rate d(div v)/dt, shear the sum of squares of the traceless
rate of strain, signs the mean of sgn(div v_j) weighted by the kernel.
"""

from sph.compiled import verb


@verb
def pair_alpha(self, alpha_i, alpha_j):
    return self.pair_alpha(alpha_i, alpha_j)


@verb
def alpha_rate(self, alpha, h, sound_speed, divergence):
    return self.alpha_rate(alpha, h, sound_speed, divergence)


@verb
def alpha_after(
    self, alpha, dt, support, signal_speed, divergence, divergence_rate, shear, signs
):  # fmt: skip
    return self.alpha_after(
        alpha, dt, support, signal_speed, divergence, divergence_rate, shear, signs
    )  # fmt: skip


@verb
def balsara_factor(self, divergence, curl, sound_speed, support):
    return self.balsara_factor(divergence, curl, sound_speed, support)
