"""Shocks and rarefactions of an ideal gas, and the pressure between two waves.

Reference: Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics (2009), sections 4.2 and
4.3. Used by `sph.exact.riemann`, which checks all states and handles vacuum.
"""

import math
from typing import NamedTuple

# Lower star pressures are refused: the sound speed, not small for gamma near 1, would underflow.
SMALLEST_PRESSURE = 1e-300


class State(NamedTuple):
    """Gas on one side, code units."""

    density: float
    velocity: float
    pressure: float


def sound_speed(state: State, gamma: float) -> float:
    """Return c = (gamma P/rho)^(1/2)."""
    return math.sqrt(gamma * state.pressure / state.density)


def escape_speed(state: State, gamma: float) -> float:
    """Return the velocity gained by expansion into vacuum, 2c/(gamma - 1)."""
    return 2.0 * sound_speed(state, gamma) / (gamma - 1.0)


def velocity_change(state: State, p: float, gamma: float) -> tuple[float, float]:
    """Return f_K(p), the change of velocity by the wave, and df_K/dp (Toro eqs 4.6, 4.37)."""
    if p > state.pressure or state.pressure == 0.0:  # shock
        if p == 0.0:
            return 0.0, math.inf
        flux = mass_flux(state, p, gamma)
        f = (p - state.pressure) / flux
        a_term = (gamma + 1.0) * state.density / 4.0 / flux**2  # 1/(2 (p + B_K))
        return f, (1.0 - a_term * (p - state.pressure)) / flux
    if p == 0.0:
        return -escape_speed(state, gamma), math.inf
    exponent = (gamma - 1.0) / (2.0 * gamma)
    log_ratio = math.log(p / state.pressure)
    c = sound_speed(state, gamma)
    # expm1 keeps all digits if p is close to the pressure of the state
    f = 2.0 * c / (gamma - 1.0) * math.expm1(exponent * log_ratio)
    slope = c / (gamma * p) * math.exp(exponent * log_ratio)
    return f, slope


def mass_flux(state: State, p: float, gamma: float) -> float:
    """Return the mass flux through a shock (Toro section 4.2, with A_K and B_K inserted)."""
    return math.sqrt(0.5 * state.density * ((gamma + 1.0) * p + (gamma - 1.0) * state.pressure))


def star_pressure(left: State, right: State, gamma: float) -> float:
    """Return the root of f_L(p) + f_R(p) + u_R - u_L (Toro eq 4.5).

    The function is increasing and concave, so Newton steps from below never overshoot. Raises
    ValueError if the root is positive but below SMALLEST_PRESSURE.
    """
    weaker, stronger = sorted((left, right), key=lambda state: state.pressure)
    parting = right.velocity - left.velocity

    def imbalance(p):
        f_left, slope_left = velocity_change(left, p, gamma)
        f_right, slope_right = velocity_change(right, p, gamma)
        return f_left + f_right + parting, slope_left + slope_right

    if stronger.pressure == parting == 0.0:
        return 0.0  # two cold gases touch at rest
    if imbalance(weaker.pressure)[0] >= 0.0:
        p = _two_fans(left, right, gamma)
    elif imbalance(stronger.pressure)[0] >= 0.0:
        lowest = _bound_with_one_shock(weaker, stronger, parting, gamma)
        p = _climb(imbalance, max(weaker.pressure, lowest, SMALLEST_PRESSURE))
    else:
        p = _climb(imbalance, max(stronger.pressure, _bound_with_two_shocks(left, right, gamma)))
    if p <= SMALLEST_PRESSURE:
        raise ValueError(
            f"the pressure between {tuple(left)} and {tuple(right)} at gamma = {gamma} is positive "
            f"but below {SMALLEST_PRESSURE}, too low for float64"
        )
    return p


def _climb(imbalance, p: float) -> float:
    """Return the root by Newton's iteration from a pressure `p` below the root."""
    for _ in range(100):  # fewer than 30 were needed in 20,000 random problems
        residual, slope = imbalance(p)
        higher = p - residual / slope
        if not higher > p:  # steps from below go upward, except for round-off
            break
        p = higher
    return p


def _two_fans(left: State, right: State, gamma: float) -> float:
    """Return the star pressure between two fans (Toro eq 4.46)."""
    exponent = (gamma - 1.0) / (2.0 * gamma)
    c_left, c_right = sound_speed(left, gamma), sound_speed(right, gamma)
    closing = 0.5 * (gamma - 1.0) * (right.velocity - left.velocity)
    # pressures in units of the larger one, to avoid underflow
    unit = max(left.pressure, right.pressure)
    weight = (
        c_left * (unit / left.pressure) ** exponent + c_right * (unit / right.pressure) ** exponent
    )
    return unit * ((c_left + c_right - closing) / weight) ** (1.0 / exponent)


def _bound_with_one_shock(weaker: State, stronger: State, parting: float, gamma: float) -> float:
    """Return a lower bound of the root p between both pressures, at most a few decades below.

    With x = p/p_K of the stronger side, the fan contributes escape (x^z - 1) and the shock at most
    sqrt(A p) = s x^(1/2). At the root, escape x^z + s x^(1/2) >= escape - parting. So one of the
    terms is at least its fraction of the right side, for any two fractions that add up to 1. The
    fractions 1 - z and z keep both estimates close for small z.
    """
    z = (gamma - 1.0) / (2.0 * gamma)
    escape = escape_speed(stronger, gamma)
    s = math.sqrt(2.0 * stronger.pressure / ((gamma + 1.0) * weaker.density))
    reach = escape - parting
    by_shock = min(1.0, z * reach / s) ** 2
    by_fan = min(1.0, (1.0 - z) * reach / escape) ** (1.0 / z)
    return stronger.pressure * min(by_shock, by_fan)


def _bound_with_two_shocks(left: State, right: State, gamma: float) -> float:
    """Return a lower bound of the root for colliding gases, exact if both are cold."""
    root_a = sum(math.sqrt(2.0 / ((gamma + 1.0) * state.density)) for state in (left, right))
    return (max(0.0, left.velocity - right.velocity) / root_a) ** 2


def star_density(state: State, p: float, gamma: float) -> float:
    """Return the density behind the wave that changes `state` to pressure p."""
    if p == state.pressure:
        return state.density
    if p > state.pressure:  # Rankine-Hugoniot (Toro eq 4.50), free of p/p_K for cold gas
        above = (gamma + 1.0) * p + (gamma - 1.0) * state.pressure
        below = (gamma - 1.0) * p + (gamma + 1.0) * state.pressure
        return state.density * above / below
    return state.density * (p / state.pressure) ** (1.0 / gamma)  # isentrope (eq 4.53)
