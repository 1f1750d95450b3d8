"""Hydrostatic square: dense gas at rest in thin gas of the same pressure. Nothing should happen.

Saitoh & Makino (2013), ApJ 768, 44, section 5.4. A scheme whose pressure jumps at a contact pulls
on the boundary like a surface tension and rounds the square.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from sph.problems import base
from sph.problems.base import only
from sph.problems.support.lattice import grid

_SHARED = base.Problem.model_fields

DENSITY = (1.0, 4.0)  # outside, inside: spacings of particles of one mass are 2 to 1
PRESSURE = 2.5
HALF = 0.25  # half the side of the square


class Problem(base.Problem):
    """A dense square in pressure balance with the thin gas around it."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 8.0,
        "output.interval": 1.0,
    }
    profiled: ClassVar = False
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-4, "gas that hardly moves: kinetic energy stays below some 1e-3 of the whole"
        )
    }

    name: Literal["square"] = "square"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 1792
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"], only([-0.5, 0.5])] = (
        Field(default=[-0.5, 0.5])
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="of both axes")

    def initial(self, eos) -> base.InitialState:
        """Particles of one mass on two cubic lattices; those of the square come first."""
        cells = self._cells()
        inside = self._dense_lattice()
        around = grid(self.box, "cubic", (cells, cells))
        around = around[:, np.abs(around).max(axis=0) > HALF]
        position = np.hstack([inside, around])
        n = position.shape[1]
        mass = np.full(n, DENSITY[0] / cells**2)
        state = self.exact(eos, 0.0, position)
        return base.InitialState(position, state["velocity"], mass, state["internal_energy"])

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """The initial state for ever, at any (D, N) positions."""
        is_inside = np.abs(position).max(axis=0) < HALF
        density = np.where(is_inside, *DENSITY[::-1])
        pressure = np.full(is_inside.size, PRESSURE)
        return {
            "density": density,
            "velocity": np.zeros_like(position),
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Shape of the dense gas.

        squareness: sum r^4 cos 4 phi / sum r^4 of the dense particles, relative to that of a
        square: 1 as long as it is one, 0 for a disc, negative for a diamond, and above 1 where the
        sides are drawn in. dense_outside: the share of them that is outside the square, 0.09 for a
        disc. The error of the internal energy, which particles carry with them, tells the same: it
        is 2.8 times the area that holds the wrong gas.
        """
        dense = particles.position[:, particles.id <= self._cells() ** 2]
        outside = np.abs(dense).max(axis=0) > HALF
        start = _fourfold(self._dense_lattice())
        return {
            "squareness": _fourfold(dense) / start,
            "dense_outside": float(outside.mean()),
        }

    def _cells(self) -> int:
        """Cells of the outer lattice along each axis, 7/4 of whose square are n particles.

        A multiple of 4, so that the square fits whole cells of either lattice.
        """
        return 4 * max(2, round(np.sqrt(self.n / 1.75) / 4))

    def _dense_lattice(self) -> np.ndarray:
        cells = self._cells()
        return grid(np.array([[-HALF, HALF]] * 2), "cubic", (cells, cells))


def _fourfold(position: np.ndarray) -> float:
    """Sum of r^4 cos 4 phi over that of r^4, of (2, N) positions."""
    x, y = position
    return float((x**4 - 6.0 * x**2 * y**2 + y**4).sum() / ((x**2 + y**2) ** 2).sum())
