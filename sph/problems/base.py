"""Base class of all problems: the shared keys, and the methods that the program calls."""

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from sph.quantity import Quantity

Boundary = Literal["periodic", "mirror", "open"]
# Units of length, mass and time in cm, g and s.
Units = tuple[float, float, float]


class Relaxation(NamedTuple):
    """How relaxation to a glass ended (eqs 460 and 461)."""

    iterations: int
    density_error: float  # rms scatter of the density sums about their mean, over that mean
    mean_offset: float  # mean of the density sums over the density of the scene, minus 1


class InitialState(NamedTuple):
    """Particles at t = 0, code units."""

    position: np.ndarray  # (D, N)
    velocity: np.ndarray  # (D, N)
    mass: np.ndarray  # (N,)
    internal_energy: np.ndarray  # (N,) per unit mass
    # initial values of further fields, (N,) each, such as the density; ignored where a scene has no
    # field of that name
    others: Mapping[str, np.ndarray] = MappingProxyType({})
    relaxation: Relaxation | None = None  # of particles that were relaxed to a glass

    @property
    def particles(self) -> tuple:
        """What `State.at_start` takes."""
        return self[:5]


class Limit(NamedTuple):
    """A limit on a number in the summary: at most `bound`, or at least `bound` if `at_least`.

    reason: why the limit has this value; shown to the user.
    """

    bound: float
    reason: str
    at_least: bool = False

    def holds(self, value: float) -> bool:
        """Return whether `value` is within the limit; False for NaN."""
        return value >= self.bound if self.at_least else value <= self.bound


class Fault(NamedTuple):
    """An error in a key of [problem]: its path there, e.g. ("body", 2, "material"), and the text
    that follows the key's name in the message.
    """

    path: tuple[str | int, ...]
    text: str


def refused(faults: Iterable[Fault]) -> PydanticCustomError:
    """Return an error to raise in a validator, or in `Problem.under`, that names several keys."""
    return PydanticCustomError("issues", "{issues}", {"issues": list(faults)})


class Section(BaseModel):
    """A table of the configuration, with strict types, no unknown keys, and immutable.

    restart: the class of all its keys in a restart (`sph.config.restarts`); None if each key
    declares its own.
    """

    restart: ClassVar[str | None] = None

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, validate_default=True)


class Problem(Section):
    """Keys shared by all problems. The file of a problem gives its own defaults for them.

    Class attributes that a problem may set:
      defaults   defaults of keys in other tables, e.g. {"physics.gamma": 1.4}
      limits     limits on numbers in the summary ("energy_drift", "l1.density", …) for the shipped
                 configuration
      ideal_gas  whether the problem requires an ideal gas
      radial     whether, in 2-D and 3-D, the solution depends only on the distance from `centre`
      swamped    limits beyond which the problem's small signal is lost in numerical noise
      truth      what `exact` returns, as a phrase and as a label in figures: an exact solution, or
                 a reference solution from another method
      paths      keys that name a file; a relative path in a configuration file begins at the
                 directory of that file
      filled_in  keys that `filled` adds; templates show them as comments
      profiled   whether figures show profiles over x or over the distance; otherwise, maps
      quantities meaning and unit of the columns of `diagnostics` and of the figures of `report`,
                 `compare` and `over_time`, by name; see `sph.quantity.meaning`
      profiles   the four fields of these profiles; solids have "stress", which is -sigma_xx
      title      name of the problem in figures; if empty, the key `name` without underscores
    """

    restart: ClassVar[str | None] = "refused"
    defaults: ClassVar[dict[str, Any]] = {}
    limits: ClassVar[dict[str, Limit]] = {}
    ideal_gas: ClassVar[bool] = False
    radial: ClassVar[bool] = False
    swamped: ClassVar[dict[str, Limit]] = {}
    quantities: ClassVar[Mapping[str, Quantity]] = {}
    truth: ClassVar[tuple[str, str]] = ("the exact solution", "exact")
    paths: ClassVar[tuple[str, ...]] = ()
    filled_in: ClassVar[tuple[str, ...]] = ()
    profiled: ClassVar[bool] = True
    profiles: ClassVar[tuple[str, ...]] = ("density", "velocity", "pressure", "internal_energy")
    title: ClassVar[str] = ""

    name: str = Field(description="name of the problem; `sph list` shows all problems")
    dimension: int = Field(ge=1, le=3, description="number of space dimensions")
    n: int = Field(
        ge=2,
        le=100_000_000,
        description="number of particles; the lattice uses the nearest number that fits",
    )
    domain: list[float] | list[list[float]] = Field(
        description="ends of the box: [lo, hi] for all axes, or a list with one [lo, hi] per axis",
        examples=[[0.0, 1.0]],
    )
    boundary: Boundary | list[Boundary] = Field(
        description='"periodic", "mirror" (reflecting wall) or "open" (vacuum outside) for all '
        "axes, or a list with one per axis"
    )

    @classmethod
    def filled(
        cls, keys: dict[str, Any], units: Units | None = None
    ) -> tuple[dict[str, Any], list[Fault]]:
        """Return the keys with those that the problem finds elsewhere, and faults of given keys.

        keys: the table [problem] before validation; units: as of `in_units`. Raises FileError for a
        file that is missing or wrong.
        """
        return keys, []

    @property
    def box(self) -> np.ndarray:
        """(D, 2) lower and upper ends of the domain along each axis."""
        domain = np.array(self.domain, dtype=float)
        return np.tile(domain, (self.dimension, 1)) if domain.ndim == 1 else domain

    @property
    def boundaries(self) -> tuple[str, ...]:
        """The boundary of each axis, D names."""
        if isinstance(self.boundary, str):
            return (self.boundary,) * self.dimension
        return tuple(self.boundary)

    @property
    def centre(self) -> np.ndarray:
        """(D,) centre of the box."""
        return self.box.mean(axis=1)

    @property
    def drift(self) -> np.ndarray:
        """(D,) uniform velocity of the centre of a radial solution."""
        return np.zeros(self.dimension)

    def under(self, physics):
        """Return the problem with what it takes from [physics], such as the constant G of gravity.

        The configuration calls this once. Raises ValueError, with a message that begins with a key
        of [physics], if the problem cannot be set up under these physics, or `refused` if keys of
        [problem] do not match them.
        """
        return self

    def in_units(self, units: Units | None):
        """Return the problem with what it takes from [units].

        units: of length, mass and time in cm, g and s, or None without [units]. The configuration
        calls this once.
        """
        return self

    def remarks(self) -> list[str]:
        """Return what a run says about the problem at its start, one text each."""
        return []

    @property
    def clamps(self) -> bool:
        """Whether some particles are clamped (field "clamped" of the initial state)."""
        return False

    def fills_box(self, eos) -> bool:
        """Return whether gas fills the box at all times, so that sum m/rho equals its volume."""
        return True

    def allowed(self) -> dict[str, Limit]:
        """Return the limits that apply to a run with these keys; the summary warns if exceeded."""
        return self.limits

    @property
    def gamma_below(self) -> float:
        """Upper bound (exclusive) of gamma, above which the exact solution does not exist."""
        return math.inf

    def initial(self, eos) -> InitialState:
        """Return the particles at t = 0 for the equation of state `eos`."""
        raise NotImplementedError

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Return exact density (N,), velocity (D, N), pressure and internal_energy (N,), or None.

        position: (D, N) points. Solids add "stress", -sigma_xx (N,). Callers use
        `sph.analysis.truth`, which checks where the exact solution is valid.
        """
        return None

    @property
    def has_exact(self) -> bool:
        """Whether there is an `exact` of this problem, which may return None for some keys."""
        return type(self).exact is not Problem.exact

    def departs(self, physics) -> str | None:
        """Return why the exact solution and the theory do not apply to [physics], or None.

        physics: the table of that name of the configuration.
        """
        return other_physics(physics)

    def exact_ends(self, eos) -> tuple[float, str]:
        """Return the time until which `exact` is valid, and the reason, which completes "when"."""
        return math.inf, ""

    def undisturbed(self, eos, time: float) -> np.ndarray:
        """Return (D, 2), the range of each axis not yet reached by waves from the domain's ends.

        Infinite along an axis whose ends send no waves. `exact` is valid only in this range.
        """
        return np.tile([-math.inf, math.inf], (self.dimension, 1))

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return a mask (N,) of the particles over which errors are averaged, and its name."""
        return np.ones(position.shape[1], dtype=bool), "the whole domain"

    def diagnostics(self, particles) -> dict[str, float]:
        """Return additional columns of the history, e.g. the amplitude of a mode.

        The keys must be the same at every step.
        """
        return {}

    @property
    def has_diagnostics(self) -> bool:
        """Whether `diagnostics` returns columns."""
        return type(self).diagnostics is not Problem.diagnostics

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return additional numbers for the summary that need no exact solution."""
        return {}

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return numbers that compare the result with the exact solution or theory.

        Called only if these are valid.
        """
        return {}

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return theoretical values of columns of the history at ascending `times` (M,).

        They are drawn in the figure of the history. Called only if `departs` returns None.
        """
        return {}

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return numbers computed from the history, whose columns are (steps,), e.g. a growth rate.

        Called only if `departs` returns None.
        """
        return {}


# The `profiles` of gas or solids that rotate about `centre` in 2-D.
ROTATION = ("density", "v_phi", "v_r", "pressure")


def other_physics(physics, besides: str = "") -> str | None:
    """Return that a given part of [physics], except `besides`, is not in the exact solution."""
    for key in physics.given(changes_solution=True):
        if key != besides:
            return f"the exact solution does not include physics.{key}"
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


def only(domain: list) -> AfterValidator:
    """Annotates the domain of a problem that is set up for no other: [lo, hi], or one per axis."""

    def check(given):
        if given not in (domain, [domain, domain]):
            axes = "" if isinstance(domain[0], list) else "along both axes "
            raise ValueError(f"this problem is set up for {domain} {axes}only")
        return given

    return AfterValidator(check)
