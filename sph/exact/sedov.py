"""Exact point explosion of a gamma-law gas in 1, 2 or 3 dimensions (Sedov 1959).

References: Kamm & Timmes 2007 (LA-UR-07-2849), "standard case" with uniform density; Landau &
Lifshitz, Fluid Mechanics, paragraph 106. A cold gas at rest receives `energy` at the origin at
t = 0. The solution depends only on lambda = r/R, with R the radius of the shock.

The closed-form interior has one parameter. Here it is y = x2 of Kamm & Timmes, from 0 at the
centre to 1 at the shock, for which the other factors have no cancellation. Their exponents diverge
at gamma = 2, where x3 = x4; `_interior` writes the product so that it stays finite.

`energy` is the total energy: per area in 1-D (both sides), per length in 2-D. All quantities are in
code units; `radius` is |x| in 1-D.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

# Smaller lambda are treated as this one, so that the logarithm stays finite.
SMALLEST_LAMBDA = 1e-250

# From this gamma on, a blast in 3-D is hollow at the centre, which these formulas do not describe.
HOLLOW = 7.0


class _Interior(NamedTuple):
    """Profile at given y; density, pressure and velocity are relative to the shock."""

    log_lambda: np.ndarray
    log_density: np.ndarray  # g of Kamm & Timmes
    pressure: np.ndarray  # h, over the pressure at the shock
    velocity: np.ndarray  # x1 = f/lambda: velocity over that at the shock and over lambda
    slope: np.ndarray  # d ln lambda / d ln y


class _Integrals(NamedTuple):
    """Integrals over lambda^(D-1) d(lambda) from 0 to 1 of fields relative to the shock."""

    energy: float  # of g f^2 + h
    momentum: float  # of g f
    momentum_radius: float  # of g f lambda


def shock_radius(energy: float, density: float, gamma: float, dimension: int, time: float) -> float:
    """Return R = (E t^2 / (a rho))^(1/(D+2)), with a from the energy integral of the interior.

    Raises ValueError for a parameter that is not positive, gamma <= 1, a dimension other than 1, 2
    or 3, and gamma >= HOLLOW in 3-D.
    """
    _check(gamma, dimension, energy=energy, density=density, time=time)
    return (energy * time**2 / (_energy_factor(gamma, dimension) * density)) ** (
        1.0 / (dimension + 2)
    )


def solve(
    radius,
    time: float,
    energy: float,
    density: float,
    gamma: float,
    dimension: int,
    background_pressure: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return density, radial velocity and pressure, each (N,), at `radius` (N,).

    `background_pressure` is the pressure returned ahead of the shock; the solution neglects it.
    Raises ValueError as `shock_radius`, and for a negative radius.
    """
    radius = np.asarray(radius, dtype=float)
    if np.any(radius < 0.0):
        raise ValueError("radius must not be negative")
    shock = shock_radius(energy, density, gamma, dimension, time)
    shock_speed = 2.0 / (dimension + 2) * shock / time
    scaled = np.minimum(radius / shock, 1.0)
    log_lambda = np.log(np.maximum(scaled, SMALLEST_LAMBDA))
    inside = _interior(_log_y(log_lambda, gamma, dimension), gamma, dimension)
    # Strong-shock values behind the front (Landau & Lifshitz eq 106.3) times the profile
    interior = (
        (gamma + 1.0) / (gamma - 1.0) * density * np.exp(inside.log_density),
        2.0 / (gamma + 1.0) * shock_speed * inside.velocity * scaled,
        2.0 / (gamma + 1.0) * density * shock_speed**2 * inside.pressure,
    )
    is_inside = radius <= shock
    return (
        np.where(is_inside, interior[0], density),
        np.where(is_inside, interior[1], 0.0),
        np.where(is_inside, interior[2], background_pressure),
    )


def momentum_weighted_radius(
    energy: float, density: float, gamma: float, dimension: int, time: float
) -> float:
    """Return integral(rho v_r r dV) / integral(rho v_r dV), a radius insensitive to noise.

    Its ratio to the shock radius depends only on gamma and dimension. Raises ValueError as
    `shock_radius`.
    """
    shock = shock_radius(energy, density, gamma, dimension, time)
    integrals = _integrals(gamma, dimension)
    return shock * integrals.momentum_radius / integrals.momentum


def _check(gamma: float, dimension: int, **positive: float) -> None:
    if dimension not in (1, 2, 3):
        raise ValueError(f"dimension must be 1, 2 or 3, not {dimension}")
    if not (math.isfinite(gamma) and gamma > 1.0):
        raise ValueError(f"gamma must be a finite number above 1, not {gamma}")
    if dimension == 3 and gamma >= HOLLOW:
        raise ValueError(
            f"in 3-D gamma must be below {HOLLOW:g}, above which the blast is hollow, not {gamma}"
        )
    for name, value in positive.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be a finite positive number, not {value}")


def _interior(log_y: np.ndarray, gamma: float, dimension: int) -> _Interior:
    """Return the self-similar profile at ln y (N,), with y from 0 (centre) to 1 (shock).
    With u = V (D+2)/2 (velocity over that of a point at constant lambda) and k as below,
    x1 = u/u2, x4 = (1 - u)/(1 - u2) and x3 = (1 - k u)/(1 - k u2), where u2 is u at the shock.
    """
    j, s = dimension, gamma - 1.0
    alpha0 = 2.0 / (j + 2)
    alpha2 = -s / (2.0 * s + j)
    alpha1 = (j + 2) * gamma / (2.0 + j * s)
    alpha1 *= 2.0 * j * (2.0 - gamma) / (gamma * (j + 2) ** 2) - alpha2
    alpha3 = j / (2.0 * s + j)
    # alpha4 + alpha5, the factor 2 - gamma of both denominators divided out
    alpha45 = (j - 2) * (2.0 * j - s * (j - 2)) / ((2.0 * s + j) * (2.0 + j * s))

    y = np.exp(log_y)
    u, u2 = (1.0 + y * s / (gamma + 1.0)) / gamma, 2.0 / (gamma + 1.0)
    k = (2.0 + j * s) / (j + 2)
    x1 = u / u2
    x4 = (gamma + 1.0 - y) / gamma
    log_x1, log_x4 = np.log(x1), np.log(x4)
    # ln(x3/x4) = epsilon * ratio, and alpha4 = alpha1 j / epsilon
    epsilon = j * (2.0 - gamma) / (j + 2)
    ratio = _log1p_over(u / (1.0 - u), epsilon) - _log1p_over(u2 / (1.0 - u2), epsilon)
    log_x3 = log_x4 + epsilon * ratio

    log_density = alpha3 * log_y + j * alpha1 * ratio + alpha45 * log_x4
    log_pressure = (  # the powers of y cancel: the pressure at the centre is finite
        j * alpha0 * log_x1 - 2.0 * alpha1 * log_x3 + j * alpha1 * ratio + (alpha45 + 1.0) * log_x4
    )
    du = y * s / (gamma * (gamma + 1.0))  # du / d ln y
    return _Interior(
        -alpha0 * log_x1 - alpha2 * log_y - alpha1 * log_x3,
        log_density,
        np.exp(log_pressure),
        x1,
        -alpha0 * du / u - alpha2 + alpha1 * k * du / (1.0 - k * u),
    )


def _log1p_over(w, epsilon: float):
    """Return ln(1 + epsilon w) / epsilon, and its limit w at epsilon = 0."""
    return np.log1p(epsilon * w) / epsilon if epsilon != 0.0 else w


def _log_y(log_lambda: np.ndarray, gamma: float, dimension: int) -> np.ndarray:
    """Return ln y (N,) at ln lambda (N,) <= 0: Newton's iteration with bisection as safeguard."""
    high = np.zeros_like(log_lambda)
    exponent = (gamma - 1.0) / (2.0 * (gamma - 1.0) + dimension)
    # d ln lambda / d ln y is `exponent` at the centre, and above half of that everywhere
    low = 2.0 * log_lambda / exponent
    log_y = np.clip(log_lambda / exponent, low, high)
    for _ in range(200):  # 10 suffice unless gamma is close to 7 in 3-D
        at = _interior(log_y, gamma, dimension)
        excess = at.log_lambda - log_lambda
        high = np.where(excess >= 0.0, log_y, high)
        low = np.where(excess <= 0.0, log_y, low)
        newton = log_y - excess / at.slope
        following = np.where((newton > low) & (newton < high), newton, 0.5 * (low + high))
        if np.all(np.abs(following - log_y) <= 1e-15 * (1.0 + np.abs(log_y))):
            break
        log_y = following
    return log_y


@cache
def _integrals(gamma: float, dimension: int) -> _Integrals:
    """Return the integrals by Gauss-Legendre quadrature on panels that halve toward the shock.

    The variable is z = y^(1/p). lambda^D is y^beta times an analytic function of y. With
    p = m / beta, m an integer, lambda^D is z^m times a function of z that is smooth at the centre,
    where y is a power of z of at least 10.
    """
    beta = dimension * (gamma - 1.0) / (2.0 * (gamma - 1.0) + dimension)
    power = math.ceil(10.0 * beta) / beta
    node, weight = np.polynomial.legendre.leggauss(20)
    edge = np.append(1.0 - 0.5 ** np.arange(20), 1.0)
    half = 0.5 * np.diff(edge)[:, None]
    z = (edge[:-1, None] + half * (1.0 + node)).ravel()
    at = _interior(power * np.log(z), gamma, dimension)
    lam = np.exp(at.log_lambda)
    shell = (half * weight).ravel() * lam**dimension * at.slope * power / z  # of lambda^D / D
    mass, f = np.exp(at.log_density) * shell, at.velocity * lam
    return _Integrals(
        float(np.sum(mass * f**2 + at.pressure * shell)),
        float(np.sum(mass * f)),
        float(np.sum(mass * f * lam)),
    )


def _energy_factor(gamma: float, dimension: int) -> float:
    """Return a = E t^2 / (rho R^(D+2)), from kinetic and internal energy of the interior."""
    sphere = (2.0, 2.0 * math.pi, 4.0 * math.pi)[dimension - 1]
    speed = 2.0 / (dimension + 2)  # of the shock, in R/t
    return sphere * speed**2 * 2.0 / (gamma**2 - 1.0) * _integrals(gamma, dimension).energy
