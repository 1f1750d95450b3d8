"""What every problem has: shared keys, and the questions the program asks of a problem."""

import math
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

Boundary = Literal["periodic", "mirror", "open"]


class InitialState(NamedTuple):
    """Particles at t = 0, code units."""

    position: np.ndarray  # (D, N)
    velocity: np.ndarray  # (D, N)
    mass: np.ndarray  # (N,)
    internal_energy: np.ndarray  # (N,) per unit mass


class Limit(NamedTuple):
    """A figure of the summary that must stay below `bound`, with the reason for the number."""

    bound: float
    reason: str


class Section(BaseModel):
    """A table of the configuration: strict about types and unknown keys, immutable once read.

    restart: the class of its keys in a restart (`sph.config.restarts`), unless a key has its own.
    """

    restart: ClassVar[str | None] = None

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, validate_default=True)


class Problem(Section):
    """Keys shared by all problems. A problem's file gives its own defaults for them.

    Class attributes a problem may set:
      defaults   this problem's defaults for keys of other tables, e.g. {"physics.gamma": 1.4}
      limits     figures of the summary ("energy_drift", "l1.density", …) that its shipped
                 configuration must keep, each with the reason for the number
      ideal_gas  whether its solution is that of an ideal gas, so that others are refused
      radial     whether, in 2-D and 3-D, the solution depends on the distance from `centre` alone
      profiled   whether profiles over x, or that distance, show the solution; maps do else
    """

    restart: ClassVar[str | None] = "refused"
    defaults: ClassVar[dict[str, Any]] = {}
    limits: ClassVar[dict[str, Limit]] = {}
    ideal_gas: ClassVar[bool] = False
    radial: ClassVar[bool] = False
    profiled: ClassVar[bool] = True

    name: str = Field(description="which problem: `sph list` names them")
    dimension: int = Field(ge=1, le=3, description="number of space dimensions")
    n: int = Field(
        ge=2, le=100_000_000, description="particles in all; the lattice takes the nearest it can"
    )
    domain: list[float] | list[list[float]] = Field(
        description="[lo, hi] for every axis alike, or one [lo, hi] per axis"
    )
    boundary: Boundary | list[Boundary] = Field(
        description='"periodic", "mirror" (reflecting wall) or "open"; a list for one per axis'
    )

    @property
    def box(self) -> np.ndarray:
        """(D, 2) lower and upper end of the domain along each axis."""
        domain = np.array(self.domain, dtype=float)
        return np.tile(domain, (self.dimension, 1)) if domain.ndim == 1 else domain

    @property
    def boundaries(self) -> tuple[str, ...]:
        """The boundary of each axis."""
        one = isinstance(self.boundary, str)
        return (self.boundary,) * self.dimension if one else tuple(self.boundary)

    @property
    def centre(self) -> np.ndarray:
        """(D,) the middle of the box."""
        return self.box.mean(axis=1)

    @property
    def gamma_below(self) -> float:
        """What gamma must stay below for the problem to have its solution."""
        return math.inf

    def initial(self, eos) -> InitialState:
        """The particles at t = 0 for that equation of state."""
        raise NotImplementedError

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Exact density, velocity (D, N), pressure, internal_energy at (D, N) points, or None."""
        return None

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """(N,) mask of the particles over which errors are taken, and that region in words."""
        return np.ones(position.shape[1], dtype=bool), "the whole domain"

    def diagnostics(self, particles) -> dict[str, float]:
        """Further columns of the history, e.g. a mode's amplitude; the same keys at every step."""
        return {}

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Further figures of the summary at the end of a run, e.g. a shock's radius."""
        return {}

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """What theory says of columns of the history at `times` (M,), rising: drawn beside them."""
        return {}

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """The same from the whole history, whose columns are (steps,), e.g. when a mode peaked."""
        return {}
