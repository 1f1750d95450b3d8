"""Two round clouds of dense gas that collide in thin gas, as a problem of one's own."""

from typing import ClassVar

import numpy as np
from pydantic import Field

from sph.problems import base


class Problem(base.Problem):
    """Two clouds in pressure equilibrium with the gas around them, which approach each other."""

    # Defaults of keys in other tables of the configuration
    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 0.5,
        "output.interval": 0.1,
    }
    profiled: ClassVar = False  # figures show maps

    # Keys of the table [problem]: the five shared ones, and those of this problem
    dimension: int = Field(default=2, ge=2, le=2, description="number of space dimensions")
    n: int = Field(default=4096, ge=64, description="number of particles, on a square lattice")
    domain: list[float] = Field(default=[0.0, 1.0], description="ends of the box along both axes")
    boundary: base.Boundary = Field(default="periodic", description="boundary of both axes")
    radius: float = Field(default=0.1, gt=0, lt=0.25, description="radius of each cloud")
    contrast: float = Field(default=4.0, ge=1, description="density of the clouds; 1 outside")
    speed: float = Field(
        default=1.0, description="speed of each cloud; the speed of sound around it is 1.29"
    )

    def initial(self, eos) -> base.InitialState:
        """Return particles on a lattice; masses follow the density, the pressure is 1."""
        low, high = self.domain
        side = round(self.n**0.5)
        axis = low + (np.arange(side) + 0.5) * (high - low) / side
        position = np.stack([one.ravel() for one in np.meshgrid(axis, axis, indexing="ij")])
        left, right = (self._inside(position, x) for x in (0.3, 0.7))
        density = np.where(left | right, self.contrast, 1.0)
        velocity = np.zeros_like(position)
        velocity[0] = self.speed * (1.0 * left - 1.0 * right)
        mass = density * (high - low) ** 2 / side**2
        return base.InitialState(position, velocity, mass, eos.internal_energy(density, 1.0))

    def diagnostics(self, particles) -> dict[str, float]:
        """Return one more column of the history: the kinetic energy of motion along x."""
        along_x = 0.5 * float(particles.mass @ particles.velocity[0] ** 2)
        return {"kinetic_energy_x": along_x}

    def _inside(self, position: np.ndarray, x: float) -> np.ndarray:
        low, high = self.domain
        centre = low + np.array([[x], [0.5]]) * (high - low)
        return ((position - centre) ** 2).sum(axis=0) < self.radius**2
