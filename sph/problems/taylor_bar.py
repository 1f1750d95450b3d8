"""Impact of a metal bar on a rigid wall: Taylor's test of the yield stress.

Taylor (1948), Proc. R. Soc. A 194, 289; dimensions and material as Wilkins & Guinan (1973),
J. Appl. Phys. 44, 1200, use them for steel. The bar lies along x with its end on a mirror at x = 0;
mirrors at y = 0 and, in 3-D, z = 0 stand for its other half or three quarters. A mirror also pulls:
the bar cannot rebound, so a run ends soon after the bar is shortest.
"""

import math
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph.problems import base
from sph.problems.support import bodies, solids
from sph.quantity import Quantity

# Finite elements of the same posed problem: final length and largest radius over the initial ones,
# by dimension (2-D: plane strain, half width).
LENGTH_RATIO = {2: 0.811, 3: 0.8124}
RADIUS_RATIO = {2: 2.52, 3: 1.79}
UNTOUCHED = 0.12  # of the length, which stays plastic next to the wall, by Wilkins & Guinan (1973)


class Problem(base.Problem):
    """A bar that hits a rigid wall: final length and radius of its foot."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.eos": {
            "name": "mie_gruneisen", "rho_0": 7850.0, "c_0": 3600.0, "slope": 1.8, "gruneisen": 1.81
        },
        "physics.strength": {"name": "elastic_plastic", "shear_modulus": 8e10, "yield_stress": 6e8},
        # at 1.2 voids open in the foot, where particles move apart to 2.5 spacings
        "physics.spacing_ratio": 1.5,
        "time.end": 6e-5,
        "output.interval": 6e-6,
    }  # fmt: skip
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-3, "errors of the time step; measured: 1.1e-4"),
        "length_error": base.Limit(0.03, "1.2 % longer than finite elements was measured"),
        "radius_error": base.Limit(0.08, "4 % thinner than finite elements was measured"),
    }
    profiled: ClassVar = False
    quantities: ClassVar = {
        "length_ratio": Quantity("length of the bar over its initial length"),
        "radius_ratio": Quantity("largest radius of the bar over its initial radius"),
        "peak_plastic_strain": Quantity("largest equivalent plastic strain of a particle"),
        "shortest_length_ratio": Quantity("smallest length_ratio at any step"),
        "largest_radius_ratio": Quantity("largest radius_ratio at any step"),
        "length_error": Quantity(
            "relative error of shortest_length_ratio against finite elements, absolute"
        ),
        "radius_error": Quantity(
            "relative error of largest_radius_ratio against finite elements, absolute"
        ),
        "fitted_length_ratio": Quantity(
            "length ratio of the fit of Wilkins & Guinan (1973) to measurements, eq 458"
        ),
    }
    title: ClassVar = "Taylor bar"

    name: Literal["taylor_bar"] = "taylor_bar"
    dimension: Literal[2, 3] = Field(default=3, description="number of space dimensions")
    n: int = Field(
        default=2800,
        ge=10,
        le=100_000_000,
        description="number of particles of the half (2-D) or quarter (3-D) of the bar",
    )
    domain: list[float] | list[list[float]] = Field(
        default=[0.0, 0.03],
        description="ends of the box: [0, hi] along x, or a list with one [0, hi] per axis; with "
        "[0, hi], the others end at four radii",
    )
    boundary: Literal["mirror"] = Field(
        default="mirror",
        description="rigid wall at x = 0, planes of symmetry along the other axes; the upper ends "
        "are beyond the reach of the bar",
    )
    length: float = Field(default=0.0254, gt=0.0, description="length of the bar")
    radius: float = Field(
        default=0.0038, gt=0.0, description="radius of the bar; in 2-D, half of its width"
    )
    speed: float = Field(default=200.0, gt=0.0, description="speed towards the wall")
    lattice: Literal["cubic", "hexagonal"] = Field(
        default="cubic",
        description='initial lattice: "cubic", with a corner of cells on the axis of the bar, or '
        '"hexagonal" (2-D)',
    )

    _strength: Any = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _bar_fits(self):
        if self.lattice not in bodies.LATTICES[self.dimension]:
            listed = ", ".join(f'"{one}"' for one in bodies.LATTICES[self.dimension])
            raise ValueError(
                f'lattice = "{self.lattice}": expected one of {listed} in {self.dimension}-D'
            )
        if np.shape(self.domain) not in [(2,), (self.dimension, 2)]:
            return self  # reported by the configuration
        if np.any(self.box[:, 0] != 0.0):
            raise ValueError(f"domain = {self.domain}: expected lower ends at 0")
        if axis := bodies.outside(self._shape, self.box, self.boundaries):
            raise ValueError(f"domain: the bar leaves it along {axis}. Try: a wider domain")
        _ = self._placed
        return self

    @property
    def box(self) -> np.ndarray:
        domain = np.array(self.domain, dtype=float)
        if domain.ndim == 2:
            return domain
        return np.array([domain] + [[0.0, 4.0 * self.radius]] * (self.dimension - 1))

    @property
    def centre(self) -> np.ndarray:
        """(D,) middle of the bar's axis at t = 0."""
        return np.array([0.5 * self.length] + [0.0] * (self.dimension - 1))

    @property
    def _shape(self) -> bodies.Shape:
        if self.dimension == 3:
            return bodies.cylinder(self.centre, self.radius, self.length, axis=0)
        return bodies.box([0.0, 0.0], [self.length, self.radius])

    @cached_property
    def _placed(self) -> bodies.Placed:
        volume = bodies.volume_within(self._shape, self.box, self.boundaries)
        spacing = (volume / self.n) ** (1.0 / self.dimension)
        return bodies.within(bodies.place(self._shape, self.lattice, spacing), self.box)

    def under(self, physics):
        """Return the problem with its strength; ValueError unless the bar is of one solid."""
        _, strength = solids.required(physics)
        found = self.model_copy()
        found._strength = strength
        return found

    def fills_box(self, eos) -> bool:
        """Return False: there is vacuum around the bar."""
        return False

    def initial(self, eos) -> base.InitialState:
        """Return a lattice with the bar's foot half a layer from the wall."""
        velocity = [-self.speed] + [0.0] * (self.dimension - 1)
        position, velocity, mass = bodies.of_one_material((self._placed,), [velocity], eos.rho_0)
        each = np.full(mass.size, float(eos.rho_0))
        return base.InitialState(position, velocity, mass, 0.0 * each, {"density": each})

    def diagnostics(self, particles) -> dict[str, float]:
        """Return length_ratio and radius_ratio: length and largest radius over the initial ones.

        The surface is at the outermost particle plus the distance that separated them at t = 0.
        """
        x, radius = _axial(particles.position)
        x_0, radius_0 = _axial(self._placed.position)
        return {
            "length_ratio": float((x.max() + self.length - x_0.max()) / self.length),
            "radius_ratio": float((radius.max() + self.radius - radius_0.max()) / self.radius),
        }

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the columns of the history, and peak_plastic_strain of materials that yield."""
        found = self.diagnostics(particles)
        strain = getattr(particles, "plastic_strain", None)
        if strain is not None:
            found["peak_plastic_strain"] = float(strain.max())
        return found

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return the shortest length and the largest radius, and their errors.

        length_error, radius_error: relative to finite elements of the same problem, absolute
        values. fitted_length_ratio: the fit of Wilkins & Guinan (1973) to measurements, eq 458,
        for a constant yield stress.
        """
        length, radius = history["length_ratio"].min(), history["radius_ratio"].max()
        found = {
            "shortest_length_ratio": float(length),
            "largest_radius_ratio": float(radius),
            "length_error": float(abs(length / LENGTH_RATIO[self.dimension] - 1.0)),
            "radius_error": float(abs(radius / RADIUS_RATIO[self.dimension] - 1.0)),
        }
        yield_stress = getattr(self._strength, "yield_stress", None)
        if yield_stress is not None:
            found["fitted_length_ratio"] = fitted_length(eos.rho_0, self.speed, yield_stress)
        return found


def fitted_length(density: float, speed: float, yield_stress: float) -> float:
    """Return the final length over the initial one by Wilkins & Guinan (1973), eq 458."""
    return UNTOUCHED + (1.0 - UNTOUCHED) * math.exp(-density * speed**2 / (2.0 * yield_stress))


def _axial(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the position along the bar, and the distance from its axis, each (N,)."""
    return position[0], np.sqrt((position[1:] ** 2).sum(axis=0))
