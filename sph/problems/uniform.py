"""Uniform gas at rest or in motion, on a lattice or with noise: nothing should happen."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from sph.exact import riemann
from sph.problems import base
from sph.problems.support import boundary_waves
from sph.problems.support import lattice as placement

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
        velocity = np.zeros_like(position) + self._velocity[:, None]
        return {
            "density": density,
            "velocity": velocity,
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def fills_box(self, eos) -> bool:
        """Unless it leaves a wall faster than it can expand."""
        walls = zip(self.boundaries, self._states(), strict=True)
        return not any(
            boundary_waves.opens_vacuum(kind, state, state, eos) for kind, state in walls
        )

    def undisturbed(self, eos, time: float) -> np.ndarray:
        return np.array(
            [ends.between(box, time) for ends, box in zip(self._ends(eos), self.box, strict=True)]
        )

    def exact_ends(self, eos) -> tuple[float, str]:
        """When the waves from both ends of an axis have met; never where none sends any."""
        first = math.inf, ""
        for axis, ends, (low, high) in zip("xyz", self._ends(eos), self.box, strict=False):
            closing = ends.low - ends.high
            if closing > 0.0 and (high - low) / closing < first[0]:
                first = (high - low) / closing, f"waves from the domain's ends along {axis} meet"
        return first

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Largest over smallest of what is to stay uniform, minus 1."""
        density, energy = particles.density, particles.internal_energy
        return {
            "density_spread": float(density.max() / density.min() - 1.0),
            "energy_spread": float(energy.max() / energy.min() - 1.0),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """crossings: lengths of the box along x that the gas has moved."""
        length = float(self.box[0, 1] - self.box[0, 0])
        return {"crossings": float(abs(self._velocity[0]) * time / length)}

    @property
    def _velocity(self) -> np.ndarray:
        """(D,) of the gas."""
        velocity = np.zeros(self.dimension)
        if isinstance(self.velocity, list):
            velocity += self.velocity
        else:
            velocity[0] = self.velocity
        return velocity

    def _ends(self, eos) -> list[boundary_waves.Ends]:
        """The waves from the ends of each axis."""
        axes = zip(self.boundaries, self._states(), strict=True)
        return [boundary_waves.of(boundary, state, state, eos) for boundary, state in axes]

    def _states(self) -> list[riemann.State]:
        """The gas, with its velocity along each axis."""
        return [riemann.State(self.density, float(v), self.pressure) for v in self._velocity]
