"""Exact solution of the Noh implosion of cold gas, in 1-D to 3-D.

Noh (1987), J. Comput. Phys. 72, 78. Gas of uniform density falls towards the centre at uniform
speed. A shock moves outward at (gamma - 1)/2 of that speed and leaves the gas at rest. Ahead of the
shock the gas moves freely and is compressed geometrically. All quantities are in code units;
`radius` is |x| in 1-D.
"""

import math

import numpy as np


def shock_radius(time: float, speed: float, gamma: float) -> float:
    """Return the distance of the shock from the centre, equal for all dimensions."""
    return 0.5 * (gamma - 1.0) * speed * time


def plateau(
    gamma: float, dimension: int, density: float = 1.0, speed: float = 1.0
) -> tuple[float, float]:
    """Return density and pressure behind the shock; `density` is that of the gas at t = 0.

    At the shock the gas is already compressed by (1 + speed t/r)^(D - 1) = J^(D - 1). The shock
    compresses it by J = (gamma + 1)/(gamma - 1) and converts its kinetic energy to heat. Raises
    ValueError for gamma <= 1, a dimension other than 1, 2 or 3, or a value that is not positive.
    """
    if dimension not in (1, 2, 3):
        raise ValueError(f"dimension must be 1, 2 or 3, not {dimension}")
    if not (math.isfinite(gamma) and gamma > 1.0):
        raise ValueError(f"gamma must be a finite number above 1, not {gamma}")
    for name, value in (("density", density), ("speed", speed)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be a finite positive number, not {value}")
    behind = density * ((gamma + 1.0) / (gamma - 1.0)) ** dimension
    return behind, (gamma - 1.0) * behind * 0.5 * speed**2


def solve(
    radius,
    time: float,
    gamma: float,
    dimension: int,
    density: float = 1.0,
    speed: float = 1.0,
    background_pressure: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return density, radial velocity and pressure, each (N,), at `radius` (N,).

    `background_pressure` is the pressure at t = 0. The returned pressure ahead of the shock rises
    from it adiabatically, but the shock is that of cold gas. Raises ValueError as `plateau`, and
    for a negative radius or time.
    """
    radius = np.asarray(radius, dtype=float)
    if np.any(radius < 0.0) or not time >= 0.0:
        raise ValueError("radius and time must not be negative")
    dense, hot = plateau(gamma, dimension, density, speed)
    inside = radius < shock_radius(time, speed, gamma)
    away = np.where(radius > 0.0, radius, 1.0)  # at t > 0 the centre is behind the shock
    compression = (1.0 + speed * time / away) ** (dimension - 1)
    return (
        np.where(inside, dense, density * compression),
        np.where(inside, 0.0, -speed),
        np.where(inside, hot, background_pressure * compression**gamma),
    )
