"""Symmetric impact of two plates along x, in 1-D to 3-D.

The plates, at speeds +speed and -speed, touch at the middle of the domain at t = 0. A strong shock
runs into each plate and leaves the material behind it at rest. The shock has an exact solution for
a material whose shock speed is linear in the jump of velocity (eqs 422, 440, 441 and 446);
physics.strength adds an elastic precursor (eqs 442-444). The rear sides of the plates are free, and
the plates are periodic along y and z.

On a lattice, gradients of correction orders -1 and 0 are g times the true ones, and shocks run at
about g times their speed: at physics.spacing_ratio = 1.2, g is 1.0205 in 1-D at order 0, at 2.0 it
is 1.0000. At order 1 g is 1.
"""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, field_validator

from sph.exact import solid_shocks
from sph.problems import base
from sph.problems.support import lattice as placement
from sph.problems.support import solid_fronts, solids, uniaxial

_SHARED = base.Problem.model_fields

# Speeds of fronts are measured in the last half of the run: while a shock forms, its position gets
# an offset, up to 2 % of the way that it travels in a run.
SINCE = 0.5
FEWEST = 10  # steps for a speed


class Problem(base.Problem):
    """Two steel plates that collide at 500 m/s each (SI units)."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.correction": 1,
        "physics.eos": uniaxial.STEEL,
        "time.end": 1e-5,
        "output.interval": 2e-6,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-4, "measured: 5.3e-5, in the first steps of the impact"),
        "shock_speed_error": base.Limit(0.01, "measured: 2.4e-4 with 400 particles"),
        "shock_pressure_error": base.Limit(0.01, "measured: 3e-5 with 400 particles"),
        "shock_density_error": base.Limit(0.01, "measured: 1e-5 with 400 particles"),
        "shock_internal_energy_error": base.Limit(
            0.01, "measured: 2e-5; 6e-3 with 200 particles, from the heat at the plane of impact"
        ),
    }
    profiles: ClassVar = ("density", "velocity", "stress", "internal_energy")
    quantities: ClassVar = solid_fronts.QUANTITIES

    name: Literal["flyer_plate"] = "flyer_plate"
    dimension: Annotated[int, _SHARED["dimension"]] = 1
    n: Annotated[int, _SHARED["n"]] = 400
    domain: list[float] | list[list[float]] = Field(
        default=[-0.05, 0.05],
        description="ends of the two plates: [lo, hi] along x (y and z are then an eighth as "
        "wide), or a list with one [lo, hi] per axis; the plates touch in the middle",
    )
    boundary: Literal["open"] = Field(
        default="open", description="free rear sides of the plates; y and z are periodic"
    )
    speed: float = Field(default=500.0, gt=0.0, description="speed of each plate")
    lattice: Literal["cubic", "hexagonal", "bcc"] = Field(
        default="cubic",
        description='initial lattice: "cubic", "hexagonal" (2-D) or "bcc" (3-D)',
    )

    _material: solid_shocks.Material | None = PrivateAttr(default=None)
    _off_lattice: bool = PrivateAttr(default=False)

    @field_validator("lattice")
    @classmethod
    def _exists(cls, kind, known):
        return placement.checked(kind, known.data.get("dimension"))

    def under(self, physics):
        """Return the problem with the material of [physics]; ValueError for a gas."""
        solids.check_single(physics)
        found = self.model_copy()
        found._material = solid_fronts.material(physics.eos_model(), physics.strength_model())
        found._off_lattice = uniaxial.is_off_on_lattice(physics)
        return found

    @property
    def box(self) -> np.ndarray:
        return uniaxial.slender_box(self.domain, self.dimension)

    @property
    def boundaries(self) -> tuple[str, ...]:
        return (self.boundary,) + ("periodic",) * (self.dimension - 1)

    def fills_box(self, eos) -> bool:
        """Return False: the rear sides of the plates move away from the ends of the box."""
        return False

    def allowed(self) -> dict[str, base.Limit]:
        """Return limits for the correction order and spacing_ratio of [physics]."""
        if not self._off_lattice:
            return self.limits
        speeds = [name for name in self.limits if name.endswith("_speed_error")]
        return self.limits | dict.fromkeys(speeds, base.Limit(*uniaxial.OFF_LATTICE))

    @property
    def fronts(self) -> tuple[solid_shocks.Front, ...]:
        """Shocks in the frame of the plate that they run into, the fastest first.

        Empty for material laws without an exact solution.
        """
        return solid_shocks.fronts(self._material, self.speed) if self._material else ()

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass on a lattice with an even number of layers."""
        position = placement.fill(self.box, self.n, self.lattice, even=True)
        velocity = np.zeros_like(position)
        velocity[0] = -self.speed * np.sign(position[0] - self.centre[0])
        own = uniaxial.at_rest(self.box, position.shape[1], eos.rho_0)
        return base.InitialState(position, velocity, *own)

    def departs(self, physics) -> str | None:
        if self._material is None:
            return (
                "the exact solution is for physics.eos mie_gruneisen and, with physics.strength, a "
                "constant yield stress"
            )
        return super().departs(physics)

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Return the waves of eq 446 at (D, N) positions, with -sigma_xx (N,) as "stress"."""
        if self._material is None:
            return None
        offset = position[0] - self.centre[0]
        xi = np.full(offset.shape, np.inf) if time == 0.0 else np.abs(offset) / time + self.speed
        found = solid_shocks.at(self.fronts, solid_shocks.at_rest(self._material), xi)
        velocity = np.zeros_like(position)
        velocity[0] = -np.sign(offset) * (self.speed - found.velocity)
        return {
            "density": found.density,
            "velocity": velocity,
            "pressure": found.pressure,
            "internal_energy": found.internal_energy,
            "stress": found.stress,
        }

    def exact_ends(self, eos) -> tuple[float, str]:
        if not self.fronts:
            return math.inf, ""
        thickness = 0.5 * float(self.box[0, 1] - self.box[0, 0])
        return thickness / self.fronts[0].speed, "a wave reaches the rear sides of the plates"

    def diagnostics(self, particles) -> dict[str, float]:
        """Return shock_position and, with an elastic precursor, precursor_position.

        Distances from the plane of impact where, coming from outside, the change of velocity is
        half way to that behind the front.
        """
        change = self.speed - np.abs(particles.velocity[0])
        return solid_fronts.positions(self.fronts, self._distance(particles), change)

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return exact positions of the fronts, NaN after a wave has reached the rear sides."""
        valid = np.where(times <= self.exact_ends(eos)[0], times, np.nan)
        return {
            f"{name}_position": (front.speed - self.speed) * valid
            for name, front in zip(solid_fronts.names(self.fronts), self.fronts, strict=True)
        }

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return shock_speed and precursor_speed, in the frame of the plate ahead, and errors.

        Slopes of the positions of the fronts over the last half of the run, or of the time until
        `exact_ends`; *_error: relative, absolute values.
        """
        times = history["t"]
        end = min(float(times[-1]), self.exact_ends(eos)[0])
        late = (times >= SINCE * end) & (times <= end)
        if late.sum() < FEWEST:
            return {}
        figures: dict[str, float] = {}
        for name, front in zip(solid_fronts.names(self.fronts), self.fronts, strict=True):
            found = np.polyfit(times[late] / end, history[f"{name}_position"][late], 1)[0] / end
            speed = float(found) + self.speed
            figures |= solid_fronts.compared(f"{name}_speed", speed, front.speed)
        return figures

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return medians behind the fronts, with exact values and relative errors (absolute).

        shock_stress, shock_pressure, shock_density, shock_internal_energy: behind the shock, the
        slower front; elastic_limit: the stress between an elastic precursor and the shock.
        """
        fields = {
            "stress": uniaxial.compressive_stress(particles, pressure),
            "pressure": pressure,
            "density": particles.density,
            "internal_energy": particles.internal_energy,
        }
        reach = [(front.speed - self.speed) * time for front in self.fronts]
        return solid_fronts.plateaus(self.fronts, reach, self._distance(particles), fields)

    def _distance(self, particles) -> np.ndarray:
        """Return the distance (N,) from the plane of impact."""
        return np.abs(particles.position[0] - self.centre[0])
