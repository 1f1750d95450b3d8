"""Two elastic rings that collide and bounce off each other.

Gray, Monaghan & Swift (2001), Comput. Methods Appl. Mech. Eng. 190, 6641, section 6. SPH particles
under tension form clumps (Swegle's instability), and the rings then break although no law of
fracture is solved. The tensile correction prevents that.
"""

import math
from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import quantity as units
from sph.problems import base
from sph.problems.support import bodies, solids
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

YOUNG, POISSON, DENSITY = 1e7, 0.3975, 1.0
BULK = YOUNG / (3.0 * (1.0 - 2.0 * POISSON))  # eq 456
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
SOUND = math.sqrt(BULK / DENSITY)


class Problem(base.Problem):
    """Two rubber rings in a head-on collision, plane strain: whether and how they rebound."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.eos": {"name": "tait", "rho_0": DENSITY, "c_0": SOUND},
        "physics.strength": {"name": "elastic", "shear_modulus": SHEAR},
        # a corrected kernel pulls harder on particles at the edge of the contact: the rings stick
        "physics.correction": -1,
        "physics.tensile_correction": 0.3,
        "time.end": 4e-4,
        "output.interval": 4e-5,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-3, "errors of the time step; measured: 3e-4"),
        "momentum_change": base.Limit(1e-12, "pair forces are equal and opposite: only round-off"),
        "angular_momentum_change": base.Limit(
            0.02, "not conserved, and zero but for rounding errors that grow; measured: up to 0.01"
        ),
        "restitution": base.Limit(
            0.4, "measured: 0.5 to 0.75; less where the rings stick together", at_least=True
        ),
    }
    profiled: ClassVar = False
    quantities: ClassVar = {
        "ring_gap": Quantity(
            "shortest distance between particles of the two rings, less one spacing", units.LENGTH
        ),
        "approach": Quantity(
            "relative velocity of the centres of mass over that at t = 0; negative after the "
            "rebound"
        ),
        "angular_momentum": Quantity(
            "angular momentum about the centre of mass over the sum of m |x| |v| of the two rings "
            "as points at t = 0"
        ),
        "angular_momentum_change": Quantity("largest |change of angular_momentum since the start|"),
        "rebound_time": Quantity("time at which the rings separate again", units.TIME),
        "restitution": Quantity(
            "relative velocity of the centres of mass after the rebound over that before, eq 457"
        ),
    }

    name: Literal["rubber_rings"] = "rubber_rings"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 2200
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[[-0.12, 0.12], [-0.07, 0.07]]
    )
    boundary: Literal["open"] = Field(default="open", description="vacuum outside, on all sides")
    inner: float = Field(default=0.03, gt=0.0, description="inner radius of the rings")
    outer: float = Field(default=0.04, gt=0.0, description="outer radius of the rings")
    gap: float = Field(default=0.002, gt=0.0, description="gap between the rings at t = 0")
    mach: float = Field(
        default=0.059,
        gt=0.0,
        lt=1.0,
        description="speed of each ring at t = 0, towards the other, divided by c_0 of the "
        "equation of state",
    )
    lattice: Literal["cubic", "hexagonal"] = Field(
        default="cubic", description='initial lattice, "cubic" or "hexagonal"'
    )

    _speed_of_sound: float = PrivateAttr(default=SOUND)

    @model_validator(mode="after")
    def _rings_fit(self):
        if not self.inner < self.outer:
            raise ValueError(f"inner = {self.inner:g}: expected below outer = {self.outer:g}")
        if np.shape(self.domain) in [(2,), (2, 2)]:  # otherwise reported by the configuration
            for shape in self._shapes:
                axis = bodies.outside(shape, self.box, self.boundaries)
                if axis is not None:
                    raise ValueError(
                        f"domain: the rings leave it along {axis}. Try: a wider domain, or smaller "
                        "rings"
                    )
            _ = self._placed
        return self

    def under(self, physics):
        """Return the problem with the speed of the rings; ValueError unless they are of a solid."""
        eos, _ = solids.required(physics)
        found = self.model_copy()
        found._speed_of_sound = eos.c_0
        return found

    def fills_box(self, eos) -> bool:
        """Return False: there is vacuum around the rings."""
        return False

    @property
    def speed(self) -> float:
        """Speed of each ring at t = 0."""
        return self.mach * self._speed_of_sound

    @property
    def _shapes(self) -> tuple[bodies.Shape, bodies.Shape]:
        x, y = self.centre
        away = 0.5 * self.gap + self.outer
        left, right = (bodies.ball([x + side, y], self.outer, self.inner) for side in (-away, away))
        return left, right

    @cached_property
    def _placed(self) -> tuple[bodies.Placed, ...]:
        area = sum(shape.volume for shape in self._shapes)
        spacing = math.sqrt(area / self.n)
        return tuple(bodies.place(shape, self.lattice, spacing) for shape in self._shapes)

    def initial(self, eos) -> base.InitialState:
        """Return two lattices around the centres of the rings, the left ring first."""
        speed = self.speed
        position, velocity, mass = bodies.of_one_material(
            self._placed, [[speed, 0.0], [-speed, 0.0]], eos.rho_0
        )
        each = np.ones(mass.size)
        others = {"density": eos.rho_0 * each, "body": np.where(velocity[0] > 0.0, 1.0, 2.0)}
        return base.InitialState(position, velocity, mass, 0.0 * each, others)

    def diagnostics(self, particles) -> dict[str, float]:
        """Return ring_gap, approach and angular_momentum.

        ring_gap: shortest distance between particles of the two rings, less one spacing. approach:
        relative velocity of the centres of mass over that at t = 0; negative after the rebound.
        angular_momentum: about the centre of mass of all particles, over the sum of m |x| |v| of
        the two rings as points at t = 0.
        """
        left = self._is_left(particles.id)
        m, v = particles.mass, particles.velocity
        mean = [v[0, one] @ m[one] / m[one].sum() for one in (left, ~left)]
        return {
            "ring_gap": self._gap(particles, left),
            "approach": float((mean[0] - mean[1]) / (2.0 * self.speed)),
            "angular_momentum": solids.angular_momentum(particles) / self._swing(particles),
        }

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return restitution, rebound_time and angular_momentum_change from the history.

        restitution: eq 457, relative velocity of the centres of mass after the rebound over that
        before; rebound_time: when the rings separate again. Both are left out while the rings are
        in contact.
        """
        found = {
            "angular_momentum_change": float(
                np.abs(history["angular_momentum"] - history["angular_momentum"][0]).max()
            )
        }
        approach = history["approach"]
        # particles act on each other across a gap of a support radius, about 1.4 spacings
        touch = 1.5 * self._placed[0].spacing
        in_contact = np.flatnonzero(history["ring_gap"] < touch)
        if in_contact.size and approach[-1] < 0.0 and in_contact[-1] + 1 < approach.size:
            found["rebound_time"] = float(history["t"][in_contact[-1]])
            found["restitution"] = float(-approach[-1])  # eq 457
        return found

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the columns of the history."""
        return self.diagnostics(particles)

    def _is_left(self, ids: np.ndarray) -> np.ndarray:
        return ids <= self._placed[0].position.shape[1]

    def _gap(self, particles, left) -> float:
        from scipy.spatial import cKDTree

        x = particles.position.T
        apart, _ = cKDTree(x[left]).query(x[~left])
        return float(apart.min() - self._placed[0].spacing)

    def _swing(self, particles) -> float:
        """Return the sum of m |x| |v| of the two rings as points at t = 0."""
        return float(particles.mass.sum() * self.speed * (self.outer + 0.5 * self.gap))
