"""Uniform gas at rest or in motion, on a lattice or with noise: nothing should happen."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from sph import lattice as placement
from sph.problems import base

_SHARED = base.Problem.model_fields


class Problem(base.Problem):
    """Uniform gas at rest or in uniform motion: the null test."""

    defaults: ClassVar = {
        "physics.gamma": 1.4,
        "physics.alpha": 1.0,
        "time.end": 0.2,
        "output.interval": 0.1,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-10, "on a lattice all forces cancel: round-off of some hundred steps, with room"
        )
    }

    name: Literal["uniform"] = "uniform"
    dimension: Annotated[int, _SHARED["dimension"]] = 2
    n: Annotated[int, _SHARED["n"]] = 1024
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[0.0, 1.0]
    )
    boundary: Annotated[base.Boundary | list[base.Boundary], _SHARED["boundary"]] = "periodic"
    density: float = Field(default=1.0, gt=0.0, description="mass per volume")
    pressure: float = Field(default=1.0, gt=0.0, description="pressure")
    velocity: float | list[float] = Field(
        default=0.0, description="velocity: a number along x, or a list with one for each axis"
    )
    lattice: Literal["cubic", "hexagonal", "bcc", "relaxed", "random"] = Field(
        default="cubic",
        description='"cubic", "hexagonal" (2-D), "bcc" (3-D), "relaxed", a glass, or "random", '
        "each particle anywhere",
    )
    noise: float = Field(
        default=0.0, ge=0.0, le=0.5, description="largest shift along each axis, in spacings"
    )
    seed: int = Field(
        default=0, ge=0, description="seed of noise, relaxed lattice and random places"
    )

    @field_validator("velocity")
    @classmethod
    def _one_per_axis(cls, velocity, known):
        dimension = known.data.get("dimension")
        if isinstance(velocity, list) and dimension and len(velocity) != dimension:
            raise ValueError(f"{velocity} has not one component for each of {dimension} axes")
        return velocity

    @field_validator("lattice")
    @classmethod
    def _exists(cls, kind, known):
        return placement.checked(kind, known.data.get("dimension"))

    def allowed(self) -> dict[str, base.Limit]:
        """The shipped limit is for lattices: off them particles move until they have settled."""
        if self.noise == 0.0 and self.lattice not in ("relaxed", "random"):
            return self.limits
        return {"energy_drift": base.Limit(1e-3, "what the time integration may lose on any gas")}

    def initial(self, eos) -> base.InitialState:
        position = placement.fill(self.box, self.n, self.lattice, self.seed)
        if self.noise:
            position = placement.with_noise(position, self.box, self.noise, self.seed)
        n = position.shape[1]
        volume = np.prod(self.box[:, 1] - self.box[:, 0])
        state = self.exact(eos, 0.0, position)
        mass = np.full(n, self.density * volume / n)
        return base.InitialState(position, state["velocity"], mass, state["internal_energy"])

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """The uniform state, at any (D, N) positions and for ever."""
        n = position.shape[1]
        density, pressure = np.full(n, self.density), np.full(n, self.pressure)
        velocity = np.zeros_like(position)
        if isinstance(self.velocity, list):
            velocity += np.array(self.velocity)[:, None]
        else:
            velocity[0] = self.velocity
        return {
            "density": density,
            "velocity": velocity,
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Largest over smallest of what is to stay uniform, minus 1, and how far it has come.

        crossings: lengths of the box along x that the gas has moved.
        """
        speed = self.velocity[0] if isinstance(self.velocity, list) else self.velocity
        density, energy = particles.density, particles.internal_energy
        return {
            "density_spread": float(density.max() / density.min() - 1.0),
            "energy_spread": float(energy.max() / energy.min() - 1.0),
            "crossings": abs(speed) * time / float(self.box[0, 1] - self.box[0, 0]),
        }
