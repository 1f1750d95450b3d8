"""Kelvin-Helmholtz instability of a sharp contact: a dense slab that moves through thin gas.

Price (2008), J. Comput. Phys. 227, 10040.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from sph import quantity as units
from sph.problems import base
from sph.problems.base import only
from sph.problems.support.lattice import grid, unit_cell
from sph.problems.support.shear_mode import mode_amplitude
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

DENSITY = (1.0, 2.0)  # outside, slab
SPEED = (-0.5, 0.5)  # along x
PRESSURE = 2.5
FACE = 0.25  # |y| of both faces of the slab
WAVELENGTH = 1.0 / 6.0
PERTURBATION = 0.025  # amplitude of the velocity along y, and half width of the perturbed bands
# Growth time of the linear mode, lambda (rho1 + rho2) / (sqrt(rho1 rho2) |v1 - v2|)
TAU = WAVELENGTH * sum(DENSITY) / (np.prod(DENSITY) ** 0.5 * abs(SPEED[1] - SPEED[0]))


class Problem(base.Problem):
    """A dense slab moving through gas of half its density, perturbed at one wavelength."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 3.0,
        "time.end": 1.0608,  # 3 TAU
        "output.interval": 0.1768,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "subsonic flow in pressure equilibrium, with less work than in a shock tube"
        )
    }
    quantities: ClassVar = {
        "mode_amplitude": Quantity(
            "amplitude of the mode in the velocity away from the slab", units.VELOCITY
        ),
        "growth_time": Quantity("growth time of the mode in linear theory", units.TIME),
    }
    title: ClassVar = "Kelvin-Helmholtz instability"

    name: Literal["kelvin_helmholtz"] = "kelvin_helmholtz"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 24480
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"], only([-0.5, 0.5])] = (
        Field(default=[-0.5, 0.5])
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="boundary of both axes")
    lattice: Literal["cubic", "hexagonal"] = Field(
        default="hexagonal",
        description='initial lattice, "cubic" or "hexagonal", with separate spacings in the slab '
        "and outside",
    )

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass, on separate lattices in the slab and outside."""
        outside_cells, slab_cells = _layer_cells(self.lattice, self.n)
        slab = grid(np.array([[-0.5, 0.5], [-FACE, FACE]]), self.lattice, slab_cells)
        outside = grid(np.array([[-0.5, 0.5], [FACE, 1.0 - FACE]]), self.lattice, outside_cells)
        outside[1] -= outside[1] >= 0.5  # periodic: the upper half is below the slab
        position = np.hstack([outside, slab])
        is_slab = np.abs(position[1]) < FACE
        n = position.shape[1]
        velocity = np.stack([np.where(is_slab, *SPEED[::-1]), _perturbation(*position)])
        density = np.where(is_slab, *DENSITY[::-1])
        mass = np.full(n, sum(DENSITY) / 2 / n)
        energy = eos.internal_energy(density, np.full(n, PRESSURE))
        return base.InitialState(position, velocity, mass, energy, {"density": density})

    def diagnostics(self, particles) -> dict[str, float]:
        """Return mode_amplitude, of the velocity away from the slab."""
        x, y = particles.position
        outward = np.sign(y) * particles.velocity[1]
        return {"mode_amplitude": mode_amplitude(particles, x, y, outward, WAVELENGTH)}

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        return self.diagnostics(particles) | {"growth_time": float(TAU)}


def _perturbation(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the velocity along y: a sine in a band around each face, of opposite signs."""
    wave = PERTURBATION * np.sin(2.0 * np.pi * (x + 0.5) / WAVELENGTH)
    in_band = np.abs(np.abs(y) - FACE) < PERTURBATION
    return np.where(in_band, -np.sign(y) * wave, 0.0)


def _layer_cells(kind: str, n: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the numbers of cells (along x, along y) outside and in the slab, both 1 by 1/2.

    The slab has exactly twice as many cells, so that all masses are equal. Among the possible
    numbers, those with the least distorted cells and the total nearest to n are chosen. The number
    of rows outside is even, so that no particle lies on y = 1/2.
    """
    cell = unit_cell(kind, 2)
    region = np.array([1.0, 0.5]) / np.array(cell.sides)
    wanted = n / (3.0 * len(cell.sites))  # outside
    ideal = region * np.sqrt(wanted / region.prod())
    columns = _near(ideal[0])[:, None, None]
    slab_columns = _near(np.sqrt(2.0) * ideal[0])[:, None]
    # slab_columns x slab_rows = 2 columns x rows needs rows in steps of slab_columns / their gcd
    step = slab_columns // np.gcd(2 * columns, slab_columns)
    step = np.where(step % 2, 2 * step, step)
    rows = step * np.maximum(1, (ideal[1] / step).astype(int) + np.array([0, 1]))
    slab_rows = 2 * columns * rows // slab_columns
    shape = np.abs(np.log(columns / rows * region[1] / region[0]))
    slab_shape = np.abs(np.log(slab_columns / slab_rows * region[1] / region[0]))
    cost = shape + slab_shape + np.abs(np.log(columns * rows / wanted))
    numbers = np.broadcast_arrays(columns, rows, slab_columns, slab_rows)
    best = [int(one.flat[np.argmin(cost)]) for one in numbers]
    return (best[0], best[1]), (best[2], best[3])


def _near(ideal: float) -> np.ndarray:
    """Return whole numbers within 2 % + 8 of `ideal`, some of which have large common divisors."""
    reach = 8 + int(0.02 * ideal)
    return np.arange(max(1, int(ideal) - reach), int(ideal) + reach + 1)
