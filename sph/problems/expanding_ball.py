"""Free expansion of a ball of gas into vacuum, which converts all internal energy to motion.

The density falls to zero at the surface in such a way that the expansion is self-similar
(Ovsyannikov 1956; Dyson 1968; see `sph.exact.expanding_ball`).
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from sph import quantity as units
from sph.exact import expanding_ball
from sph.problems import base
from sph.problems.support import lattice as placement
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

KEPT = 0.8  # of the radius: errors are averaged inside, where the density is above a fifth


class Problem(base.Problem):
    """A ball of gas that expands self-similarly from rest into vacuum."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "physics.C": 0.1,
        "physics.max_support": 10.0,  # support radii grow beyond the initial ball
        "time.end": 5.0,
        "output.interval": 1.0,
    }
    ideal_gas: ClassVar = True
    radial: ClassVar = True
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "the leapfrog with about 60 steps: 7e-4 at C = 0.1, and proportional to C squared"
        ),
        "front_speed_over_bound": base.Limit(
            1.0, "gas expands from rest at most at 2 c/(gamma - 1)"
        ),
        "kinetic_share_error": base.Limit(
            0.002, "measured: 4e-4; viscosity would delay the conversion to motion"
        ),
    }
    quantities: ClassVar = {
        "radius": Quantity("largest distance of a particle from the centre", units.LENGTH),
        "radius_exact": Quantity("exact radius of the ball", units.LENGTH),
        "front_speed": Quantity("largest outward velocity of a particle", units.VELOCITY),
        "front_speed_exact": Quantity("exact outward velocity of the surface", units.VELOCITY),
        "front_speed_over_bound": Quantity(
            "front_speed over 2 c/(gamma - 1), the bound for expansion from rest, with c at the "
            "centre at t = 0"
        ),
        "kinetic_share": Quantity("kinetic energy over the sum of kinetic and internal energy"),
        "kinetic_share_exact": Quantity("exact value of kinetic_share"),
        "kinetic_share_error": Quantity("|kinetic_share - kinetic_share_exact|"),
    }

    name: Literal["expanding_ball"] = "expanding_ball"
    dimension: Annotated[int, _SHARED["dimension"]] = 3
    n: Annotated[int, _SHARED["n"]] = 4200
    domain: list[float] | list[list[float]] = Field(
        default=[-1.0, 1.0],
        description="ends of the box: [lo, hi] for all axes, or a list with one [lo, hi] per axis; "
        "the ball is centred and reaches the nearest ends",
    )
    boundary: Literal["open"] = Field(default="open", description="vacuum outside, on all sides")
    density: float = Field(default=1.0, gt=0.0, description="density at the centre at t = 0")
    pressure: float = Field(default=1.0, gt=0.0, description="pressure at the centre at t = 0")
    lattice: Literal["cubic", "hexagonal", "bcc", "relaxed"] = Field(
        default="cubic",
        description='initial lattice: "cubic", "hexagonal" (2-D), "bcc" (3-D), or "relaxed", a '
        "disordered glass; it is stretched along the radius to give the density",
    )

    @field_validator("lattice")
    @classmethod
    def _exists(cls, kind, known):
        return placement.checked(kind, known.data.get("dimension"))

    @property
    def radius(self) -> float:
        """Radius of the ball at t = 0."""
        return float((self.box[:, 1] - self.box[:, 0]).min() / 2)

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass, from a ball of a lattice that is stretched radially."""
        dimension = self.dimension
        cube = np.array([[-1.0, 1.0]] * dimension)
        sites = max(1, round(self.n * placement.CUBE_OVER_BALL[dimension - 1]))
        position = placement.fill(cube, sites, self.lattice, even=True)
        distance = np.sqrt((position**2).sum(axis=0))
        within = (distance < 1.0) & (distance > 0.0)
        position, distance = position[:, within], distance[within]
        stretched = expanding_ball.radius_of_mass(distance**dimension, eos.gamma, dimension)
        position = self.centre[:, None] + self.radius * position * (stretched / distance)
        n = distance.size
        mass = expanding_ball.mass(self.density, self.radius, eos.gamma, dimension)
        energy = self._central_energy(eos) * (1.0 - stretched**2)
        return base.InitialState(position, np.zeros_like(position), np.full(n, mass / n), energy)

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the self-similar expansion at (D, N) positions; vacuum outside its radius."""
        radius, speed = self._radius(eos, time)
        offset = position - self.centre[:, None]
        inside = np.maximum(0.0, 1.0 - (offset**2).sum(axis=0) / radius**2)
        thinning = (self.radius / radius) ** self.dimension
        density = self.density * thinning * inside ** (1.0 / (eos.gamma - 1.0))
        energy = self._central_energy(eos) * thinning ** (eos.gamma - 1.0) * inside
        return {
            "density": density,
            "velocity": np.where(inside > 0.0, speed / radius * offset, 0.0),
            "pressure": eos.pressure(density, energy),
            "internal_energy": energy,
        }

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return the inner part; in the outer part kernels reach into the vacuum."""
        reach = KEPT * self._radius(eos, time)[0]
        offset = position - self.centre[:, None]
        return (offset**2).sum(axis=0) < reach**2, f"r < {reach:.4g} around the centre"

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return radius, front_speed and kinetic_share.

        front_speed: largest outward velocity; kinetic_share: kinetic energy over the sum of kinetic
        and internal energy, which tends to 1.
        """
        offset = particles.position - self.centre[:, None]
        distance = np.sqrt((offset**2).sum(axis=0))
        outward = (particles.velocity * offset).sum(axis=0) / np.where(distance > 0, distance, 1)
        kinetic = 0.5 * (particles.mass * (particles.velocity**2).sum(axis=0)).sum()
        internal = (particles.mass * particles.internal_energy).sum()
        return {
            "radius": float(distance.max()),
            "front_speed": float(outward.max()),
            "kinetic_share": float(kinetic / (kinetic + internal)),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the exact values and errors of the numbers of `report`.

        front_speed_over_bound: front_speed over 2 c/(gamma - 1), with c at the centre at t = 0,
        which is the largest speed that expansion from rest can reach.
        """
        found = self.report(eos, time, particles, pressure)
        radius, speed = self._radius(eos, time)
        exact = expanding_ball.kinetic_share(radius, self.radius, eos.gamma, self.dimension)
        bound = 2.0 * self._sound_speed(eos) / (eos.gamma - 1.0)
        return {
            "radius_exact": radius,
            "front_speed_exact": speed,
            "front_speed_over_bound": found["front_speed"] / bound,
            "kinetic_share_exact": exact,
            "kinetic_share_error": abs(found["kinetic_share"] - exact),
        }

    def _central_energy(self, eos) -> float:
        return eos.internal_energy(self.density, self.pressure)

    def _sound_speed(self, eos) -> float:
        return float(eos.sound_speed(self.density, self.pressure))

    def _radius(self, eos, time: float) -> tuple[float, float]:
        return expanding_ball.radius(
            time, self.radius, self._sound_speed(eos), eos.gamma, self.dimension
        )
