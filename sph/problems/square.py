"""Steady-state test: a square of dense gas at rest in thin gas of equal pressure.

Saitoh & Makino (2013), ApJ 768, 44, section 5.4. A scheme with a pressure error at contacts has a
spurious surface tension, which makes the square round.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from sph.problems import base
from sph.problems.base import only
from sph.problems.support.lattice import grid
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

DENSITY = (1.0, 4.0)  # outside, inside: with equal masses the spacings are 2 to 1
PRESSURE = 2.5
HALF = 0.25  # half the side of the square


class Problem(base.Problem):
    """A dense square in pressure equilibrium with thin gas: a steady-state test."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 8.0,
        "output.interval": 1.0,
    }
    profiled: ClassVar = False
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-4, "nearly at rest: kinetic energy stays below about 1e-3 of the total"
        )
    }
    quantities: ClassVar = {
        "squareness": Quantity(
            "sum of r^4 cos 4 phi over the sum of r^4 of the dense particles, relative to a "
            "square: 1 for a square, 0 for a disc, negative for a diamond"
        ),
        "dense_outside": Quantity(
            "fraction of the dense particles outside the initial square; 0.09 for a disc"
        ),
    }
    title: ClassVar = "square at rest"

    name: Literal["square"] = "square"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 1792
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"], only([-0.5, 0.5])] = (
        Field(default=[-0.5, 0.5])
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="boundary of both axes")

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass on two cubic lattices, those of the square first."""
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
        """Return the initial state at (D, N) positions, which is steady."""
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
        """Return squareness and dense_outside, which describe the shape of the dense gas.

        squareness: sum r^4 cos 4 phi / sum r^4 over the dense particles, relative to that of a
        square: 1 for a square, 0 for a disc, negative for a diamond, above 1 for concave sides.
        dense_outside: fraction of the dense particles outside the initial square, 0.09 for a disc.
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
    """Return sum r^4 cos 4 phi / sum r^4 of (2, N) positions."""
    x, y = position
    return float((x**4 - 6.0 * x**2 * y**2 + y**4).sum() / ((x**2 + y**2) ** 2).sum())
