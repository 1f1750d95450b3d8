"""Steady-state test: uniform gas at rest or in motion, on a lattice or with noise."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from sph.exact import riemann
from sph.problems import _relax, base
from sph.problems.support import boundary_waves
from sph.problems.support import lattice as placement
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields


class Problem(_relax.Relaxable):
    """Uniform gas at rest or in uniform motion: a steady-state test."""

    defaults: ClassVar = {
        "physics.gamma": 1.4,
        "physics.alpha": 1.0,
        "time.end": 0.2,
        "output.interval": 0.1,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-10, "forces on a lattice cancel: round-off of a few hundred steps, with a margin"
        )
    }
    quantities: ClassVar = {
        "density_spread": Quantity("largest over smallest density, minus 1"),
        "energy_spread": Quantity("largest minus smallest internal energy, over the smallest"),
        "crossings": Quantity("distance moved along x, in lengths of the box"),
    }
    title: ClassVar = "uniform gas"

    name: Literal["uniform"] = "uniform"
    dimension: Annotated[int, _SHARED["dimension"]] = 2
    n: Annotated[int, _SHARED["n"]] = 1024
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[0.0, 1.0]
    )
    boundary: Annotated[base.Boundary | list[base.Boundary], _SHARED["boundary"]] = "periodic"
    density: float = Field(default=1.0, gt=0.0, description="density")
    pressure: float = Field(default=1.0, gt=0.0, description="pressure")
    velocity: float | list[float] = Field(
        default=0.0, description="velocity: a number, along x, or a list with one per axis"
    )
    lattice: Literal["cubic", "hexagonal", "bcc", "relaxed", "random"] = Field(
        default="cubic",
        description='initial lattice: "cubic", "hexagonal" (2-D), "bcc" (3-D), "relaxed", a '
        'disordered glass, or "random", uniformly distributed positions',
    )
    noise: float = Field(
        default=0.0, ge=0.0, le=0.5, description="largest random shift along each axis, in spacings"
    )
    seed: int = Field(
        default=0,
        ge=0,
        description="seed of random numbers, for noise and for relaxed or random positions",
    )

    @field_validator("velocity")
    @classmethod
    def _one_per_axis(cls, velocity, known):
        dimension = known.data.get("dimension")
        if isinstance(velocity, list) and dimension and len(velocity) != dimension:
            raise ValueError(f"{velocity}: expected {dimension} components, one per axis")
        return velocity

    @field_validator("lattice")
    @classmethod
    def _exists(cls, kind, known):
        return placement.checked(kind, known.data.get("dimension"))

    def allowed(self) -> dict[str, base.Limit]:
        """Return the limits: without a lattice, particles move until they have settled."""
        if self.noise == 0.0 and self.lattice not in ("relaxed", "random") and self.relax is None:
            return self.limits
        return {"energy_drift": base.Limit(1e-3, "error of the time integration in any flow")}

    def initial(self, eos) -> base.InitialState:
        position = placement.fill(self.box, self.n, self.lattice, self.seed)
        if self.noise:
            position = placement.with_noise(position, self.box, self.noise, self.seed)
        position, relaxation = self.on_glass(position)
        n = position.shape[1]
        volume = np.prod(self.box[:, 1] - self.box[:, 0])
        state = self.exact(eos, 0.0, position)
        mass = np.full(n, self.density * volume / n)
        return base.InitialState(
            position, state["velocity"], mass, state["internal_energy"], relaxation=relaxation
        )

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the uniform state at (D, N) positions, which is steady."""
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
        """Return whether no vacuum opens at a wall from which the gas moves away."""
        walls = zip(self.boundaries, self._states(), strict=True)
        return not any(
            boundary_waves.opens_vacuum(kind, state, state, eos) for kind, state in walls
        )

    def undisturbed(self, eos, time: float) -> np.ndarray:
        return np.array(
            [ends.between(box, time) for ends, box in zip(self._ends(eos), self.box, strict=True)]
        )

    def exact_ends(self, eos) -> tuple[float, str]:
        """Return when the waves from both ends of an axis meet; infinity if there are none."""
        first = math.inf, ""
        for axis, ends, (low, high) in zip("xyz", self._ends(eos), self.box, strict=False):
            closing = ends.low - ends.high
            if closing > 0.0 and (high - low) / closing < first[0]:
                first = (high - low) / closing, f"waves from the domain's ends along {axis} meet"
        return first

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return density_spread and energy_spread: largest over smallest value, minus 1."""
        density, energy = particles.density, particles.internal_energy
        return {
            "density_spread": float(density.max() / density.min() - 1.0),
            "energy_spread": float(np.ptp(energy) / (energy.min() or 1.0)),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return crossings: distance moved along x, in lengths of the box."""
        length = float(self.box[0, 1] - self.box[0, 0])
        return {"crossings": float(abs(self._velocity[0]) * time / length)}

    @property
    def _velocity(self) -> np.ndarray:
        """(D,) velocity of the gas."""
        velocity = np.zeros(self.dimension)
        if isinstance(self.velocity, list):
            velocity += self.velocity
        else:
            velocity[0] = self.velocity
        return velocity

    def _ends(self, eos) -> list[boundary_waves.Ends]:
        """Return the waves from the ends of each axis."""
        axes = zip(self.boundaries, self._states(), strict=True)
        return [boundary_waves.of(boundary, state, state, eos) for boundary, state in axes]

    def _states(self) -> list[riemann.State]:
        """Return the state of the gas for each axis, with the velocity along that axis."""
        return [riemann.State(self.density, float(v), self.pressure) for v in self._velocity]
