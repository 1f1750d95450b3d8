"""Water at rest in an open tank, whose pressure is the weight of the water above.

The water has Tait's equation of state, whose speed of sound is about ten times that of the flow,
so the density changes by one per cent (Monaghan 1994, J. Comput. Phys. 110, 399). Bottom and sides
of the tank are mirrors. The surface is free.
"""

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import quantity as units
from sph import registry
from sph.problems import base
from sph.problems.support import solids
from sph.problems.support.lattice import fill
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

GRAVITY = 9.81
DENSITY, SOUND, EXPONENT = 1000.0, 31.32, 7.0  # SOUND: ten times (g x 1 m)^(1/2)


class Problem(base.Problem):
    """Water at rest under gravity: pressure, noise of velocities and settling."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.eos": {"name": "tait", "rho_0": DENSITY, "c_0": SOUND, "gamma": EXPONENT},
        "physics.external": {"name": "uniform", "g": [0.0, -GRAVITY]},
        "time.end": 3.0,
        "output.interval": 0.5,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-6, "measured: 1.7e-8; water at rest"),
        "pressure_error": base.Limit(0.01, "measured: 0.005, alternating from row to row"),
        "velocity_noise": base.Limit(1e-3, "measured: 4e-4; water at rest"),
        "settling": base.Limit(1e-3, "measured: 4e-5, of a compression by 5e-3"),
    }
    profiled: ClassVar = False
    quantities: ClassVar = {
        "rms_velocity": Quantity("root mean square velocity over (g depth)^(1/2)"),
        "centre_of_mass": Quantity("height y of the centre of mass", units.LENGTH),
        "velocity_noise": Quantity(
            "root mean square of rms_velocity over the last tenth of the run"
        ),
        "settling": Quantity(
            "how far the centre of mass has fallen since the start, on average over the last tenth "
            "of the run, over the depth"
        ),
        "pressure_error": Quantity("mean error of the pressure over the pressure at the bottom"),
    }

    name: Literal["hydrostatic_tank"] = "hydrostatic_tank"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 900
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[[0.0, 1.0], [0.0, 1.5]]
    )
    boundary: Literal["mirror"] = Field(
        default="mirror", description="walls; that above is far from the surface"
    )
    depth: float = Field(default=1.0, gt=0.0, description="depth of the water")

    _g: float = PrivateAttr(default=GRAVITY)
    _eos: Any = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _has_free_surface(self):
        height = float(np.diff(self.box[1])[0])
        if not self.depth < 0.9 * height:
            raise ValueError(
                f"depth = {self.depth:g}: expected less than {0.9 * height:g}, nine tenths of the "
                "height of the domain, because the surface is free. Try: a higher domain"
            )
        return self

    def under(self, physics):
        """Return the problem with the acceleration of gravity and the liquid of [physics]."""
        eos, _ = solids.required(physics, liquid=True)
        if eos.name != "tait":
            raise ValueError(f'physics.eos = "{eos.name}": expected "tait", for the exact pressure')
        field = registry.model("sph.parts.external", physics.external)
        g = getattr(field, "g", None)
        if g is None or g[0] != 0.0 or not g[1] < 0.0:
            raise ValueError(
                "physics.external: expected a field that points down, such as "
                '{ name = "uniform", g = [0.0, -9.81] }'
            )
        found = self.model_copy()
        found._eos, found._g = eos, -g[1]
        return found

    @property
    def surface(self) -> float:
        """The height of the surface."""
        return float(self.box[1, 0]) + self.depth

    def initial(self, eos) -> base.InitialState:
        """Return a square lattice whose masses follow the hydrostatic density."""
        water = self.box
        water[1, 1] = self.surface
        position = fill(water, self.n, "cubic")
        n = position.shape[1]
        density = self.exact(eos, 0.0, position)["density"]
        mass = density * np.prod(np.diff(water)) / n
        return base.InitialState(
            position, np.zeros_like(position), mass, np.zeros(n), {"density": density}
        )

    def fills_box(self, eos) -> bool:
        return False

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the hydrostatic state at (2, N) positions (eq 453), that of the surface above."""
        below = np.maximum(self.surface - position[1], 0.0)
        depth = self._g * below / eos.c_0**2
        power = eos.gamma - 1.0
        density = eos.rho_0 * (
            np.exp(depth) if power == 0.0 else (1.0 + power * depth) ** (1.0 / power)
        )
        return {
            "density": density,
            "velocity": np.zeros_like(position),
            "pressure": eos.pressure(density, np.zeros_like(density)),
        }

    def departs(self, physics) -> str | None:
        field = registry.model("sph.parts.external", physics.external)
        if tuple(getattr(field, "g", ())) != (0.0, -self._g):
            return "the exact pressure is for a uniform field, but physics.external is another"
        return base.other_physics(physics, besides="external")

    def diagnostics(self, particles) -> dict[str, float]:
        """Return rms_velocity, in units of (g depth)^(1/2), and centre_of_mass, its height."""
        share = particles.mass / particles.mass.sum()
        square = float((share * (particles.velocity**2).sum(axis=0)).sum())
        return {
            "rms_velocity": math.sqrt(square / (self._g * self.depth)),
            "centre_of_mass": float((share * particles.position[1]).sum()),
        }

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return velocity_noise and settling, over the last tenth of the run.

        velocity_noise: rms velocity over (g depth)^(1/2); settling: how far the centre of mass has
        fallen since the start, over the depth.
        """
        late = history["t"] >= 0.9 * history["t"][-1]
        height = history["centre_of_mass"]
        return {
            "velocity_noise": float(np.sqrt((history["rms_velocity"][late] ** 2).mean())),
            "settling": float((height[0] - height[late].mean()) / self.depth),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return pressure_error: mean error of the pressure over the pressure at the bottom."""
        bottom = np.array([[0.0], [self.box[1, 0]]])
        exact = self.exact(eos, time, particles.position)["pressure"]
        largest = self.exact(eos, time, bottom)["pressure"][0]
        volume = particles.mass / particles.density
        wrong = float((volume * np.abs(pressure - exact)).sum() / volume.sum())
        return {"pressure_error": wrong / float(largest)}
