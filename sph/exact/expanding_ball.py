"""Self-similar free expansion of an isentropic ball of gas.

Ovsyannikov (1956), Dokl. Akad. Nauk SSSR 111, 47; Dyson (1968), J. Math. Mech. 18, 91. In a gas of
density rho_c (R_0/R)^D (1 - r^2/R^2)^(1/(gamma - 1)) with P = K rho^gamma, the acceleration is
proportional to r. So v = r dR/dt / R at all times, and only R(t) remains to be solved for.
"""

import numpy as np


def radius(time: float, start: float, sound_speed: float, gamma: float, dimension: int):
    """Return the radius R and dR/dt at `time`, for an expansion from rest at radius `start`.

    sound_speed: c at the centre at t = 0. Solves
    d2R/dt2 = 2 c^2/(gamma - 1) (R_0/R)^(D (gamma - 1)) / R.
    """
    from scipy.integrate import solve_ivp  # costs 0.2 s to import

    exponent = dimension * (gamma - 1.0)

    def rates(_, state):
        # in units of the initial radius and its sound crossing time
        return state[1], 2.0 / (gamma - 1.0) * state[0] ** (-exponent - 1.0)

    end = time * sound_speed / start
    if end == 0.0:
        return start, 0.0
    found = solve_ivp(rates, (0.0, end), (1.0, 0.0), method="DOP853", rtol=1e-11, atol=1e-12)
    return float(start * found.y[0, -1]), float(sound_speed * found.y[1, -1])


def kinetic_share(radius: float, start: float, gamma: float, dimension: int) -> float:
    """Return the fraction of the initial internal energy that is kinetic energy at `radius`.

    The gas is isentropic, so u ~ rho^(gamma - 1) ~ R^(-D (gamma - 1)).
    """
    return 1.0 - (start / radius) ** (dimension * (gamma - 1.0))


def radius_of_mass(share: np.ndarray, gamma: float, dimension: int) -> np.ndarray:
    """Return the radii (N,), in units of R, inside which the mass fraction is `share` (N,)."""
    from scipy.special import betaincinv

    return np.sqrt(betaincinv(dimension / 2.0, gamma / (gamma - 1.0), share))


def mass(density: float, radius: float, gamma: float, dimension: int) -> float:
    """Return the mass of a ball with that radius and central density."""
    from scipy.special import beta

    surface = (2.0, 2.0 * np.pi, 4.0 * np.pi)[dimension - 1]  # of the unit ball
    return float(
        density * radius**dimension * surface * beta(dimension / 2.0, gamma / (gamma - 1.0)) / 2.0
    )
