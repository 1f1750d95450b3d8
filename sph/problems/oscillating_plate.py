"""An elastic plate in plane strain, held by jaws at one end, in its first transverse mode.

Gray, Monaghan & Swift (2001), Comput. Methods Appl. Mech. Engrg. 190, 6641, section 4.2, with the
jaws of the example of PySPH: they hold a quarter of the length. The amplitude is small, so that
linear elasticity gives the period.
"""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import quantity as units
from sph.exact import plate
from sph.problems import base
from sph.problems.support import lattice as placement
from sph.problems.support import oscillation, solids
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

YOUNGS, POISSON = 2e6, 0.3975
BULK = YOUNGS / (3.0 * (1.0 - 2.0 * POISSON))
SHEAR = YOUNGS / (2.0 * (1.0 + POISSON))
DENSITY = 1000.0


class Problem(base.Problem):
    """A plate in its first transverse mode: period against linear elasticity, and damping."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.eos": {"name": "tait", "rho_0": DENSITY, "c_0": math.sqrt(BULK / DENSITY)},
        "physics.strength": {"name": "elastic", "shear_modulus": SHEAR},
        "physics.balsara": False,  # viscosity must damp the zero-energy modes of a bent lattice
        "physics.q_b": 0.3,
        "time.end": 0.4,
        "output.interval": 0.065,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-5, "measured: 6e-7, errors of the time step"),
        "period_error": base.Limit(
            0.03, "measured: 0.010, most of it by gradients at order 0, which no N removes"
        ),
        "damping": base.Limit(0.12, "measured: 0.073 a period, by viscosity"),
    }
    profiled: ClassVar = False
    quantities: ClassVar = {
        "tip_displacement": Quantity(
            "mean of y over the last column of particles of the plate", units.LENGTH
        ),
        "period": Quantity("period of the oscillation, by least squares", units.TIME),
        "period_exact": Quantity("period of linear elasticity with jaws", units.TIME),
        "period_error": Quantity("relative error, absolute: period over period_exact, minus 1"),
        "thin_plate_period": Quantity(
            "period of thin plates clamped at x = 0, in theory", units.TIME
        ),
        "damping": Quantity("part of the amplitude that is lost in a period"),
        "amplitude": Quantity("largest |tip_displacement|", units.LENGTH),
    }

    name: Literal["oscillating_plate"] = "oscillating_plate"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: int = Field(
        default=1448,
        ge=100,
        le=100_000_000,
        description="number of particles of plate and jaws; the height has the even number of rows "
        "whose particles are nearest to n",
    )
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[[-0.1, 0.25], [-0.1, 0.1]]
    )
    boundary: Literal["open"] = Field(default="open", description="nothing outside, on all sides")
    length: float = Field(default=0.2, gt=0.0, description="length of the free part of the plate")
    height: float = Field(default=0.02, gt=0.0, description="height (thickness) of the plate")
    held: float = Field(
        default=0.05,
        gt=0.0,
        description="length in the jaws, which hold the plate above, below and at its end",
    )
    tip_velocity: float = Field(
        default=0.01,
        description="velocity of the free end along y at t = 0, in the shape of the first mode of "
        "a thin plate",
    )

    _material: plate.Material = PrivateAttr(default=plate.Material(DENSITY, BULK, SHEAR))
    _layers: int = PrivateAttr(default=3)

    @model_validator(mode="after")
    def _has_length_of_a_plate(self):
        if not self.length >= 2.0 * self.height:
            raise ValueError(
                f"length = {self.length:g}: expected at least twice the height, {self.height:g}"
            )
        return self

    def under(self, physics):
        """Return the problem with its material, and jaws as thick as the supports of the plate."""
        eos, strength = solids.required(physics)
        found = self.model_copy()
        found._material = plate.Material(eos.rho_0, eos.rho_0 * eos.c_0**2, strength.shear_modulus)
        found._layers = math.ceil(2.0 * physics.spacing_ratio)  # H = 2 d, in spacings
        return found

    @property
    def rows(self) -> int:
        """The number of rows of particles across the height of the plate."""
        area = self.height * (self.length + self.held)
        most = round(self.height * math.sqrt(self.n / area)) + 1
        even = range(2, 2 * most + 1, 2)
        return min(even, key=lambda rows: (abs(self._count(rows) - self.n), rows))

    def _columns(self, rows: int) -> tuple[int, int]:
        """Return the numbers of columns of the free part, and in the jaws."""
        per_length = rows / self.height
        return max(1, round(per_length * self.length)), max(1, round(per_length * self.held))

    def _count(self, rows: int) -> int:
        """Return the number of particles of a plate with `rows` rows, with the jaws."""
        free, held = self._columns(rows)
        layers = self._layers
        return (free + held) * rows + 2 * layers * held + layers * (rows + 2 * layers)

    def initial(self, eos) -> base.InitialState:
        """Return a square lattice: the jaws first, then the plate, its free end last."""
        rows, layers = self.rows, self._layers
        free, held = self._columns(rows)
        across, along = self.height / rows, self.length / free
        lattice = placement.grid(
            np.array([
                [-(held + layers) * along, self.length],
                [-0.5 * self.height - layers * across, 0.5 * self.height + layers * across],
            ]),
            "cubic",
            (held + layers + free, rows + 2 * layers),
        )  # fmt: skip
        x, y = lattice
        in_plate = (np.abs(y) < 0.5 * self.height) & (x > -held * along)
        in_jaws = ~in_plate & (x < 0.0)
        order = np.concatenate([np.flatnonzero(in_jaws), np.flatnonzero(in_plate)])
        position = np.ascontiguousarray(lattice[:, order])
        clamped = in_jaws[order].astype(float)
        density = np.full(order.size, self._material.density)
        return base.InitialState(
            position,
            self._velocity(position, clamped),
            density * along * across,
            np.zeros(order.size),
            {"density": density, "clamped": clamped},
        )

    def _velocity(self, position: np.ndarray, clamped: np.ndarray) -> np.ndarray:
        """Return the first mode of a thin plate: sections turn, and remain normal to the axis."""
        x, y = position
        deflection, slope = plate.shape(x / self.length)
        moving = self.tip_velocity * (1.0 - clamped)
        return moving * np.array([-y * slope / self.length, deflection])

    @property
    def clamps(self) -> bool:
        return True

    def fills_box(self, eos) -> bool:
        return False

    @property
    def period(self) -> float:
        """The period by linear elasticity."""
        return plate.held_period(self.length, self.height, self.held, self._material)

    def diagnostics(self, particles) -> dict[str, float]:
        """Return tip_displacement: mean of y over the last column of the plate."""
        tip = particles.id > particles.number - self.rows
        return {"tip_displacement": float(particles.position[1, tip].mean())}

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return the displacement of the free end without damping."""
        if self.tip_velocity == 0.0:
            return {}
        frequency = 2.0 * math.pi / self.period
        return {"tip_displacement": self.tip_velocity / frequency * np.sin(frequency * times)}

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return the period, its relative error (absolute value), and the damping.

        period_exact: by linear elasticity with jaws; thin_plate_period: by the theory of thin
        plates clamped at x = 0. damping: part of the amplitude lost in a period. Empty if the
        history is shorter than one and a half periods.
        """
        if self.tip_velocity == 0.0:
            return {}
        exact = self.period
        displacement = history["tip_displacement"]
        found = oscillation.fit(history["t"], displacement, 2.0 * math.pi / exact)
        if found is None:
            return {}
        return {
            "period": found.period,
            "period_exact": exact,
            "period_error": abs(found.period / exact - 1.0),
            "thin_plate_period": plate.thin_period(self.length, self.height, self._material),
            "damping": -math.expm1(-found.damping * found.period),
            "amplitude": float(np.abs(displacement).max()),
        }
