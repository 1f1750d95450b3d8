"""The protocol of a part: a piece of physics with its state, passes, bounds, sums and keys.

A formulation (`sph.formulations`) is the part that every scene has one of; optional physics are the
folders of `sph.parts`. Each hook below has a default that does nothing, so a part defines what it
has and nothing else. The simulation, checkpoints, history, errors and the configuration follow what
is declared here and know no physics.
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
    """How a quantity moves in time, in place, on arrays of any one rank.

    predict(dt, value, rate, mass, predicted): half a step into value, a full step into predicted;
    correct(dt, value, rate, mass): the second half with the new rate. Both return the energy that
    the quantity was given beyond its rate, summed over particles.
    """

    predict: Callable[..., float]
    correct: Callable[..., float]


class Evolved(NamedTuple):
    """A field that moves in time with a rate: names of fields, and its rule (`leapfrog`)."""

    value: str
    rate: str
    predicted: str
    rule: Rule


# When in a step a pass runs: density and what follows from it, gradients between density and
# rates, the rates, and what is added to them.
STAGES = ("density", "gradients", "rates", "additions")


class Pass(NamedTuple):
    """Work over all particles between prediction and correction.

    run(sweep) does it (`sph.passes.Sweep`). `reads` and `writes` name fields: of those it writes,
    every value. A field that a step writes before it reads it is not carried along by a new order.
    """

    stage: str
    phase: str  # of the clock
    run: Callable[[Any], None]
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    widens: bool = False  # may ask for wider lists, and is then run again
    at_start: bool = True  # also before the first step, which has no past


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
        """The part as the scene's configuration asks for it, None where it does not."""
        raise NotImplementedError

    @classmethod
    def issues(cls, physics, problem) -> list[tuple[str, str]]:
        """(key, what is wrong) of settings that are valid each by itself but not together."""
        return []

    def described(self) -> tuple[list[str], list[tuple[str, str]]]:
        """In words what it has compiled in, and (what, why) of what it leaves out."""
        return [self.title], []

    # --- state ---

    def start(self, state: State) -> None:
        """Set the part's own fields of the initial state, which are zeros."""

    def remake(self, state: State, missing: list[str]) -> None:
        """Fill fields that the state of a checkpoint lacks, which are zeros."""

    # --- a step ---

    def split(self, state: State, dt: float) -> float:
        """Act by itself for a time dt, half a step, at either end of each step (Strang 1968).

        For sources so stiff that they would bound the step. Returns the energy added.
        """
        return 0.0

    def split_predicted(self, state: State, dt: float) -> None:
        """The same on predicted values, in which the end of the step is to show."""

    def largest_courant(self) -> tuple[float, str]:
        """The Courant number above which the leapfrog is unstable with it, and a criterion."""
        return np.inf, ""

    def step_limit(self, state: State) -> np.ndarray | None:
        """(N,) the longest step that each particle allows, or None. The criterion is `name`."""
        return None

    # --- what the history records ---

    def energies(self, state: State) -> dict[str, np.ndarray]:
        """Energies per unit mass (N,) that belong to the total energy, by column of the history."""
        return {}

    def sums(self, state: State) -> dict[str, float]:
        """Further columns of the history."""
        return {}

    # --- faults ---

    def check(self, simulation) -> None:
        """Raise NumericalError where the state is unphysical in a way that the part knows."""

    def criterion_words(self, criterion: str) -> str | None:
        """How a particle sets the step by that criterion, in words, if the part brought it."""
        return f"the limit of physics.{self.name}" if criterion == self.name else None

    def held_words(self, criterion: str) -> str | None:
        """What holds the Courant number by that criterion, in words, if the part does."""
        return None

    def remedies(self, trouble: str, held_by: str) -> list[str]:
        """What to try against "long steps", "short steps", "drift" or "endless energy".

        held_by: the criterion that sets the Courant number or, for short steps, the step.
        """
        return []
