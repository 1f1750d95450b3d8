"""A Lagrangian finite-volume code in 1-D, as reference where no exact solution exists.

MUSCL-Hancock with the star state of HLLC (Toro 2009, Riemann Solvers and Numerical Methods for
Fluid Dynamics, sections 14.4 and 10.4), the limiter of monotonised central differences (van Leer
1977) and the outer wave speeds of Einfeldt (1988), SIAM J. Numer. Anal. 25, 294. The cells move
with the gas, so contacts stay sharp, which a grid at rest would smear more and more. The method is
of second order in smooth flow and of first order at shocks.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED

# `Problem.truth` of problems that use this reference.
TRUTH = ("a finite-volume solution", "finite volumes")

# Time step in units of the sound crossing time of a cell; faces move less than a cell in it
COURANT = 0.5


class Cells(NamedTuple):
    """Cell averages in code units: mass-weighted velocity, and pressure of the mean energy."""

    faces: np.ndarray  # (cells + 1,) ascending
    density: np.ndarray  # (cells,)
    velocity: np.ndarray
    pressure: np.ndarray

    def at(self, x) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return density, velocity and pressure (N,) at x (N,), linear between cell centres."""
        centres = 0.5 * (self.faces[1:] + self.faces[:-1])
        return tuple(np.interp(x, centres, values) for values in self[1:])


def evolve(cells: Cells, eos, time: float, walls: tuple[bool, bool]) -> Cells:
    """Return the cells after `time`.

    eos: an ideal or stiffened gas; walls: for each end, whether it is a reflecting wall, otherwise
    it moves with the gas and transmits waves. Raises ValueError if a density or pressure is not
    positive.
    """
    faces = np.array(cells.faces, dtype=float)
    state = np.array([cells.density, cells.velocity, cells.pressure + eos.p_inf], dtype=float)
    if not (state[0].min() > 0.0 and state[2].min() > 0.0):
        raise ValueError("expected positive density and pressure in every cell")
    _evolve(faces, state, float(eos.gamma), float(time), *walls)
    return Cells(faces, state[0], state[1], state[2] - eos.p_inf)


@njit(**COMPILED)
def _evolve(faces, state, gamma, time, wall_low, wall_high):
    """Advance faces (n + 1) and state (3, n), which is density, velocity and pressure, in place."""
    n = state.shape[1]
    mass = (faces[1:] - faces[:-1]) * state[0]
    change, rate = np.empty((3, n)), np.empty((3, n))
    lower, upper = np.empty((3, n)), np.empty((3, n))  # states on both faces of each cell
    speed, push = np.empty(n + 1), np.empty(n + 1)  # velocity and pressure of each face
    while time > 0.0:
        dt = time
        for i in range(n):
            c = np.sqrt(gamma * state[2, i] / state[0, i])
            dt = min(dt, COURANT * (faces[i + 1] - faces[i]) / c)
        time = time - dt if dt < time else 0.0
        limit_changes(state, wall_low, wall_high, change)
        for i in range(n):
            width = faces[i + 1] - faces[i]
            rate[0, i] = -state[0, i] * change[1, i] / width
            rate[1, i] = -change[2, i] / (state[0, i] * width)
            rate[2, i] = -gamma * state[2, i] * change[1, i] / width
        reconstruct(state, change, rate, 0.5 * dt, lower, upper)
        solve_faces(lower, upper, gamma, wall_low, wall_high, speed, push)
        for i in range(n + 1):
            faces[i] += dt * speed[i]
        for i in range(n):
            v, per_mass = state[1, i], dt / mass[i]
            energy = state[2, i] / ((gamma - 1.0) * state[0, i]) + 0.5 * v * v
            energy -= per_mass * (push[i + 1] * speed[i + 1] - push[i] * speed[i])
            v -= per_mass * (push[i + 1] - push[i])
            state[0, i] = mass[i] / (faces[i + 1] - faces[i])
            state[1, i] = v
            state[2, i] = (gamma - 1.0) * state[0, i] * (energy - 0.5 * v * v)


@njit(**COMPILED)
def _limited(below, above):
    """Return the limited change across a cell, from differences to its neighbours."""
    if below * above <= 0.0:
        return 0.0
    size = min(2.0 * abs(below), 2.0 * abs(above), 0.5 * abs(below + above))
    return size if above > 0.0 else -size


@njit(**COMPILED)
def _neighbour(state, k, i, wall_low, wall_high):
    """Return value k of cell i; beyond the ends, the last cell, mirrored at a wall."""
    n = state.shape[1]
    if i < 0:
        return -state[k, 0] if k == 1 and wall_low else state[k, 0]
    if i >= n:
        return -state[k, n - 1] if k == 1 and wall_high else state[k, n - 1]
    return state[k, i]


@njit(**COMPILED)
def limit_changes(state, wall_low, wall_high, change):
    """Set the limited changes (3, n) of density, velocity and pressure across each cell."""
    for k in range(3):
        for i in range(state.shape[1]):
            below = state[k, i] - _neighbour(state, k, i - 1, wall_low, wall_high)
            above = _neighbour(state, k, i + 1, wall_low, wall_high) - state[k, i]
            change[k, i] = _limited(below, above)


@njit(**COMPILED)
def reconstruct(state, change, rate, half_dt, lower, upper):
    """Set the states (3, n) at both faces of each cell after half a step (Toro eqs 14.42-14.43).

    change: (3, n) across a cell; rate: (3, n) rates of change in time, of a moving cell.
    """
    for i in range(state.shape[1]):
        density = state[0, i] + half_dt * rate[0, i]
        pressure = state[2, i] + half_dt * rate[2, i]
        # first order where expansion would empty the cell within half a step
        if density <= 0.5 * abs(change[0, i]) or pressure <= 0.5 * abs(change[2, i]):
            for k in range(3):
                lower[k, i] = upper[k, i] = state[k, i]
            continue
        for k in range(3):
            middle = state[k, i] + half_dt * rate[k, i]
            lower[k, i] = middle - 0.5 * change[k, i]
            upper[k, i] = middle + 0.5 * change[k, i]


@njit(**COMPILED)
def solve_faces(lower, upper, gamma, wall_low, wall_high, speed, push):
    """Set velocity and pressure of the contact at each face by HLLC (Toro eqs 10.36-10.37)."""
    n = lower.shape[1]
    for face in range(n + 1):
        if face == 0:
            rho_R, v_R, P_R = lower[0, 0], lower[1, 0], lower[2, 0]
            rho_L, v_L, P_L = rho_R, -v_R if wall_low else v_R, P_R
        else:
            rho_L, v_L, P_L = upper[0, face - 1], upper[1, face - 1], upper[2, face - 1]
            if face == n:
                rho_R, v_R, P_R = rho_L, -v_L if wall_high else v_L, P_L
            else:
                rho_R, v_R, P_R = lower[0, face], lower[1, face], lower[2, face]
        c_L, c_R = np.sqrt(gamma * P_L / rho_L), np.sqrt(gamma * P_R / rho_R)
        # Einfeldt: Roe averages, and a part of the jump of velocity
        w_L, w_R = np.sqrt(rho_L), np.sqrt(rho_R)
        mean = (w_L * v_L + w_R * v_R) / (w_L + w_R)
        spread = (w_L * c_L**2 + w_R * c_R**2) / (w_L + w_R)
        spread = np.sqrt(spread + 0.5 * w_L * w_R / (w_L + w_R) ** 2 * (v_R - v_L) ** 2)
        flow_L = rho_L * (min(v_L - c_L, mean - spread) - v_L)
        flow_R = rho_R * (max(v_R + c_R, mean + spread) - v_R)
        S = (P_R - P_L + flow_L * v_L - flow_R * v_R) / (flow_L - flow_R)
        speed[face] = S
        push[face] = P_L + flow_L * (S - v_L)
