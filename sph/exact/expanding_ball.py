"""Free expansion of an isentropic ball of gas that stays similar to itself.

Ovsyannikov (1956), Dokl. Akad. Nauk SSSR 111, 47; Dyson (1968), J. Math. Mech. 18, 91. In a gas of
density rho_c (R_0/R)^D (1 - r^2/R^2)^(1/(gamma - 1)) with P = K rho^gamma, pressure accelerates in
proportion to r. So v = r dR/dt / R for ever, and the radius is all there is to solve for.
"""

import numpy as np


def radius(time: float, start: float, sound_speed: float, gamma: float, dimension: int):
    """Radius R and its rate dR/dt at `time`, from rest at radius `start`.

    sound_speed: at the centre at t = 0. d2R/dt2 = 2 c^2/(gamma - 1) (R_0/R)^(D (gamma - 1)) / R.
    """
    from scipy.integrate import solve_ivp  # costs 0.2 s to import

    exponent = dimension * (gamma - 1.0)

    def rates(_, state):
        # in units of the first radius and of the time in which sound crosses it
        return state[1], 2.0 / (gamma - 1.0) * state[0] ** (-exponent - 1.0)

    end = time * sound_speed / start
    if end == 0.0:
        return start, 0.0
    found = solve_ivp(rates, (0.0, end), (1.0, 0.0), method="DOP853", rtol=1e-11, atol=1e-12)
    return float(start * found.y[0, -1]), float(sound_speed * found.y[1, -1])


def kinetic_share(radius: float, start: float, gamma: float, dimension: int) -> float:
    """What part of the first internal energy has become motion at that radius.

    The rest of it does work as entropy stays: u ~ rho^(gamma - 1) ~ R^(-D (gamma - 1)).
    """
    return 1.0 - (start / radius) ** (dimension * (gamma - 1.0))


def radius_of_mass(share: np.ndarray, gamma: float, dimension: int) -> np.ndarray:
    """Radii, in units of R, that hold the parts `share` of the mass."""
    from scipy.special import betaincinv

    return np.sqrt(betaincinv(dimension / 2.0, gamma / (gamma - 1.0), share))


def mass(density: float, radius: float, gamma: float, dimension: int) -> float:
    """Mass of a ball of that radius and central density."""
    from scipy.special import beta

    surface = (2.0, 2.0 * np.pi, 4.0 * np.pi)[dimension - 1]  # of the unit ball
    return float(
        density * radius**dimension * surface * beta(dimension / 2.0, gamma / (gamma - 1.0)) / 2.0
    )
