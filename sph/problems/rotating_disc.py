"""An elastic disc in plane strain that rotates freely: a test of angular momentum.

The disc starts with the stress and the stretch of its rotation, which are known exactly. It then
rotates like a rigid body: angular momentum, shape and stress, seen from the disc, stay constant.
"""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import quantity as units
from sph.exact.plate import Material
from sph.exact.rotating_disc import Disc
from sph.problems import base
from sph.problems.support import lattice as placement
from sph.problems.support import solids
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

KEPT = 0.8  # of the radius: errors are averaged inside; farther out, kernels reach the rim
LARGEST_STRETCH = 1e-2  # of the radius; the exact solution is of first order in the stretch
DENSITY, SOUND, SHEAR = 7850.0, 3600.0, 8e10  # of steel


class Problem(base.Problem):
    """A freely rotating elastic disc: angular momentum, angle, shape and stress."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.eos": {"name": "tait", "rho_0": DENSITY, "c_0": SOUND},
        "physics.strength": {"name": "elastic", "shear_modulus": SHEAR},
        "physics.correction": 1,
        "physics.balsara": False,
        "time.end": 1.2566370614359172e-2,
        "output.interval": 3.141592653589793e-3,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-6, "measured: 1.1e-8, errors of the time step"),
        "angular_momentum_drift": base.Limit(
            1e-6, "measured: 4e-8 a turn; stress has no torque at order 1"
        ),
        "shape_error": base.Limit(1e-4, "measured: 4e-6; a rigid rotation"),
        "stress_error": base.Limit(0.05, "measured: 0.027; kernels at the rim"),
    }
    radial: ClassVar = True
    quantities: ClassVar = {
        "angular_momentum": Quantity(
            "angular momentum about the centre of mass", units.ANGULAR_MOMENTUM
        ),
        "rms_radius": Quantity("root mean square radius over its value at rest"),
        "turns": Quantity("rotations since the start"),
        "angular_momentum_drift": Quantity(
            "relative change of the angular momentum since the start, absolute, per turn"
        ),
        "radius_change": Quantity("relative change of rms_radius since the start"),
        "largest_radius_change": Quantity(
            "largest absolute value of the relative change of rms_radius at any step"
        ),
        "angle_error": Quantity("angle by which the disc is ahead of the exact rotation, in turns"),
        "shape_error": Quantity(
            "root mean square distance of particles from their initial positions, turned by the "
            "angle of best fit, over the radius"
        ),
        "stress_error": Quantity(
            "mean size of the error of the stress over the largest stress, without the rim"
        ),
    }
    profiles: ClassVar = base.ROTATION

    name: Literal["rotating_disc"] = "rotating_disc"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 400
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[-0.15, 0.15]
    )
    boundary: Literal["open"] = Field(default="open", description="nothing outside, on all sides")
    radius: float = Field(default=0.1, gt=0.0, description="radius of the disc at rest")
    spin: float = Field(default=1000.0, description="angular velocity")
    lattice: Literal["cubic", "hexagonal"] = Field(
        default="hexagonal", description='initial lattice, "cubic" or "hexagonal"'
    )

    _material: Material = PrivateAttr(default=Material(DENSITY, DENSITY * SOUND**2, SHEAR))

    @model_validator(mode="after")
    def _in_the_box(self):
        room = float((self.box[:, 1] - self.box[:, 0]).min() / 2.0)
        if not self.radius <= room:
            raise ValueError(
                f"radius = {self.radius:g}: expected at most {room:g}, half of the shortest side "
                "of the domain. Try: a wider domain"
            )
        return self

    def under(self, physics):
        """Return the problem with the material of [physics]."""
        eos, strength = solids.required(physics)
        found = self.model_copy()
        found._material = Material(eos.rho_0, eos.rho_0 * eos.c_0**2, strength.shear_modulus)
        stretch = float(found.disc.stretch(np.zeros(1))[0])
        if not stretch <= LARGEST_STRETCH:
            raise ValueError(
                f"physics.eos, physics.strength: the rotation stretches the disc by {stretch:.3g} "
                f"of its radius; expected at most {LARGEST_STRETCH:g}. Try: a smaller problem.spin"
            )
        return found

    @property
    def disc(self) -> Disc:
        """The exact solution."""
        return Disc(self.radius, self.spin, self._material)

    def initial(self, eos) -> base.InitialState:
        """Return a lattice that is stretched by the rotation, with the exact stress."""
        at_rest = self.radius * placement.ball(self.n, self.lattice, 2)
        n = at_rest.shape[1]
        offset = at_rest * (1.0 + self.disc.stretch(np.sqrt((at_rest**2).sum(axis=0))))
        position = self.centre[:, None] + offset
        exact = self.exact(eos, 0.0, position)
        mass = np.full(n, self._material.density * math.pi * self.radius**2 / n)
        others = {"density": exact["density"], "deviatoric_stress": self.disc.deviator(offset)}
        return base.InitialState(position, exact["velocity"], mass, np.zeros(n), others)

    def fills_box(self, eos) -> bool:
        return False

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return density, velocity and pressure of the steady rotation at (2, N) positions."""
        x, y = offset = position - self.centre[:, None]
        radius = np.minimum(np.sqrt((offset**2).sum(axis=0)), self.radius)
        pressure = self.disc.pressure(radius)
        bulk = self._material.bulk
        return {
            "density": self._material.density * (1.0 + pressure / bulk),  # of first order
            "velocity": self.spin * np.array([-y, x]),
            "pressure": pressure,
        }

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return the disc without its rim."""
        reach = KEPT * self.radius
        offset = position - self.centre[:, None]
        return (offset**2).sum(axis=0) < reach**2, f"r < {reach:.4g} around the centre"

    def diagnostics(self, particles) -> dict[str, float]:
        """Return angular_momentum, and rms_radius over its value at rest, about the centre."""
        offset, _ = solids.moving(particles)
        square = float((particles.mass * (offset**2).sum(axis=0)).sum() / particles.mass.sum())
        return {
            "angular_momentum": solids.angular_momentum(particles),
            "rms_radius": math.sqrt(2.0 * square) / self.radius,
        }

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return turns, and relative changes of angular momentum and radius since the start.

        angular_momentum_drift: absolute value, per turn; radius_change: at the end;
        largest_radius_change: the largest absolute value at any step. Empty without rotation.
        """
        if self.spin == 0.0 or history["t"][-1] == 0.0:
            return {}
        turns = abs(self.spin) * float(history["t"][-1]) / (2.0 * math.pi)
        spun, radius = history["angular_momentum"], history["rms_radius"]
        change = radius / radius[0] - 1.0
        return {
            "turns": turns,
            "angular_momentum_drift": float(abs(spun[-1] / spun[0] - 1.0) / turns),
            "radius_change": float(change[-1]),
            "largest_radius_change": float(np.abs(change).max()),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return errors of angle, shape and stress at `time`.

        angle_error: angle by which the disc is ahead of the exact rotation, in turns;
        shape_error: rms distance of particles from their initial positions, turned by the angle of
        best fit, over the radius; stress_error: mean size of the error of the stress in the plane
        over the largest stress, without the rim.
        """
        start = self.initial(eos).position[:, particles.id - 1] - self.centre[:, None]
        offset, _ = solids.moving(particles)
        angle = math.atan2(*_sums(particles.mass, start, offset))
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        apart = ((offset - turn @ start) ** 2).sum(axis=0).mean()
        found = {
            "angle_error": solids.wrapped(angle - self.spin * time) / (2.0 * math.pi),
            "shape_error": math.sqrt(float(apart)) / self.radius,
        }
        stress = particles.get("deviatoric_stress")
        if stress is not None and self.spin != 0.0:
            inside, _ = self.error_region(eos, time, particles.position)
            radius = np.sqrt((offset**2).sum(axis=0))
            wrong = stress - self.disc.deviator(offset)
            wrong -= (pressure - self.disc.pressure(radius)) * np.eye(2)[:, :, None]
            size = np.sqrt((wrong**2).sum(axis=(0, 1)))[inside].mean()
            found["stress_error"] = float(size / self.disc.central_stress)
        return found


def _sums(mass, start, now) -> tuple[float, float]:
    """Return sum m (start x now) and sum m (start . now): sine and cosine of the angle of a fit."""
    sine = (mass * (start[0] * now[1] - start[1] * now[0])).sum()
    return float(sine), float((mass * (start * now).sum(axis=0)).sum())
