"""What every problem has: shared keys, and the questions the program asks of a problem."""

import math
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Boundary = Literal["periodic", "mirror", "open"]


class InitialState(NamedTuple):
    """Particles at t = 0, code units."""

    position: np.ndarray  # (D, N)
    velocity: np.ndarray  # (D, N)
    mass: np.ndarray  # (N,)
    internal_energy: np.ndarray  # (N,) per unit mass


class Limit(NamedTuple):
    """A figure of the summary that must stay below `bound`, with the reason for the number.

    Or, with `at_least`, not fall below it.
    """

    bound: float
    reason: str
    at_least: bool = False

    def holds(self, value: float) -> bool:
        """Whether `value` is within; NaN never is."""
        return value >= self.bound if self.at_least else value <= self.bound


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
      swamped    figures beyond whose bound the problem's small signal is lost in numerical noise
      truth      what `exact` is, in words and as the label of a line: an exact solution, or a
                 reference that another method computes
      profiled   whether profiles over x, or that distance, show the solution; maps do else
    """

    restart: ClassVar[str | None] = "refused"
    defaults: ClassVar[dict[str, Any]] = {}
    limits: ClassVar[dict[str, Limit]] = {}
    ideal_gas: ClassVar[bool] = False
    radial: ClassVar[bool] = False
    swamped: ClassVar[dict[str, Limit]] = {}
    truth: ClassVar[tuple[str, str]] = ("the exact solution", "exact")
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
        if isinstance(self.boundary, str):
            return (self.boundary,) * self.dimension
        return tuple(self.boundary)

    @property
    def centre(self) -> np.ndarray:
        """(D,) the middle of the box."""
        return self.box.mean(axis=1)

    def fills_box(self, eos) -> bool:
        """Whether gas fills the box at all times: in a closed one, sum m/rho is then its volume."""
        return True

    def allowed(self) -> dict[str, Limit]:
        """The limits that a run of this very configuration must keep, or its summary warns."""
        return self.limits

    @property
    def gamma_below(self) -> float:
        """What gamma must stay below for the problem to have its solution."""
        return math.inf

    def initial(self, eos) -> InitialState:
        """The particles at t = 0 for that equation of state."""
        raise NotImplementedError

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Exact density, velocity (D, N), pressure, internal_energy at (D, N) points, or None.

        Callers ask `sph.analysis.truth` first, which knows where it does not hold.
        """
        return None

    def departs(self, physics) -> str | None:
        """Why this physics is not that of the exact solution and of the theory, or None.

        physics: the table of that name of the configuration.
        """
        return other_physics(physics, "external", "heating")

    def exact_ends(self, eos) -> tuple[float, str]:
        """The time until which `exact` holds, and what ends it: the words after "when"."""
        return math.inf, ""

    def undisturbed(self, eos, time: float) -> np.ndarray:
        """(D, 2): between which ends along each axis no wave from the domain's ends has come.

        Infinite along an axis whose ends send none. `exact` holds there alone.
        """
        return np.tile([-math.inf, math.inf], (self.dimension, 1))

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """(N,) mask of the particles over which errors are taken, and that region in words."""
        return np.ones(position.shape[1], dtype=bool), "the whole domain"

    def diagnostics(self, particles) -> dict[str, float]:
        """Further columns of the history, e.g. a mode's amplitude; the same keys at every step."""
        return {}

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Further figures of the summary at the end of a run that need no exact solution."""
        return {}

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Figures beside the exact solution, or beside theory: asked for where these hold alone."""
        return {}

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """What theory says of columns of the history at `times` (M,), rising: drawn beside them.

        Asked for where the physics does not depart from that of the theory alone.
        """
        return {}

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Figures from the whole history, whose columns are (steps,), e.g. a rate of growth.

        Asked for where the physics does not depart from that of the theory alone.
        """
        return {}


def other_physics(physics, *keys: str) -> str | None:
    """That the first of the keys of [physics] that is given is not in the exact solution."""
    for key in keys:
        if getattr(physics, key) is not None:
            return f"the exact solution is that of gas without physics.{key}"
    return None


def wide(least: float) -> AfterValidator:
    """Annotates the domain of a vortex that a narrower periodic box would cut."""

    def check(domain):
        try:
            widths = np.diff(np.array(domain, dtype=float))
        except ValueError:  # rows of different lengths: the configuration says so of every problem
            return domain
        if np.any(widths < least):
            raise ValueError(f"{domain} is narrower than the vortex: expected at least {least:g}")
        return domain

    return AfterValidator(check)


def only(domain: list[float]) -> AfterValidator:
    """Annotates the domain of a problem that is set up for no other."""

    def check(given):
        if given not in (domain, [domain, domain]):
            raise ValueError(f"this problem is set up for {domain} along both axes only")
        return given

    return AfterValidator(check)
