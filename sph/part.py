"""The protocol of a part: a piece of physics with its fields, passes, limits, sums and keys.

Every scene has one formulation (`sph.formulations`), which is also a part, and any number of
optional parts (the folders of `sph.parts`). Each method below has a default that does nothing, so a
part defines only the methods that it needs. The simulation, checkpoints, history, errors and
configuration call these methods and contain no physics themselves.
"""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from sph.quantity import Quantity
from sph.state import Field, State


class Key(NamedTuple):
    """A key of [physics]: its help text, type, default, bounds and class in a restart.

    kind: the type of a plain value, such as float or Literal["mass", "number"]; None if the value
    must be a model. models: the folder with the models that the value may name, alone or in a table
    with parameters; label: the entry of that table that holds the name. If `default` is None and
    the configuration gives no value, the run has no such part. restart: the class of the key in a
    restart, one of `sph.config.restarts.CLASSES`.
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
    default_model: str = ""  # for a table that names no model
    label_help: str = ""
    example: Any = None
    restart: str = "recorded"


class Rule(NamedTuple):
    """Time integration of a quantity, in place, for particles [first, last).

    predict(first, last, dt, value, rate, mass, predicted): advances `value` by half a step, and
    sets `predicted` to the value after a full step; correct(first, last, dt, value, rate, mass):
    advances `value` by the second half step, with the new rate. mass: (N,), other arrays: (rows,
    N), where a scalar has one row. Both functions return the energy that they added in addition to
    the rate, summed over these particles.

    With individual time steps: predict_each(first, last, since, own, value, rate, mass, predicted)
    sets `predicted` to the value a time `since` after the beginning of each particle's step, and
    advances `value` by half of `own`; correct_each(first, last, own, value, rate, mass) advances
    `value` by the second half. since, own: (N,); `own` is 0 for particles whose step has not ended.
    """

    predict: Callable[..., float]
    correct: Callable[..., float]
    predict_each: Callable[..., float]
    correct_each: Callable[..., float]


class Evolved(NamedTuple):
    """A field that is integrated in time: names of its fields, and its rule (`leapfrog`)."""

    value: str
    rate: str
    predicted: str
    rule: Rule


# The stages of a step, in order: prediction of inactive particles (individual steps);
# density and quantities that follow from it; gradients, which need the density; rates of change;
# additions to the rates; constraints on the rates; corrections of evolved fields at the end of the
# step, after `leapfrog.correct`.
STAGES = ("prediction", "density", "gradients", "rates", "additions", "constraints", "correction")


class Pass(NamedTuple):
    """A computation over all particles between prediction and correction, or after it (`stage`).

    `reads`, `updates` and `writes` name fields, or None in place of a field that the scene lacks.
    The arrays of these fields, in this order, are arguments of `function`, None for None:

        function(first, last, dim, models, neighbours, *arrays)    if Numba compiled it, for blocks
                                                                   [first, last) (`sph.passes`)
        function(*arrays)                                          otherwise, once for all particles
        function(sweep, *arrays)                                   otherwise, if `takes_sweep`; such
                                                                   a function calls compiled ones
                                                                   by `sph.passes.Sweep.run`

    The function must set every value of each field in `writes`, and changes arrays in place. A
    field that each step writes before it reads it is not reordered when the memory order of
    particles changes.
    """

    stage: str
    phase: str  # in the CPU seconds by phase (`sph.clock`)
    function: Callable[..., None]
    reads: tuple[str | None, ...]
    writes: tuple[str | None, ...] = ()
    updates: tuple[str | None, ...] = ()  # read and written
    swaps: tuple[str, str] | None = None  # two fields whose arrays are exchanged after the pass
    widens: bool = False  # takes `wanted` as last argument (`sph.passes.Sweep`)
    at_start: bool = True  # also run before the first step
    takes_step: bool = False  # takes the length of the step as last argument
    takes_sweep: bool = False  # an uncompiled function that takes the sweep as first argument
    models: Any = None  # those of the formulation, if None
    models_at_start: Any = None  # before the first step, if not the same

    @property
    def arrays(self) -> tuple[str | None, ...]:
        """The fields whose arrays are arguments, in order."""
        return (*self.reads, *self.updates, *self.writes)

    @property
    def fields_read(self) -> set[str]:
        return {name for name in (*self.reads, *self.updates) if name is not None}

    @property
    def fields_written(self) -> set[str]:
        names = (*self.updates, *self.writes, *(self.swaps or ()))
        return {name for name in names if name is not None}


# The methods of a part that each step calls in Python, unless they are those of `Part`.
IN_PYTHON = ("split", "split_predicted", "step_limit", "energies", "sums", "check")


class Part:
    """Optional physics, or a formulation. `name` is the name of its folder."""

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""  # for the lists of compiled and omitted physics (dry run, summary)
    # Fields that the part declares in some scenes only. No other part may declare them in any.
    reserves: ClassVar[tuple[str, ...]] = ()
    keys: ClassVar[tuple[Key, ...]] = ()
    formulations: ClassVar[tuple[str, ...]] = ()  # that the part works with; empty: all
    # Whether the part changes the exact solution. Numerical terms such as viscosity do not.
    changes_solution: ClassVar[bool] = True
    # Whether a force of this part balances a pressure gradient in equilibrium.
    balances_pressure: ClassVar[bool] = False

    fields: tuple[Field, ...] = ()
    evolved: tuple[Evolved, ...] = ()
    passes: tuple[Pass, ...] = ()
    terms: Mapping[str, Any] = {}  # models that the formulation's pair loops call, by their role
    needs: tuple[str, ...] = ()  # fields that the formulation must compute for this part
    # of the history, by the names in `energies` and `sums`
    columns: Mapping[str, Quantity] = {}
    keeps_momentum: bool = True
    exact_pairs: bool = True  # whether forces of pairs are equal and opposite to round-off
    bounds_acceleration: bool = False  # whether |a| bounds the step
    adds_energy: bool = False  # whether `split` may add energy
    idle: tuple[str, ...] = ()  # those methods of IN_PYTHON that do nothing in this scene

    def __init_subclass__(cls) -> None:
        cls.name = cls.__module__.rpartition(".")[2]
        cls.title = cls.title or cls.name.replace("_", " ")

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
        """Return descriptions of the compiled physics, and (what, why) for omitted physics."""
        return [self.title], []

    # --- state ---

    def start(self, state: State) -> None:
        """Set the part's own fields in the initial state; they are zero before the call."""

    def remake(self, state: State, missing: list[str]) -> None:
        """Set the fields that a checkpoint does not contain; they are zero before the call."""

    # --- a step ---

    def split(self, state: State, dt: float) -> float:
        """Advance the state by this part alone for dt, which is half a step (Strang splitting).

        For sources whose time scale is shorter than the time step. Called at the beginning and at
        the end of each step. Returns the energy added.
        """
        return 0.0

    def split_predicted(self, state: State, dt: float) -> None:
        """Apply `split` to the predicted values."""

    def largest_courant(self) -> tuple[float, str]:
        """Return the largest stable Courant number with this part, and the criterion's name."""
        return np.inf, ""

    def step_limit(self, state: State) -> np.ndarray | None:
        """Return the longest time step (N,) that each particle allows, or None for no limit.

        The criterion has the name of the part.
        """
        return None

    # --- columns of the history ---

    def energies(self, state: State) -> dict[str, np.ndarray]:
        """Return energies per unit mass (N,) by column; each is a part of the total energy."""
        return {}

    def sums(self, state: State) -> dict[str, float]:
        """Return additional columns of the history."""
        return {}

    # --- faults ---

    def check(self, simulation) -> None:
        """Raise NumericalError if the state is unphysical for this part."""

    def check_output(self, simulation) -> None:
        """Raise NumericalError for a state that no checkpoint should hold.

        Called before each checkpoint, for checks that take too long for each step.
        """

    @classmethod
    def criterion_words(cls, criterion: str) -> str | None:
        """Return a description of a criterion of this part, or None for other criteria."""
        return f"the limit of physics.{cls.name}" if criterion == cls.name else None

    def held_words(self, criterion: str) -> str | None:
        """Return which setting reduces the Courant number; None unless by this criterion."""
        return None

    def remedies(self, trouble: str, held_by: str) -> list[str]:
        """Return what to try against a trouble, for the end of an error message.

        trouble: "long steps" (too long for stability), "short steps" (too short to finish), "drift"
        (of energy) or "endless energy" (not finite). held_by: the criterion that sets the Courant
        number or, for "short steps", the time step.
        """
        return []
