"""Steady-state test: gas at rest at uniform pressure, with a large density contrast.

The density changes at a step, or exponentially across the box. It is represented by masses of
evenly spaced particles, or by the spacing of particles of equal mass. (For a step between particles
of equal mass, use `shock_tube` with equal pressures.)
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from sph.problems import base
from sph.problems.support import lattice as placement
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

FEWEST_ACROSS = 4  # a support radius is three spacings at eta = 1.6, and must not exceed the box


class Problem(base.Problem):
    """Gas at rest with a large density contrast along x: a steady-state test of contacts."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "physics.density": "number",
        "time.end": 0.005,
        "output.interval": 0.001,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-6, "gas at rest: du/dt is of second order in the small velocities"
        ),
        "mach_number": base.Limit(0.05, "velocities from pressure errors of a few per cent"),
        "pressure_error": base.Limit(
            0.25,
            "kernels smooth the kink of the density at a mirror: 20 % there, 1 % in the L1 norm",
        ),
    }
    quantities: ClassVar = {
        "mach_number": Quantity("largest ratio of velocity to local speed of sound"),
        "density_ratio": Quantity("largest over smallest density"),
        "support_ratio": Quantity("largest over smallest support radius"),
        "pressure_error": Quantity("largest |P/P_0 - 1|"),
    }
    title: ClassVar = "density contrast at rest"

    name: Literal["contrast"] = "contrast"
    dimension: Annotated[int, _SHARED["dimension"]] = 1
    n: Annotated[int, _SHARED["n"]] = 200
    domain: list[float] | list[list[float]] = Field(
        default=[0.0, 1.0],
        description="ends of the box: [lo, hi] for all axes, or a list with one [lo, hi] per axis",
    )
    boundary: Literal["mirror"] = Field(
        default="mirror", description="reflecting walls along x; y and z are periodic"
    )
    ratio: float = Field(default=1e6, gt=1, description="largest density divided by smallest")
    profile: Literal["step", "graded"] = Field(
        default="step",
        description='"step": the density falls at the middle of x; "graded": the density falls '
        "exponentially along x",
    )
    masses: Literal["equal", "equal_spacing"] = Field(
        default="equal_spacing",
        description='"equal": equal masses, with spacings that follow the density (only with '
        'profile = "graded"); "equal_spacing": equal spacings, with masses that follow the density',
    )
    pressure: float = Field(default=1.0, gt=0.0, description="uniform pressure")

    @model_validator(mode="after")
    def _holds_the_thin_gas(self):
        if self.masses == "equal" and self.profile == "step":
            raise ValueError(
                'masses = "equal": expected profile = "graded". Try: for a step between particles '
                "of equal mass, shock_tube with equal pressures on both sides"
            )
        if self.masses == "equal" and self._fewest_across() < FEWEST_ACROSS and self._is_box():
            raise ValueError(
                f"n = {self.n}: with equal masses the box is only {self._fewest_across()} spacings "
                f"of the thinnest gas wide; expected {FEWEST_ACROSS}. Try: more particles, a "
                'smaller ratio, or masses = "equal_spacing"'
            )
        return self

    def _is_box(self) -> bool:
        domain = np.array(self.domain, dtype=object)
        return domain.shape in [(2,), (self.dimension, 2)]

    @property
    def boundaries(self) -> tuple[str, ...]:
        return ("mirror",) + ("periodic",) * (self.dimension - 1)

    def initial(self, eos) -> base.InitialState:
        """Return particles on a cubic lattice or in layers. The largest density is 1."""
        if self.masses == "equal":
            position = self._layers()
            n = position.shape[1]
            mass = np.full(n, self._mass(1.0) * self._volume() / n)
        else:
            position = placement.fill(self.box, self.n, "cubic")
            n = position.shape[1]
            mass = self._density(position) * np.prod(np.diff(self.box)) / n
        state = self.exact(eos, 0.0, position)
        return base.InitialState(position, state["velocity"], mass, state["internal_energy"])

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the initial state at (D, N) positions, which is steady."""
        density = self._density(position)
        pressure = np.full(density.size, self.pressure)
        return {
            "density": density,
            "velocity": np.zeros_like(position),
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return mach_number, density_ratio and support_ratio.

        mach_number: largest ratio of velocity to local sound speed; the others: largest density
        or support radius over the smallest.
        """
        speed = np.sqrt((particles.velocity**2).sum(axis=0))
        sound = eos.sound_speed(particles.density, pressure)
        return {
            "mach_number": float((speed / sound).max()),
            "density_ratio": float(particles.density.max() / particles.density.min()),
            "support_ratio": float(particles.support.max() / particles.support.min()),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return pressure_error: the largest |P/P_0 - 1|."""
        return {"pressure_error": float(np.abs(pressure / self.pressure - 1.0).max())}

    # --- the profile, with s = 0 to 1 along x ---

    def _along(self, x):
        low, high = self.box[0]
        return (x - low) / (high - low)

    def _density(self, position: np.ndarray) -> np.ndarray:
        s = self._along(position[0])
        if self.profile == "step":
            return np.where(s < 0.5, 1.0, 1.0 / self.ratio)
        return self.ratio**-s

    def _mass(self, s):
        """Return the mass of graded gas below s, for unit cross section and length."""
        return (1.0 - self.ratio**-s) / np.log(self.ratio)

    def _place(self, mass):
        """Return s at which `_mass` is `mass`."""
        return -np.log1p(-mass * np.log(self.ratio)) / np.log(self.ratio)

    # --- layers of particles of equal mass ---

    def _volume(self) -> float:
        """Return the volume of the box."""
        return float(np.prod(np.diff(self.box)))

    def _fewest_across(self) -> int:
        """Return the number of spacings of the thinnest gas along the shortest axis."""
        thinnest = self._mass(1.0) * self._volume() / self.n * self.ratio
        return int(np.diff(self.box).min() / thinnest ** (1.0 / self.dimension))

    def _layers(self) -> np.ndarray:
        """Return positions (D, N) of about n particles of equal mass, in layers across x.

        Each layer has whole numbers of particles across and contains their mass. Masses are scaled
        slightly so that the last layer ends at the end of the box.
        """
        widths = np.diff(self.box)[1:, 0]
        total = self._mass(1.0)
        counts, below = [], [0.0]
        while below[-1] < total * (1.0 - 1e-12):
            density = self.ratio ** -self._place(below[-1])
            spacing = (total * self._volume() / (self.n * density)) ** (1.0 / self.dimension)
            across = tuple(int(max(1, round(width / spacing))) for width in widths)
            counts.append(across)
            below.append(below[-1] + total / self.n * float(np.prod(across)))
        if len(counts) > 1 and below[-1] - total > 0.5 * (below[-1] - below[-2]):
            counts.pop(), below.pop()  # the last layer would be less than half full
        edges = np.array(below) * (total / below[-1])
        middles = self._x(self._place(0.5 * (edges[1:] + edges[:-1])))
        return np.hstack(
            [self._layer(x, across) for x, across in zip(middles, counts, strict=True)]
        )

    def _layer(self, x: float, across: tuple[int, ...]) -> np.ndarray:
        """Return positions of a layer at x, a grid of `across` cells."""
        if not across:
            return np.array([[x]])
        in_layer = placement.grid(self.box[1:], "cubic", across)
        return np.vstack([np.full(in_layer.shape[1], x), in_layer])

    def _x(self, s):
        low, high = self.box[0]
        return low + s * (high - low)
