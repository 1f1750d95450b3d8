"""Interfaces of the terms that parts add to the pair loops and thermodynamics of the gas.

Each term is a model with these methods; `balsara` and `exchange` may be None.

viscosity   pair_alpha(alpha_i, alpha_j); for switches without a pass of their own also alpha_rate
balsara     balsara_factor(divergence, curl, sound_speed, support)
exchange    exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij), the speed in the
            rate m_j speed (u_i - u_j)/rho_ij (dW/dr) at which a pair exchanges internal energy
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


@verb
def exchange_speed(self, pressure_i, pressure_j, density_i, density_j, w_ij):
    return self.exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij)
