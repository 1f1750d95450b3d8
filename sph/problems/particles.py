"""Individual particles given in the configuration, for extreme geometries."""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from sph import quantity as units
from sph.problems import base
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

PER_PARTICLE = ("velocities", "masses", "internal_energies")


class Problem(base.Problem):
    """Particles at positions given in the configuration."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 1.0,
        "output.interval": 0.5,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-3, "error of the leapfrog in any flow"),
        "momentum_change": base.Limit(1e-12, "pair forces are equal and opposite: only round-off"),
    }
    quantities: ClassVar = {
        "lowest_internal_energy": Quantity(
            "smallest internal energy per unit mass of a particle", units.SPECIFIC_ENERGY
        ),
        "lowest_density": Quantity("smallest density of a particle", units.DENSITY),
        "widest_support": Quantity("largest support radius of a particle", units.LENGTH),
        "centre_error": Quantity(
            "distance of the centre of mass from its free motion, over the extent of the particles "
            "plus the distance that the fastest particle travels"
        ),
    }
    title: ClassVar = "individual particles"

    name: Literal["particles"] = "particles"
    dimension: Annotated[int, _SHARED["dimension"]] = 1
    n: int = Field(
        default=4, ge=1, description="number of particles; the length of positions if not given"
    )
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[-1.0, 1.0]
    )
    boundary: Annotated[base.Boundary | list[base.Boundary], _SHARED["boundary"]] = "open"
    positions: list[list[float]] = Field(
        default=[[-0.3], [-0.1], [0.1], [0.3]],
        min_length=1,
        description="one list of coordinates per particle",
    )
    velocities: list[list[float]] | None = Field(
        default=None,
        description="one list of velocity components per particle; at rest if not given",
    )
    masses: float | list[float] = Field(
        default=1.0, description="one mass for all particles, or a list with one per particle"
    )
    internal_energies: float | list[float] = Field(
        default=1.0,
        description="internal energy per unit mass: one for all particles, or a list with one per "
        "particle",
    )

    @model_validator(mode="before")
    @classmethod
    def _number_of_positions(cls, keys: Any) -> Any:
        positions = keys.get("positions") if isinstance(keys, dict) else None
        return {"n": len(positions)} | keys if isinstance(positions, list) else keys

    @model_validator(mode="after")
    def _fits(self):
        n = len(self.positions)
        if self.n != n:
            raise ValueError(
                f"n = {self.n}: expected {n}, the number of positions. Try: leave n out"
            )
        for name in ("positions", "velocities"):
            for row in getattr(self, name) or ():
                if len(row) != self.dimension:
                    raise ValueError(f"{name}: {row}: expected {self.dimension} components")
        for name in PER_PARTICLE:
            given = getattr(self, name)
            if isinstance(given, list) and len(given) != n:
                raise ValueError(f"{name}: {len(given)} values; expected {n}")
        for name in ("masses", "internal_energies"):
            if not np.all(np.array(getattr(self, name)) > 0.0):
                raise ValueError(f"{name}: {getattr(self, name)}: expected values above 0")
        return self

    @model_validator(mode="after")
    def _in_the_box(self):
        if len(np.shape(self.domain)) == 2 and len(self.domain) != self.dimension:
            return self  # reported by the configuration
        for axis, boundary in enumerate(self.boundaries[: self.dimension]):
            low, high = self.box[axis]
            for row in self.positions:
                if boundary != "open" and not low <= row[axis] <= high:
                    raise ValueError(
                        f"positions: {row} is outside [{low}, {high}] along {'xyz'[axis]}"
                    )
        return self

    def fills_box(self, eos) -> bool:
        """Return False: positions are arbitrary."""
        return False

    def initial(self, eos) -> base.InitialState:
        """Return the particles given in the configuration."""
        position = np.array(self.positions, dtype=float).T
        still = self.velocities is None
        velocity = np.zeros_like(position) if still else np.array(self.velocities, dtype=float).T
        each = np.ones(position.shape[1])
        return base.InitialState(
            position,
            velocity,
            each * np.array(self.masses, dtype=float),
            each * np.array(self.internal_energies, dtype=float),
        )

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the extremes of internal energy, density and support radius."""
        return {
            "lowest_internal_energy": float(particles.internal_energy.min()),
            "lowest_density": float(particles.density.min()),
            "widest_support": float(particles.support.max()),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return centre_error if all boundaries are open.

        centre_error: distance of the centre of mass from its free motion, over the extent of the
        particles plus the distance that the fastest particle travels.
        """
        if set(self.boundaries) != {"open"}:
            return {}
        start = self.initial(eos)
        share = start.mass / start.mass.sum()
        expected = start.position @ share + time * (start.velocity @ share)
        found = particles.position @ (particles.mass / particles.mass.sum())
        extent = np.abs(particles.position).max() + time * np.abs(particles.velocity).max()
        return {"centre_error": float(np.abs(found - expected).max() / extent)}
