"""Linear theory of stratified gas at rest in a uniform field: the fastest growing mode.

A displacement (X(y) sin kx, Y(y) cos kx) e^(st) of gas of density R(y) in hydrostatic equilibrium,
with the field g pointing to -y and walls at both ends, makes the quotient

    s^2 = int [-R c^2 D^2 + 2 g R Y D + g R' Y^2] dy / int R (X^2 + Y^2) dy,    D = kX + Y'

stationary (eq 255; Bernstein et al. 1958, Proc. R. Soc. A 244, 17, without a magnetic field).
D is the divergence. The fastest mode has the largest s^2. Finite elements: X is constant in a cell,
Y is linear. Density may jump at faces, where R' is a delta function, so sharp interfaces need no
special treatment. The error is of second order in the width of the cells.
"""

from typing import NamedTuple

import numpy as np


class Layers(NamedTuple):
    """Gas at rest in n cells between walls at the first and the last face."""

    faces: np.ndarray  # (n + 1,) ascending y
    density: np.ndarray  # (n,) R in the middle of each cell
    stiffness: np.ndarray  # (n,) R c^2 there: gamma P in an ideal gas


class Mode(NamedTuple):
    """A mode of displacement or velocity, with a largest Y of 1."""

    rate: float  # s; 0 if no mode grows
    across: np.ndarray  # (n,) X in each cell, the amplitude of sin kx along x
    upward: np.ndarray  # (n + 1,) Y at the faces, the amplitude of cos kx along y


def fastest_mode(layers: Layers, wavenumber: float, gravity: float) -> Mode:
    """Return the mode of that wavenumber along x that grows fastest under g = `gravity`."""
    from scipy.linalg import eigh  # costs 0.1 s to import

    n = layers.density.size
    forces, masses = _matrices(layers, wavenumber, gravity)
    inner = np.r_[1:n, n + 1 : 2 * n + 1]  # without Y at the walls
    last = inner.size - 1
    squared, vector = eigh(
        forces[np.ix_(inner, inner)], masses[np.ix_(inner, inner)], subset_by_index=[last, last]
    )
    upward = np.concatenate([[0.0], vector[: n - 1, 0], [0.0]])
    top = upward[np.abs(upward).argmax()]
    return Mode(float(np.sqrt(max(squared[0], 0.0))), vector[n - 1 :, 0] / top, upward / top)


def two_layers(wavenumber: float, gravity: float, densities, depth: float) -> float:
    """Return the growth rate of a sharp interface between two incompressible layers.

    densities: below, above; `depth`: of each layer, up to a wall. Source: Lamb (1932),
    Hydrodynamics, section 231.
    """
    below, above = densities
    atwood = (above - below) / (above + below)
    return float(np.sqrt(atwood * gravity * wavenumber * np.tanh(wavenumber * depth)))


def _matrices(layers: Layers, k: float, g: float) -> tuple[np.ndarray, np.ndarray]:
    """Return numerator and denominator of the quotient as matrices for (Y at faces, X in cells)."""
    faces, density, stiffness = layers
    n, width = density.size, np.diff(faces)
    cells, low, high = np.arange(n) + n + 1, np.arange(n), np.arange(n) + 1
    divergence, mean = np.zeros((2, n, 2 * n + 1))
    rows = np.arange(n)
    divergence[rows, cells] = k
    divergence[rows, low], divergence[rows, high] = -1.0 / width, 1.0 / width
    mean[rows, low] = mean[rows, high] = 0.5
    buoyancy = mean.T @ (g * width * density * divergence.T).T
    forces = buoyancy + buoyancy.T - divergence.T @ (stiffness * width * divergence.T).T
    jumps = np.arange(1, n)
    forces[jumps, jumps] += g * np.diff(density)
    masses = np.zeros((2 * n + 1, 2 * n + 1))
    mass = density * width
    masses[cells, cells] = mass
    np.add.at(masses, (low, low), mass / 3.0)
    np.add.at(masses, (high, high), mass / 3.0)
    masses[low, high] = masses[high, low] = mass / 6.0
    return forces, masses
