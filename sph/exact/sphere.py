"""A Lagrangian finite-volume code for a sphere of ideal gas with its own gravity.

The method of `finite_volume`, with its limiter and its solver of Riemann problems, in spherical
symmetry: cells are shells of constant mass, the centre is a wall, and the surface is free, with
vacuum outside. The gravity of a face is that of the mass inside it; its mean over a step makes the
sum of kinetic, internal and gravitational energy constant to round-off. Internal energy is a small
difference of large numbers in cold, fast gas, where it may become too low. A lower limit of the
entropy prevents this and adds energy: 8e-6 of the total in Evrard's collapse with 1600 cells, at
its bounce, and 4e-5 with 400.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.exact.finite_volume import COURANT, Cells, limit_changes, reconstruct, solve_faces

FULL = 4.0 * np.pi  # solid angle
# Lower limit of the entropy P/rho^gamma of a cell, over its value at t = 0. Entropy cannot fall, so
# any value up to 1 is correct; with 1, the errors of smooth flow add up to more energy.
LEAST_ENTROPY = 0.5


class Energies(NamedTuple):
    """Energies of the sphere at t = 0 and after each step, each (steps + 1,)."""

    time: np.ndarray
    kinetic: np.ndarray
    internal: np.ndarray
    gravitational: np.ndarray

    @property
    def total(self) -> np.ndarray:
        return self.kinetic + self.internal + self.gravitational


def evolve(cells: Cells, gamma: float, time: float, G: float = 1.0) -> tuple[Cells, Energies]:
    """Return the cells after `time`, and the energies of all steps.

    cells: shells from r = 0 outwards; G: gravitational constant, 0 for gas without gravity. Raises
    ValueError if the first face is not at 0, or if a density or pressure is not positive.
    """
    faces = np.array(cells.faces, dtype=float)
    state = np.array([cells.density, cells.velocity, cells.pressure], dtype=float)
    if faces[0] != 0.0 or not (state[0].min() > 0.0 and state[2].min() > 0.0):
        raise ValueError("expected a first face at 0, positive density and pressure in every cell")
    rows = _evolve(faces, state, float(gamma), float(G), float(time))
    return Cells(faces, *state), Energies(*rows.T)


@njit(**COMPILED)
def _evolve(faces, state, gamma, G, end):
    """Advance faces (n + 1) and state (3, n) in place; return the rows of `Energies`."""
    n = state.shape[1]
    mass = FULL / 3.0 * (faces[1:] ** 3 - faces[:-1] ** 3) * state[0]
    attraction = np.zeros(n + 1)  # G times the mass inside each face
    attraction[1:] = G * np.cumsum(mass)
    least = LEAST_ENTROPY * state[2] / state[0] ** gamma
    change, rate = np.empty((3, n)), np.empty((3, n))
    lower, upper = np.empty((3, n)), np.empty((3, n))  # states on both faces of each cell
    speed, push, pull = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1)  # of each face
    moved = np.zeros(n + 1)
    rows, count, time = np.empty((1024, 4)), 0, 0.0
    while True:
        if count == rows.shape[0]:
            rows = np.concatenate((rows, np.empty_like(rows)))
        rows[count, 0] = time
        _sum_energies(faces, state, mass, attraction, gamma, rows[count, 1:])
        count += 1
        if time >= end:
            return rows[:count]
        dt = min(_longest_step(faces, state, attraction, gamma), end - time)
        time = time + dt if dt < end - time else end
        limit_changes(state, True, False, change)
        _rates(faces, state, attraction, gamma, change, rate)
        reconstruct(state, change, rate, 0.5 * dt, lower, upper)
        solve_faces(lower, upper, gamma, True, False, speed, push)
        _free_surface(upper[:, n - 1], gamma, speed, push)
        for i in range(1, n + 1):
            moved[i] = faces[i] + dt * speed[i]
            # the mean over the step: times the distance moved, it is the change of G M/r
            pull[i] = -attraction[i] / (faces[i] * moved[i])
        _update(faces, moved, state, mass, least, gamma, dt, speed, push, pull)
        faces[:] = moved


@njit(**COMPILED)
def _longest_step(faces, state, attraction, gamma):
    """Return the longest time step, in which waves, gas and free fall cross part of a cell."""
    n, dt = state.shape[1], np.inf
    for i in range(n):
        inner = state[1, i - 1] if i > 0 else -state[1, 0]
        closing = max(0.0, inner - state[1, min(i + 1, n - 1)])
        c = np.sqrt(gamma * state[2, i] / state[0, i])
        width, fall = faces[i + 1] - faces[i], attraction[i + 1] / faces[i + 1] ** 2
        dt = min(dt, COURANT * min(width / (c + closing), np.sqrt(2.0 * width / fall)))
    return dt


@njit(**COMPILED)
def _rates(faces, state, attraction, gamma, change, rate):
    """Set the rates of change (3, n) of density, velocity and pressure of the moving cells."""
    for i in range(state.shape[1]):
        a, b = faces[i], faces[i + 1]
        v, half = state[1, i], 0.5 * change[1, i]
        divergence = 3.0 * (b * b * (v + half) - a * a * (v - half)) / (b**3 - a**3)
        inner = attraction[i] / (a * a) if i > 0 else 0.0
        rate[0, i] = -state[0, i] * divergence
        rate[1, i] = -change[2, i] / (state[0, i] * (b - a))
        rate[1, i] -= 0.5 * (inner + attraction[i + 1] / (b * b))
        rate[2, i] = -gamma * state[2, i] * divergence


@njit(**COMPILED)
def _free_surface(inner, gamma, speed, push):
    """Set velocity and pressure of the surface: a weak rarefaction down to no pressure."""
    push[-1] = 0.0
    speed[-1] = inner[1] + np.sqrt(inner[2] / (gamma * inner[0]))  # v + P/(rho c)


@njit(**COMPILED)
def _update(faces, moved, state, mass, least, gamma, dt, speed, push, pull):
    """Advance state (3, n) over a step in which the faces move to `moved` (eqs 265-268)."""
    for i in range(mass.size):
        a, b, a_end, b_end = faces[i], faces[i + 1], moved[i], moved[i + 1]
        v, per_mass = state[1, i], FULL * dt / mass[i]
        energy = state[2, i] / ((gamma - 1.0) * state[0, i]) + 0.5 * v * v
        work = push[i + 1] * speed[i + 1] * _mean_square(b, b_end)
        work -= push[i] * speed[i] * _mean_square(a, a_end)
        energy -= per_mass * work
        energy += 0.5 * dt * (pull[i] * speed[i] + pull[i + 1] * speed[i + 1])
        v -= per_mass * _mean_square(a, b) * (push[i + 1] - push[i])
        v += 0.5 * dt * (pull[i] + pull[i + 1])
        density = mass[i] / (FULL / 3.0 * (b_end**3 - a_end**3))
        pressure = (gamma - 1.0) * density * (energy - 0.5 * v * v)
        state[0, i], state[1, i] = density, v
        state[2, i] = max(pressure, least[i] * density**gamma)


@njit(**COMPILED)
def _mean_square(a, b):
    """Return the mean of r^2 between a and b, which times b - a is a third of b^3 - a^3."""
    return (a * a + a * b + b * b) / 3.0


@njit(**COMPILED)
def _sum_energies(faces, state, mass, attraction, gamma, found):
    """Set `found` (3) to kinetic, internal and gravitational energy.

    Each face carries half the mass of the cells on its two sides.
    """
    n = mass.size
    found[:] = 0.0
    for i in range(n):
        found[0] += 0.5 * mass[i] * state[1, i] ** 2
        found[1] += mass[i] * state[2, i] / ((gamma - 1.0) * state[0, i])
        carried = 0.5 * (mass[i] + (mass[i + 1] if i + 1 < n else 0.0))
        found[2] -= carried * attraction[i + 1] / faces[i + 1]
