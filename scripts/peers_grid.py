"""A grid solution of the smooth Kelvin-Helmholtz layer, as a judge that is neither SPH code.

Second-order finite volumes: van Leer slopes of the primitive variables, HLLC fluxes (Toro 2009,
section 10.4), Heun's steps; periodic unit square.
"""

import numpy as np
from numba import njit

COURANT = 0.4  # of the sum over both axes, within the 0.5 that slopes of second order allow


def solve(state: np.ndarray, gamma: float, end: float) -> np.ndarray:
    """Density, velocities and pressure (4, n, n) on cell centres at `end`, from those at t = 0.

    Indices are [variable, x, y].
    """
    n, time = state.shape[1], 0.0
    conserved = _conserved(state, gamma)
    while time < end:
        state = _primitive(conserved, gamma)
        sound = np.sqrt(gamma * state[3] / state[0])
        fastest = (np.abs(state[1]) + np.abs(state[2]) + 2.0 * sound).max()
        step = min(COURANT / (n * fastest), end - time)
        half = conserved + step * _rates(state, gamma)
        full = half + step * _rates(_primitive(half, gamma), gamma)
        conserved = 0.5 * (conserved + full)
        time += step
    return _primitive(conserved, gamma)


def at_points(field: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Cell-centred values (n, n) at (2, N) points of the unit square, bilinear."""
    n = field.shape[0]
    place = position * n - 0.5
    lower = np.floor(place).astype(int)
    (a, b), (i, j) = place - lower, lower % n
    right, up = (i + 1) % n, (j + 1) % n
    low = (1.0 - a) * field[i, j] + a * field[right, j]
    high = (1.0 - a) * field[i, up] + a * field[right, up]
    return (1.0 - b) * low + b * high


def _conserved(state, gamma):
    density, u, v, pressure = state
    energy = pressure / (gamma - 1.0) + 0.5 * density * (u * u + v * v)
    return np.stack([density, density * u, density * v, energy])


def _primitive(conserved, gamma):
    density, x_momentum, y_momentum, energy = conserved
    u, v = x_momentum / density, y_momentum / density
    return np.stack([density, u, v, (gamma - 1.0) * (energy - 0.5 * density * (u * u + v * v))])


def _rates(state, gamma):
    """Rates of the conserved variables: the sweep along y is that along x of the mirrored state."""
    swap = [0, 2, 1, 3]
    mirrored = np.ascontiguousarray(state[swap].transpose(0, 2, 1))
    return _sweep(state, gamma) + _sweep(mirrored, gamma)[swap].transpose(0, 2, 1)


@njit(cache=True)
def _sweep(state, gamma):
    n = state.shape[1]
    rates = np.zeros_like(state)
    left, right, flux = np.empty(4), np.empty(4), np.empty(4)
    for j in range(n):
        for i in range(n):  # face between cells i and i + 1
            before, after, beyond = (i - 1) % n, (i + 1) % n, (i + 2) % n
            for k in range(4):
                here, there = state[k, i, j], state[k, after, j]
                left[k] = here + 0.5 * _van_leer(here - state[k, before, j], there - here)
                right[k] = there - 0.5 * _van_leer(there - here, state[k, beyond, j] - there)
            _hllc(left, right, gamma, flux)
            for k in range(4):
                rates[k, i, j] -= flux[k] * n
                rates[k, after, j] += flux[k] * n
    return rates


@njit(cache=True)
def _van_leer(a, b):
    return 2.0 * a * b / (a + b) if a * b > 0.0 else 0.0


@njit(cache=True)
def _hllc(left, right, gamma, flux):
    """Flux of the conserved variables along x between two states; writes `flux` (4,)."""
    c_left = np.sqrt(gamma * left[3] / left[0])
    c_right = np.sqrt(gamma * right[3] / right[0])
    s_left = min(left[1] - c_left, right[1] - c_right)
    s_right = max(left[1] + c_left, right[1] + c_right)
    m_left, m_right = left[0] * (s_left - left[1]), right[0] * (s_right - right[1])
    contact = (right[3] - left[3] + left[1] * m_left - right[1] * m_right) / (m_left - m_right)
    side, speed = (left, s_left) if contact >= 0.0 else (right, s_right)
    density, u, v, pressure = side
    energy = pressure / (gamma - 1.0) + 0.5 * density * (u * u + v * v)
    flux[0] = density * u
    flux[1] = density * u * u + pressure
    flux[2] = density * u * v
    flux[3] = u * (energy + pressure)
    if s_left < 0.0 < s_right:  # else the whole fan lies on one side
        star = density * (speed - u) / (speed - contact)
        work = contact + pressure / (density * (speed - u))
        flux[0] += speed * (star - density)
        flux[1] += speed * (star * contact - density * u)
        flux[2] += speed * (star * v - density * v)
        flux[3] += speed * (star * (energy / density + (contact - u) * work) - energy)
