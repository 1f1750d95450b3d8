"""Point explosion: energy released at the centre of cold gas (Sedov 1946; Taylor 1950)."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from sph import quantity as units
from sph.errors import ConfigError
from sph.exact import sedov
from sph.problems import base
from sph.problems.support import lattice as placement
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

# Largest ratio of background pressure to pressure behind the shock at which the gas counts as cold.
# The compression is reduced by 4 gamma/(gamma^2 - 1) times that ratio: 0.4 % at gamma = 5/3.
COLD = 1e-3


class Problem(base.Problem):
    """A blast wave from a point in uniform, cold gas."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 3.0,
        "time.end": 0.05,
        "output.interval": 0.01,
    }
    ideal_gas: ClassVar = True
    radial: ClassVar = True
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "measured: 1.2e-4 with the time step limit u/|du/dt|, 1.3e-3 without"
        ),
        "momentum_radius_error": base.Limit(
            0.03,
            "measured: 2.7 % at 32^3 and alpha = 3, with a shock a quarter of the radius wide; "
            "0.7 % at 64^3; 0.15 % at 32^3 and alpha = 1.5",
        ),
    }
    quantities: ClassVar = {
        "peak_density": Quantity("largest density of a particle", units.DENSITY),
        "peak_density_exact": Quantity("exact density behind the shock", units.DENSITY),
        "peak_radius": Quantity(
            "distance of the densest particle from the explosion", units.LENGTH
        ),
        "peak_radius_exact": Quantity("exact radius of the shock", units.LENGTH),
        "momentum_radius": Quantity("sum of m v_r r over the sum of m v_r", units.LENGTH),
        "momentum_radius_exact": Quantity("exact value of momentum_radius", units.LENGTH),
        "momentum_radius_error": Quantity(
            "relative error, absolute: momentum_radius over momentum_radius_exact, minus 1"
        ),
    }

    name: Literal["point_explosion"] = "point_explosion"
    dimension: Annotated[int, _SHARED["dimension"]] = 3
    n: Annotated[int, _SHARED["n"]] = 32768
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[-0.5, 0.5]
    )
    boundary: Annotated[base.Boundary | list[base.Boundary], _SHARED["boundary"]] = "periodic"
    density: float = Field(default=1.0, gt=0.0, description="mass per volume")
    background_pressure: float = Field(default=1e-6, gt=0.0, description="pressure of the cold gas")
    energy: float = Field(default=1.0, gt=0.0, description="energy released at the centre")
    energy_particles: int = Field(
        default=32,
        ge=1,
        description="number of particles nearest the centre that share the energy equally; if 1, "
        "the lattice is shifted so that this particle is at the centre",
    )
    lattice: Literal["cubic", "hexagonal", "bcc", "relaxed"] = Field(
        default="cubic",
        description='initial lattice: "cubic", "hexagonal" (2-D), "bcc" (3-D), or "relaxed", a '
        "disordered glass; the number of cells along each axis is even, so that the centre is a "
        "corner of cells",
    )

    @field_validator("lattice")
    @classmethod
    def _exists(cls, kind, known):
        return placement.checked(kind, known.data.get("dimension"))

    @property
    def gamma_below(self) -> float:
        return sedov.HOLLOW if self.dimension == 3 else math.inf

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass at rest, of which those nearest the centre are hot.

        Raises ConfigError if there are fewer particles than `energy_particles`.
        """
        position = placement.fill(self.box, self.n, self.lattice, even=True)
        if self.energy_particles == 1:
            position = self._centred(position)
        n = position.shape[1]
        if n < self.energy_particles:
            raise ConfigError(
                f"problem.energy_particles = {self.energy_particles}: expected at most {n}, the "
                "number of particles"
            )
        mass = self.density * np.prod(self.box[:, 1] - self.box[:, 0]) / n
        energy = np.full(n, eos.internal_energy(self.density, self.background_pressure))
        energy[self._nearest(position)] += self.energy / (self.energy_particles * mass)
        still, density = np.zeros_like(position), {"density": np.full(n, self.density)}
        return base.InitialState(position, still, np.full(n, mass), energy, density)

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the self-similar blast at (D, N) positions, with the cold gas ahead of it."""
        offset, radius = self._from_centre(position)
        density = np.full(radius.size, self.density)
        pressure = np.full(radius.size, self.background_pressure)
        speed = np.zeros(radius.size)
        if time > 0.0:
            density, speed, pressure = sedov.solve(
                radius, time, *self._blast(eos), self.background_pressure
            )
        in_gas = np.where(density > 0.0, density, 1.0)  # the density is 0 at the centre
        return {
            "density": density,
            "velocity": speed * offset / np.where(radius > 0.0, radius, 1.0),
            "pressure": pressure,
            "internal_energy": eos.internal_energy(in_gas, pressure),
        }

    def exact_ends(self, eos) -> tuple[float, str]:
        """Return when the shock reaches the nearest face, or the gas ahead no longer is cold.

        R ~ t^(2/(D + 2)), and the pressure behind the shock, 2 rho v^2/(gamma + 1), ~ R^-D.
        """
        power = 2.0 / (self.dimension + 2)
        first = sedov.shock_radius(*self._blast(eos), 1.0)
        at_face = (self._nearest_face / first) ** (1.0 / power)
        if "open" in self.boundaries:
            # gas flows out at open faces, which send a wave inward at the speed of sound
            sound = float(eos.sound_speed(self.density, self.background_pressure))
            at_face = (max(self._nearest_face - sound * at_face, 0.0) / first) ** (1.0 / power)
        behind = 2.0 / (eos.gamma + 1.0) * self.density * (power * first) ** 2  # at t = 1
        cold = (COLD * behind / self.background_pressure) ** (1.0 / (self.dimension * power))
        if cold < at_face:
            return cold, (
                "problem.background_pressure, which the exact solution neglects, exceeds "
                f"{COLD:g} of the pressure behind the shock"
            )
        return at_face, "the shock reaches the nearest face of the domain"

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return r < 1.2 times the shock radius, at most up to the nearest face of the box."""
        if time == 0.0:
            return super().error_region(eos, time, position)
        shock = sedov.shock_radius(*self._blast(eos), time)
        reach = min(1.2 * shock, self._nearest_face)
        return self._from_centre(position)[1] < reach, f"r < {reach:.4g} around the centre"

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return peak_density, peak_radius and momentum_radius.

        `peak_radius` is that of the densest particle. `momentum_radius` is
        sum m v_r r / sum m v_r, which is insensitive to noise.
        """
        if time == 0.0:
            return {}
        radius = self._from_centre(particles.position)[1]
        densest = int(np.argmax(particles.density))
        figures = {
            "peak_density": float(particles.density[densest]),
            "peak_radius": float(radius[densest]),
        }
        found = self._momentum_radius(particles)
        return figures if found is None else figures | {"momentum_radius": found}

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the exact values of `report`, and the relative error of `momentum_radius`."""
        if time == 0.0:
            return {}
        exact = sedov.momentum_weighted_radius(*self._blast(eos), time)
        figures = {
            "momentum_radius_exact": exact,
            "peak_density_exact": self.density * (eos.gamma + 1.0) / (eos.gamma - 1.0),
            "peak_radius_exact": sedov.shock_radius(*self._blast(eos), time),
        }
        found = self._momentum_radius(particles)
        error = {} if found is None else {"momentum_radius_error": abs(found / exact - 1.0)}
        return figures | error

    def _momentum_radius(self, particles) -> float | None:
        """Return sum m v_r r / sum m v_r, or None if the total of m v_r is not positive."""
        offset, radius = self._from_centre(particles.position)
        # v_r r = v . offset; at the very centre both it and v_r are 0
        moment = particles.mass * (particles.velocity * offset).sum(axis=0)
        momentum = (moment / np.where(radius > 0.0, radius, 1.0)).sum()
        return float(moment.sum() / momentum) if momentum > 0.0 else None

    @property
    def _nearest_face(self) -> float:
        """Distance of the nearest face from the centre."""
        return float((self.box[:, 1] - self.box[:, 0]).min() / 2)

    def _blast(self, eos) -> tuple[float, float, float, int]:
        """Return energy, density, gamma and dimension, the arguments of `sph.exact.sedov`."""
        return self.energy, self.density, eos.gamma, self.dimension

    def _from_centre(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the offset (D, N) from the centre of the box, and its length (N,)."""
        offset = position - self.box.mean(axis=1)[:, None]
        return offset, np.sqrt((offset**2).sum(axis=0))

    def _centred(self, position: np.ndarray) -> np.ndarray:
        """Return the lattice shifted by less than a spacing so that a particle is at the centre.

        Particles that leave the box are wrapped to the other side.
        """
        moved = position - self._from_centre(position)[0][:, self._nearest(position)]
        low, length = self.box[:, :1], np.diff(self.box)
        return low + np.mod(moved - low, length)

    def _nearest(self, position: np.ndarray) -> np.ndarray:
        """Return indices of the `energy_particles` nearest the centre; ties go by index."""
        distance = self._from_centre(position)[1]
        # shells of a lattice lie farther apart than this; equal distances differ by round-off
        in_shells = np.round(distance / distance.max(), 9)
        return np.argsort(in_shells, kind="stable")[: self.energy_particles]
