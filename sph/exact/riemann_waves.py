"""What one wave does to an ideal gas, and the pressure at which two of them agree.

Reference: Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics (2009), sections 4.2 and
4.3. For `sph.exact.riemann`, which says what the states are: here all have been checked, and
vacuum opens between none of those whose star pressure is asked for.
"""

import math
from typing import NamedTuple

# Below this a star pressure is refused: its sound speed, not small at gamma near 1, would be lost.
SMALLEST_PRESSURE = 1e-300


class State(NamedTuple):
    """Gas on one side, code units."""

    density: float
    velocity: float
    pressure: float


def sound_speed(state: State, gamma: float) -> float:
    """Of an ideal gas, c = (gamma P/rho)^(1/2)."""
    return math.sqrt(gamma * state.pressure / state.density)


def escape_speed(state: State, gamma: float) -> float:
    """Velocity gained by expansion into vacuum, 2c/(gamma - 1)."""
    return 2.0 * sound_speed(state, gamma) / (gamma - 1.0)


def velocity_change(state: State, p: float, gamma: float) -> tuple[float, float]:
    """f_K(p), by which the wave on this side changes velocity, and df_K/dp (Toro eqs 4.6, 4.37)."""
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
    # expm1 keeps all digits where p is near the pressure of the state
    f = 2.0 * c / (gamma - 1.0) * math.expm1(exponent * log_ratio)
    slope = c / (gamma * p) * math.exp(exponent * log_ratio)
    return f, slope


def mass_flux(state: State, p: float, gamma: float) -> float:
    """Mass through a shock per area and time (Toro section 4.2, A_K and B_K written out)."""
    return math.sqrt(0.5 * state.density * ((gamma + 1.0) * p + (gamma - 1.0) * state.pressure))


def star_pressure(left: State, right: State, gamma: float) -> float:
    """Root of f_L(p) + f_R(p) + u_R - u_L (Toro eq 4.5).

    It rises and bends downward, so Newton's steps from below never overshoot. Raises ValueError
    where it is above zero but too low to compute with.
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
            f"the pressure between {tuple(left)} and {tuple(right)} at gamma {gamma} is not vacuum "
            f"but below {SMALLEST_PRESSURE}, too low to compute with"
        )
    return p


def _climb(imbalance, p: float) -> float:
    """Newton's iteration from a pressure below the root."""
    for _ in range(100):  # a guard: fewer than 30 were needed in 20,000 random problems
        residual, slope = imbalance(p)
        higher = p - residual / slope
        if not higher > p:  # from below, a step that is not upward is round-off
            break
        p = higher
    return p


def _two_fans(left: State, right: State, gamma: float) -> float:
    """Star pressure where both waves are fans, in closed form (Toro eq 4.46)."""
    exponent = (gamma - 1.0) / (2.0 * gamma)
    c_left, c_right = sound_speed(left, gamma), sound_speed(right, gamma)
    closing = 0.5 * (gamma - 1.0) * (right.velocity - left.velocity)
    # pressures in units of one of them, lest a power of a tiny number spoils the sum
    unit = max(left.pressure, right.pressure)
    weight = (
        c_left * (unit / left.pressure) ** exponent + c_right * (unit / right.pressure) ** exponent
    )
    return unit * ((c_left + c_right - closing) / weight) ** (1.0 / exponent)


def _bound_with_one_shock(weaker: State, stronger: State, parting: float, gamma: float) -> float:
    """Below the root p between both pressures, by no more than a few decades.

    With x = p/p_K of the stronger side the fan gives escape (x^z - 1) and the shock at most
    sqrt(A p) = s x^(1/2). At the root the two powers reach escape - parting, so that one of them
    reaches its share of it, for any shares: z and 1 - z keep both estimates close at small z.
    """
    z = (gamma - 1.0) / (2.0 * gamma)
    escape = escape_speed(stronger, gamma)
    s = math.sqrt(2.0 * stronger.pressure / ((gamma + 1.0) * weaker.density))
    reach = escape - parting
    by_shock = min(1.0, z * reach / s) ** 2
    by_fan = min(1.0, (1.0 - z) * reach / escape) ** (1.0 / z)
    return stronger.pressure * min(by_shock, by_fan)


def _bound_with_two_shocks(left: State, right: State, gamma: float) -> float:
    """Below the root for colliding gases: exact where both are cold, f = sqrt(A p)."""
    root_a = sum(math.sqrt(2.0 / ((gamma + 1.0) * state.density)) for state in (left, right))
    return (max(0.0, left.velocity - right.velocity) / root_a) ** 2


def star_density(state: State, p: float, gamma: float) -> float:
    """Density behind the wave that takes `state` to the pressure p."""
    if p == state.pressure:
        return state.density
    if p > state.pressure:  # Rankine-Hugoniot (Toro eq 4.50), free of p/p_K for cold gas
        above = (gamma + 1.0) * p + (gamma - 1.0) * state.pressure
        below = (gamma - 1.0) * p + (gamma + 1.0) * state.pressure
        return state.density * above / below
    return state.density * (p / state.pressure) ** (1.0 / gamma)  # isentrope (eq 4.53)
