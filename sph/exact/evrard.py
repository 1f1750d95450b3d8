"""Reference solution of Evrard's collapse, in units of G, M and R.

Shells of equal mass, with the density 1/(2 pi r) and one internal energy, evolved by `sphere`.
"""

from functools import lru_cache

import numpy as np

from sph.exact import sphere
from sph.exact.finite_volume import Cells

# The extremes of the energies are within 0.1 % of those for ever more shells (0.2 % with half as
# many). It takes half a CPU second for each unit of time.
SHELLS = 1600
# The reference is computed for these only: with a smaller gamma the centre collapses so far that
# steps become too short (without end below 4/3), and costs grow with time.
LEAST_GAMMA, LAST_TIME = 1.6, 10.0
# Least jump of the velocity over a shock whose radius is compared. The shock of the bounce has 1.3
# when it forms, and 2.4 later; sound waves and other shocks have 0.7 at most.
LEAST_JUMP = 1.0
WIDTH = 5  # shells on either side of the steepest velocity, over which a shock is smeared


def start(shells: int, gamma: float, energy: float) -> Cells:
    """Return shells of equal mass at t = 0, with the internal energy `energy` per unit mass."""
    inside = np.linspace(0.0, 1.0, shells + 1)
    faces = np.sqrt(inside)
    density = np.diff(inside) / (4.0 * np.pi / 3.0 * np.diff(faces**3))
    return Cells(faces, density, np.zeros(shells), (gamma - 1.0) * density * energy)


@lru_cache(maxsize=16)
def solve(gamma: float, energy: float, time: float) -> tuple[Cells, sphere.Energies]:
    """Return the shells at `time`, and the energies until then. Results are kept: do not write."""
    return sphere.evolve(start(SHELLS, gamma, energy), gamma, time)


def radius_of_mass(cells: Cells, share) -> np.ndarray:
    """Return the radii inside which these shares of the mass are."""
    inside = np.concatenate([[0.0], np.cumsum(cells.density * np.diff(cells.faces**3))])
    return np.interp(share, inside / inside[-1], cells.faces)


def shock(cells: Cells) -> float | None:
    """Return the radius of the shock, where velocity is steepest, or None if its jump is small."""
    centres = 0.5 * (cells.faces[1:] + cells.faces[:-1])
    steepest = int(np.argmin(np.diff(cells.velocity) / np.diff(centres)))
    behind = cells.velocity[max(0, steepest - WIDTH)]
    ahead = cells.velocity[min(centres.size - 1, steepest + 1 + WIDTH)]
    if behind - ahead < LEAST_JUMP:
        return None
    return float(cells.faces[steepest + 1])


def extremes(times, kinetic, internal, gravitational) -> dict[str, tuple[float, float]]:
    """Return time and value of the extremes of energies at `times`, each (M,).

    potential_minimum, internal_maximum: of gravitational and internal energy; kinetic_maximum:
    before the minimum of the first. Extremes at an end of the times are left out.
    """
    bounce = int(np.argmin(gravitational))
    if bounce == times.size - 1:
        return {}
    rows = {
        "potential_minimum": (gravitational, bounce),
        "internal_maximum": (internal, int(np.argmax(internal))),
        "kinetic_maximum": (kinetic, int(np.argmax(kinetic[: bounce + 1]))),
    }
    return {
        name: _vertex(times, values, k)
        for name, (values, k) in rows.items()
        if 0 < k < times.size - 1
    }


def _vertex(times, values, k: int) -> tuple[float, float]:
    """Return time and value of the vertex of the parabola through rows k - 1, k and k + 1."""
    near = slice(k - 1, k + 2)
    a, b, c = np.polyfit(times[near] - times[k], values[near], 2)
    return float(times[k] - b / (2.0 * a)), float(c - b * b / (4.0 * a))
