"""A cold ring of gas around a point mass, on circular orbits: a steady shear flow.

Cartwright, Stamatellos & Whitworth (2009), MNRAS 395, 2373; Hosono, Saitoh & Makino (2016), ApJS
224, 32. Errors of the pressure forces, and artificial viscosity that acts in pure shear, disturb
the orbits. After some orbits the ring breaks up.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from sph import registry
from sph.parts.external.point_mass import PointMass
from sph.problems import base
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

DENSITY = 1.0
# The ring counts as broken above these bounds: rms of density/exact - 1, and rms of the distance of
# particles from their initial orbits over the width of the ring. Both exclude the edges, EDGE of
# the width on either side, which expand into vacuum.
DENSITY_BOUND, RADIUS_BOUND = 0.1, 0.02
EDGE = 0.15
ORBITED = PointMass(mass=1.0, softening=0.0)


class Problem(base.Problem):
    """A cold ring on circular orbits about a point mass: how many orbits it stays intact."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 0.1,
        "physics.external": {"name": "point_mass", "mass": 1.0},
        "time.end": 31.41592653589793,
        "output.interval": 6.283185307179586,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "circular orbits, on which kinetic and potential energy are constant"
        ),
    }
    quantities: ClassVar = {
        "density_deviation": Quantity(
            "root mean square of rho/rho_0 - 1, without the edges of the ring"
        ),
        "radial_deviation": Quantity(
            "root mean square of r - r_0 over the width of the ring, without its edges"
        ),
        "orbits": Quantity("length of the run in periods of the middle of the ring"),
        "orbits_intact": Quantity(
            "first time at which a deviation exceeds its bound, or the length of the run, in "
            "periods of the middle of the ring"
        ),
    }
    radial: ClassVar = True
    profiles: ClassVar = base.ROTATION
    title: ClassVar = "Keplerian ring"

    name: Literal["keplerian_ring"] = "keplerian_ring"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 3000
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[-2.0, 2.0]
    )
    boundary: Literal["open"] = Field(
        default="open", description="boundary of both axes; vacuum outside"
    )
    inner: float = Field(default=0.5, gt=0.0, description="inner radius of the ring")
    outer: float = Field(default=1.5, gt=0.0, description="outer radius of the ring")
    pressure: float = Field(default=1e-6, gt=0.0, description="pressure of the cold gas at t = 0")

    @model_validator(mode="after")
    def _is_a_ring(self):
        if not self.inner < self.outer:
            raise ValueError(f"inner = {self.inner}: expected less than outer = {self.outer}")
        return self

    @property
    def width(self) -> float:
        return self.outer - self.inner

    @property
    def period(self) -> float:
        """Period of the orbit in the middle of the ring."""
        return 2.0 * np.pi * (0.5 * (self.inner + self.outer)) ** 1.5

    def initial(self, eos) -> base.InitialState:
        """Return circles of evenly spaced particles, each rotated relative to the next."""
        radius, angle, mass = self._circles()
        position = radius * np.array([np.cos(angle), np.sin(angle)])
        state = self.exact(eos, 0.0, position)
        return base.InitialState(position, state["velocity"], mass, state["internal_energy"])

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the steady ring at (2, N) positions, which are assumed to be inside it."""
        radius = np.sqrt((position**2).sum(axis=0))
        x, y = position
        density, pressure = np.full(radius.size, DENSITY), np.full(radius.size, self.pressure)
        return {
            "density": density,
            "velocity": np.array([-y, x]) / np.where(radius > 0.0, radius, np.inf) ** 1.5,
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def departs(self, physics) -> str | None:
        if registry.model("sph.parts.external", physics.external) != ORBITED:
            return (
                "the exact solution is for a point mass of 1 without softening, but "
                "physics.external is another field"
            )
        return base.other_physics(physics, besides="external")

    def exact_ends(self, eos) -> tuple[float, str]:
        """Return when sound waves from the expanding edges reach the region of the errors."""
        sound = float(eos.sound_speed(DENSITY, self.pressure))
        return EDGE * self.width / sound, "waves from the ring's edges reach its inner part"

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return the ring without its edges."""
        low, high = self._kept
        radius = np.sqrt((position**2).sum(axis=0))
        return (low < radius) & (radius < high), f"{low:.4g} < r < {high:.4g}"

    def diagnostics(self, particles) -> dict[str, float]:
        """Return deviations from the initial ring, over particles not initially at its edges.

        density_deviation: rms of rho/rho_0 - 1; radial_deviation: rms of r - r_0 over the width.
        """
        start = self._circles()[0][particles.id - 1]
        low, high = self._kept
        kept = (low < start) & (start < high)
        radius = np.sqrt((particles.position**2).sum(axis=0))
        return {
            "density_deviation": _rms(particles.density[kept] / DENSITY - 1.0),
            "radial_deviation": _rms(radius[kept] - start[kept]) / self.width,
        }

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return orbits and orbits_intact, times in periods of the middle of the ring.

        orbits: duration of the run; orbits_intact: first time at which a deviation exceeds its
        bound, or the duration of the run if none does.
        """
        broken = (history["density_deviation"] > DENSITY_BOUND) | (
            history["radial_deviation"] > RADIUS_BOUND
        )
        last = int(np.argmax(broken)) if broken.any() else broken.size - 1
        return {
            "orbits": float(history["t"][-1] / self.period),
            "orbits_intact": float(history["t"][last] / self.period),
        }

    @property
    def _kept(self) -> tuple[float, float]:
        return self.inner + EDGE * self.width, self.outer - EDGE * self.width

    def _circles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return radius, angle and mass (N,) of the particles by ID, in cells close to squares."""
        area = np.pi * (self.outer**2 - self.inner**2)
        number = max(1, round(self.width / np.sqrt(area / self.n)))
        edges = np.linspace(self.inner, self.outer, number + 1)
        rings = np.pi * np.diff(edges**2)
        counts = np.maximum(1, np.round(rings * self.n / area)).astype(int)
        ring = np.repeat(np.arange(number), counts)
        within = np.arange(ring.size) - np.repeat(np.cumsum(counts) - counts, counts)
        # rotation by the golden ratio avoids aligned particles in neighbouring circles
        angle = 2.0 * np.pi * (within / counts[ring] + 0.6180339887498949 * ring)
        radius = 0.5 * (edges[1:] + edges[:-1])
        return radius[ring], angle, DENSITY * (rings / counts)[ring]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
