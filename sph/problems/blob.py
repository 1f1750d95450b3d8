"""A dense cloud in a supersonic wind, in pressure equilibrium with the wind.

Agertz et al. (2007), MNRAS 380, 963. In grid codes the Kelvin-Helmholtz instability destroys the
cloud within about two growth times. In classical SPH part of the cloud survives, because contacts
have a spurious surface tension.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from sph.problems import base
from sph.problems.support import lattice as placement
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

DENSITY = PRESSURE = 1.0  # of the wind
LENGTH = 4.0  # of the box along the wind, in widths of the box
# Gas counts as cloud above this fraction of the initial cloud density and below this fraction of
# the wind's temperature (Agertz et al., section 3.1).
STILL_DENSE, STILL_COLD = 0.64, 0.9


class Problem(base.Problem):
    """A dense, cold cloud in a supersonic wind along x: how much of the cloud survives."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 7.0,
        "output.interval": 1.0,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "two thirds of the energy is kinetic energy of the wind, part of which is heated"
        ),
        "cloud_mass_fraction": base.Limit(1.05, "heated and expanded gas must not count as cloud"),
        "cloud_velocity": base.Limit(
            1.0, "the wind cannot accelerate the cloud beyond the wind's speed"
        ),
    }
    quantities: ClassVar = {
        "cloud_mass_fraction": Quantity(
            "mass of dense, cold gas over the initial mass of the cloud"
        ),
        "cloud_velocity": Quantity(
            "mean velocity along x of the particles of the initial cloud, over the wind speed"
        ),
        "growth_times": Quantity("time in units of the growth time of Kelvin-Helmholtz waves"),
    }
    title: ClassVar = "cloud in a wind"

    name: Literal["blob"] = "blob"
    dimension: Literal[2, 3] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 10000
    domain: list[float] = Field(
        default=[-5.0, 5.0],
        min_length=2,
        max_length=2,
        description="[lo, hi] across the wind; along the wind, the box also begins at lo and is "
        "four times as long",
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="boundary of all axes")
    radius: float = Field(
        default=1.0,
        gt=0.0,
        description="radius of the cloud; its centre is half a width of the box from lo",
    )
    density_ratio: float = Field(
        default=10.0, gt=1, le=1e6, description="density of the cloud divided by that of the wind"
    )
    mach: float = Field(default=2.7, gt=0.0, description="Mach number of the wind")

    @model_validator(mode="after")
    def _cloud_fits(self):
        low, high = self.domain
        if 2.0 * self.radius >= high - low > 0.0:
            raise ValueError(
                f"radius = {self.radius}: expected a diameter below the box's width, {high - low:g}"
            )
        return self

    @property
    def box(self) -> np.ndarray:
        low, high = self.domain
        return np.array([[low, low + LENGTH * (high - low)]] + [[low, high]] * (self.dimension - 1))

    @property
    def centre(self) -> np.ndarray:
        """(D,) centre of the cloud at t = 0."""
        return np.full(self.dimension, sum(self.domain) / 2)

    def wind(self, eos) -> float:
        """Return the speed of the wind."""
        return float(self.mach * eos.sound_speed(DENSITY, PRESSURE))

    def growth_time(self, eos) -> float:
        """Return the growth time of a mode as long as the cloud: 1.6 crushing times (eq 3)."""
        return 1.6 * 2.0 * self.radius * float(np.sqrt(self.density_ratio)) / self.wind(eos)

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass on two cubic lattices, those of the cloud first."""
        around = placement.fill(self.box, self._sites(), "cubic")
        mass = DENSITY * np.prod(np.diff(self.box)) / around.shape[1]
        around = around[:, self._distance(around) >= self.radius]
        cloud = self._cloud(mass)
        position = np.hstack([cloud, around])
        state = self.exact(eos, 0.0, position) or {}
        each = np.full(position.shape[1], mass)
        return base.InitialState(position, state["velocity"], each, state["internal_energy"])

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Return the initial state at (D, N) positions; None for t > 0, which has no solution."""
        if time > 0.0:
            return None
        in_cloud = self._distance(position) < self.radius
        density = np.where(in_cloud, self.density_ratio * DENSITY, DENSITY)
        pressure = np.full(density.size, PRESSURE)
        velocity = np.zeros_like(position)
        velocity[0] = np.where(in_cloud, 0.0, self.wind(eos))
        return {
            "density": density,
            "velocity": velocity,
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def diagnostics(self, particles) -> dict[str, float]:
        """Return cloud_mass_fraction: mass of dense, cold gas over the initial mass of the cloud.

        The wind has nine tenths of the particles or more, so the median of u is that of the wind.
        """
        u = particles.internal_energy
        dense = particles.density > STILL_DENSE * self.density_ratio * DENSITY
        cold = u < STILL_COLD * np.median(u)
        unit_ball = (np.pi, 4.0 / 3.0 * np.pi)[self.dimension - 2]
        cloud = self.density_ratio * DENSITY * unit_ball * self.radius**self.dimension
        return {"cloud_mass_fraction": float(particles.mass[dense & cold].sum() / cloud)}

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return cloud_mass_fraction, cloud_velocity and growth_times.

        cloud_velocity: mean velocity along x of the particles that formed the cloud at t = 0, over
        the speed of the wind; growth_times: time in units of `growth_time`.
        """
        count = self._cloud(particles.mass[0]).shape[1]
        velocity = particles.velocity[0, particles.id <= count].mean()
        return self.diagnostics(particles) | {
            "cloud_velocity": float(velocity / self.wind(eos)),
            "growth_times": time / self.growth_time(eos),
        }

    def _distance(self, position: np.ndarray) -> np.ndarray:
        return np.sqrt(((position - self.centre[:, None]) ** 2).sum(axis=0))

    def _sites(self) -> int:
        """Return the sites of the wind's lattice in the whole box, for n particles in total."""
        volume = np.prod(np.diff(self.box))
        cloud = (np.pi, 4.0 / 3.0 * np.pi)[self.dimension - 2] * self.radius**self.dimension
        return max(1, round(self.n / (1.0 + (self.density_ratio - 1.0) * cloud / volume)))

    def _cloud(self, mass: float) -> np.ndarray:
        """Return positions (D, N) in the cloud of particles of that mass; no site at its centre."""
        spacing = (mass / (self.density_ratio * DENSITY)) ** (1.0 / self.dimension)
        half = int(np.ceil(self.radius / spacing))
        cube = half * spacing * np.array([[-1.0, 1.0]] * self.dimension)
        position = self.centre[:, None] + placement.grid(
            cube, "cubic", (2 * half,) * self.dimension
        )
        return position[:, self._distance(position) < self.radius]
