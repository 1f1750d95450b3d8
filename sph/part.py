"""The protocol of a part: a piece of physics with its fields, passes, limits, sums and keys.

Every scene has one formulation (`sph.formulations`), which is a part, and optional parts, the
folders of `sph.parts`. Each method below has a default that does nothing, so a part defines only
what it needs. The simulation, checkpoints, history, errors and configuration use these declarations
and contain no physics.
"""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from sph.state import Field, State


class Key(NamedTuple):
    """A key of [physics]: its help text, type, default, bounds and class in a restart.

    kind: the type of a plain value, such as float or Literal["mass", "number"]; None where only a
    model may be given. models: the folder whose files may be named, with their parameters in a
    table; label: the entry of that table that holds the name. With a `default` of None and no
    value given the part is left out. restart: a name of `sph.config.restarts.CLASSES`.
    """

    name: str
    help: str
    kind: Any = None
    default: Any = None
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    models: str = ""
    label: str = "name"
    default_model: str = ""  # of a table that does not name one
    label_help: str = ""
    example: Any = None
    restart: str = "recorded"


class Rule(NamedTuple):
    """Time integration of a quantity, in place, for arrays of equal shape.

    predict(dt, value, rate, mass, predicted): half a step in value, a full step in predicted;
    correct(dt, value, rate, mass): the second half step with the new rate. Both return the energy
    added beyond the rate, summed over particles.
    """

    predict: Callable[..., float]
    correct: Callable[..., float]


class Evolved(NamedTuple):
    """A field that is integrated in time: names of its fields, and its rule (`leapfrog`)."""

    value: str
    rate: str
    predicted: str
    rule: Rule


# When in a step a pass runs: density and what follows from it, gradients between density and
# rates, the rates, and what is added to them.
STAGES = ("density", "gradients", "rates", "additions")


class Pass(NamedTuple):
    """A computation over all particles between prediction and correction.

    run(sweep) performs it (`sph.passes.Sweep`). `reads` and `writes` name fields; every value of a
    written field is set. Fields that a step writes before reading are not reordered.
    """

    stage: str
    phase: str  # of the clock
    run: Callable[[Any], None]
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    widens: bool = False  # may request wider lists, and is then repeated
    at_start: bool = True  # also run before the first step


class Part:
    """Optional physics, or a formulation. `name` is that of its folder."""

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""  # in the lists of what is compiled in and left out
    keys: ClassVar[tuple[Key, ...]] = ()
    formulations: ClassVar[tuple[str, ...]] = ()  # that it can join; empty: every one
    # Whether an exact solution without the part stays the solution with it (numerical terms do).
    changes_solution: ClassVar[bool] = True
    # Whether pressure varies in equilibrium with it.
    balances_pressure: ClassVar[bool] = False

    fields: tuple[Field, ...] = ()
    evolved: tuple[Evolved, ...] = ()
    passes: tuple[Pass, ...] = ()
    terms: Mapping[str, Any] = {}  # models that the formulation's pair loops call, by their role
    needs: tuple[str, ...] = ()  # fields that it asks the formulation for
    columns: tuple[str, ...] = ()  # of the history: the names in `energies` and `sums`
    keeps_momentum: bool = True
    bounds_acceleration: bool = False  # whether |a| bounds the step
    adds_energy: bool = False  # whether `split` may

    # --- configuration ---

    @classmethod
    def of(cls, scene) -> "Part | None":
        """Return the part for the scene's configuration, or None if it is not used."""
        raise NotImplementedError

    @classmethod
    def issues(cls, physics, problem) -> list[tuple[str, str]]:
        """Return (key, message) for settings that are valid by themselves but not together."""
        return []

    def described(self) -> tuple[list[str], list[tuple[str, str]]]:
        """Return descriptions of what is compiled, and (what, why) of what is left out."""
        return [self.title], []

    # --- state ---

    def start(self, state: State) -> None:
        """Set the part's own fields of the initial state, which are zeros."""

    def remake(self, state: State, missing: list[str]) -> None:
        """Set the fields `missing` in a checkpoint, which are zeros."""

    # --- a step ---

    def split(self, state: State, dt: float) -> float:
        """Advance the state by this part alone for dt, half a step (Strang splitting).

        Called at the beginning and end of each step, for sources that would limit the step. Returns
        the energy added.
        """
        return 0.0

    def split_predicted(self, state: State, dt: float) -> None:
        """Apply `split` to the predicted values."""

    def largest_courant(self) -> tuple[float, str]:
        """Return the Courant number above which this part is unstable, and its criterion."""
        return np.inf, ""

    def step_limit(self, state: State) -> np.ndarray | None:
        """Return the longest step (N,) that each particle allows, or None; criterion `name`."""
        return None

    # --- what the history records ---

    def energies(self, state: State) -> dict[str, np.ndarray]:
        """Return energies per unit mass (N,) in the total energy, by column of the history."""
        return {}

    def sums(self, state: State) -> dict[str, float]:
        """Return additional columns of the history."""
        return {}

    # --- faults ---

    def check(self, simulation) -> None:
        """Raise NumericalError if the state is unphysical for this part."""

    def criterion_words(self, criterion: str) -> str | None:
        """Return a description of a criterion of this part, or None for other criteria."""
        return f"the limit of physics.{self.name}" if criterion == self.name else None

    def held_words(self, criterion: str) -> str | None:
        """Return what reduces the Courant number by that criterion, or None for others."""
        return None

    def remedies(self, trouble: str, held_by: str) -> list[str]:
        """Return what to try against "long steps", "short steps", "drift" or "endless energy".

        held_by: the criterion that sets the Courant number or, for short steps, the step.
        """
        return []
