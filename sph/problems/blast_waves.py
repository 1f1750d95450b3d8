"""Two blast waves that collide between reflecting walls.

Woodward & Colella (1984), J. Comput. Phys. 54, 115. High pressures of 1000 and 100 at the two ends
of a tube of cold gas drive strong shocks, which are reflected by the walls and collide at
t = 0.028. Shocks and contacts are then only a few particles apart. There is no exact solution:
errors are computed against a Lagrangian finite-volume solution.
"""

from functools import lru_cache
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from sph import quantity as units
from sph.eos import is_gamma_law
from sph.exact import finite_volume
from sph.problems import base
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

DENSITY = 1.0
DIAPHRAGMS = (0.1, 0.9)
PRESSURES = (1000.0, 0.01, 100.0)
# Cells of the reference, a multiple of 10, so that the diaphragms are faces. Its relative L1 error
# of density is 0.0012 at t = 0.038, measured against 25600 cells (0.0026 with 3200, 0.0046 with
# 1600). The error of 400 particles is 0.034 against this reference, 0.037 against 25600 cells.
CELLS = 6400


class Problem(base.Problem):
    """Two blast waves from the ends of a closed tube, which collide."""

    defaults: ClassVar = {
        "physics.gamma": 1.4,
        "physics.alpha": 1.0,
        "time.end": 0.038,
        "output.interval": 0.0095,
    }
    truth: ClassVar = finite_volume.TRUTH
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-4, "as in the shock tubes; measured: 2e-5"),
        "density_L1_relative": base.Limit(
            0.05, "measured: 0.034, and 0.060 with the averaged gradient of grad_h"
        ),
    }
    quantities: ClassVar = {
        "peak_density": Quantity("largest density of a particle", units.DENSITY),
        "density_L1_relative": Quantity("sum of V |error of rho| over the sum of V rho, exact"),
    }
    title: ClassVar = "colliding blast waves"

    name: Literal["blast_waves"] = "blast_waves"
    dimension: Literal[1] = Field(default=1, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 400
    domain: list[float] = Field(
        default=[0.0, 1.0], description="[0, 1], as published; no other domain is allowed"
    )
    boundary: Literal["mirror"] = Field(default="mirror", description="reflecting walls")

    @field_validator("domain")
    @classmethod
    def _is_published(cls, ends):
        if ends != [0.0, 1.0]:
            raise ValueError(f"{ends}: expected [0, 1], the only domain of this problem")
        return ends

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass and spacing, at rest."""
        x = (np.arange(self.n) + 0.5) / self.n
        energy = eos.internal_energy(DENSITY, _pressure(x))
        position = x[None]
        mass = np.full(self.n, DENSITY / self.n)
        density = {"density": np.full(self.n, DENSITY)}
        return base.InitialState(position, np.zeros_like(position), mass, energy, density)

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Return the reference solution at (D, N) positions; None if the gas has no gamma law."""
        if not is_gamma_law(eos):
            return None
        density, speed, pressure = _reference(eos, time).at(position[0])
        return {
            "density": density,
            "velocity": speed[None],
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        return {"peak_density": float(particles.density.max())}

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return density_L1_relative: sum V |error| / sum V rho."""
        exact = self.exact(eos, time, particles.position)
        if exact is None:
            return {}
        volume = particles.mass / particles.density
        error = volume * np.abs(particles.density - exact["density"])
        return {"density_L1_relative": float(error.sum() / (volume * exact["density"]).sum())}


def _pressure(x: np.ndarray) -> np.ndarray:
    """Return the pressure (N,) at t = 0."""
    return np.select([x < DIAPHRAGMS[0], x < DIAPHRAGMS[1]], PRESSURES[:2], PRESSURES[2])


@lru_cache(maxsize=16)
def _reference(eos, time: float) -> finite_volume.Cells:
    faces = np.linspace(0.0, 1.0, CELLS + 1)
    start = finite_volume.Cells(
        faces, np.full(CELLS, DENSITY), np.zeros(CELLS), _pressure(0.5 * (faces[1:] + faces[:-1]))
    )
    return finite_volume.evolve(start, eos, time, walls=(True, True))
