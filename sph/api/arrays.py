"""A simulation of particles given as arrays, in memory."""

import functools
import inspect
import math
import weakref
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr

from sph import config as configuration
from sph.api.concise import Parameters, concise
from sph.api.view import View
from sph.clock import Clock
from sph.config.errors import suggestion
from sph.config.physics import every_key
from sph.errors import ConfigError
from sph.output.history import TEXT_COLUMNS
from sph.problems import base
from sph.problems.support import returned
from sph.runner import threads_of
from sph.scene import Scene
from sph.simulation import Simulation as Engine
from sph.steps import MOST

_SHARED = base.Problem.model_fields

# Config must have an end, which a simulation in memory has not: longer than any time step.
NEVER = 1e30


class _Arrays(base.Problem):
    """Particles that a script gives."""

    name: Literal["arrays"] = "arrays"
    n: int = Field(ge=1, description="number of particles")
    _start: base.InitialState = PrivateAttr()

    @property
    def clamps(self) -> bool:
        return bool(np.any(self._start.others.get("clamped", 0.0)))

    def fills_box(self, eos: Any) -> bool:
        return False  # positions are arbitrary

    def initial(self, eos: Any) -> base.InitialState:
        return self._start


def _known_arguments(function: Callable[Parameters, None]) -> Callable[Parameters, None]:
    """Let a call with an unknown argument end in a ConfigError that says what to write."""
    valid = [name for name in inspect.signature(function).parameters if name != "self"]

    @functools.wraps(function)
    def checked(*arguments: Parameters.args, **named: Parameters.kwargs) -> None:
        if unknown := next((name for name in named if name not in valid), None):
            raise ConfigError(
                f"sph.Simulation: {unknown} is not an argument; {_in_place_of(unknown, valid)}"
            )
        function(*arguments, **named)

    return checked


def _in_place_of(unknown: str, valid: list[str]) -> str:
    """Return the end of a message on an argument with the name of a key, or a misspelt name."""
    if unknown == "domain":
        return "expected box=, the ends of the domain"
    if unknown in every_key():
        return f'expected physics={{"{unknown}": …}}'
    return suggestion(unknown, valid)


class Simulation(View):
    """A simulation of particles that are given as arrays. Nothing is written.

    position: (D, N), with D = 1, 2 or 3.
    velocity: (D, N); at rest if not given.
    mass, internal_energy: (N,), or one number for all particles; energy per unit mass.
    box: ends of the domain, [lo, hi] for all axes or one [lo, hi] for each axis.
    boundary: "periodic", "mirror" (reflecting wall) or "open" (vacuum outside), for all axes or one
      for each.
    physics: keys of the table [physics] (docs/configuration.md); defaults otherwise.
    others: initial values (N,) of further fields, such as the density of the formulation
      "continuum", which integrates density in time.
    stepping, precision, threads: as the keys time.stepping, run.precision and run.threads.

    All numbers are in code units, as in configuration files. Raises ConfigError for wrong arrays
    and keys, and NumericalError if the state is unphysical. The particles keep their order: their
    IDs are 1 … N.

    >>> x = (np.arange(100) + 0.5) / 100
    >>> wave = sph.Simulation(
    ...     position=[x], velocity=[0.01 * np.sin(2.0 * np.pi * x)], mass=0.01,
    ...     internal_energy=1.0, box=[0.0, 1.0], physics={"gamma": 1.4, "alpha": 0.1},
    ... )
    >>> wave.advance(0.1)
    >>> wave.time
    0.1
    >>> wave.particles.density.shape
    (100,)
    >>> wave.close()
    """

    @concise
    @_known_arguments
    def __init__(
        self,
        position: Any,
        velocity: Any = None,
        mass: Any = 1.0,
        internal_energy: Any = 1.0,
        *,
        box: Any,
        boundary: str | list[str] = "periodic",
        physics: Mapping[str, Any] | None = None,
        others: Mapping[str, Any] | None = None,
        stepping: Literal["global", "individual"] = "global",
        precision: Literal["double", "single"] = "double",
        threads: int | Literal["all"] = "all",
    ):
        start = _state(position, velocity, mass, internal_energy, others or {})
        dimension, number = start.position.shape
        tables = {
            "problem": {"dimension": dimension, "n": number, "domain": box, "boundary": boundary},
            "physics": dict(physics or {}),
            "time": {"end": NEVER, "stepping": stepping},
            "output": {"interval": NEVER},
            "run": {"threads": threads, "precision": precision},
        }
        try:
            config = configuration.from_tables(tables, source="sph.Simulation", problem=_Arrays)
        except ConfigError as error:
            raise ConfigError(_with_own_names(str(error))) from None
        assert isinstance(config.problem, _Arrays)
        config.problem._start = start
        if fault := returned.fault_of_state(config.problem, start):
            raise ConfigError(f"sph.Simulation: {fault}")
        scene = Scene(config)
        if scene.evolves("density") and "density" not in start.others:
            name = config.physics.formulation
            raise ConfigError(
                f'sph.Simulation: physics.formulation = "{name}" integrates the density in time; '
                'expected its initial values, others={"density": …}'
            )
        known = [field.name for field in scene.fields if field.stored]
        if unknown := sorted(start.others.keys() - set(known)):
            raise ConfigError(
                f"sph.Simulation: others has {', '.join(unknown)}; the fields of this scene are "
                f"{', '.join(known)}"
            )
        clock, closing = Clock(), ExitStack()
        self._end = weakref.finalize(self, closing.close)
        closing.callback(clock.close)
        with np.errstate(all="ignore"):
            engine = Engine.of_problem(scene, threads_of(config), clock)
            closing.callback(engine.close)
            engine.begin()
            engine.keep_row()
        super().__init__(engine)
        self._columns: dict[str, list] = {}

    @concise
    def advance(self, until: float) -> None:
        """Take time steps until the time `until`, at which the last one ends exactly.

        Raises NumericalError if the state becomes unphysical, ValueError if `until` is not a later
        time, or if the simulation is closed.
        """
        engine = self._engine
        if not self._end.alive:
            raise ValueError("the simulation is closed")
        if not engine.time <= until < math.inf:
            raise ValueError(f"until = {until}: expected a time after {engine.time}")
        engine.watchdog.end = until
        with np.errstate(all="ignore"):
            while engine.time < until:
                engine.proceed(until, MOST)

    @property
    def history(self) -> dict[str, np.ndarray]:
        """The columns of a history by name, (steps + 1,) each, as `Run.history`."""
        for rows in self._engine.take_rows():
            for name, values in rows.items():
                self._columns.setdefault(name, []).extend(values)
        return {
            name: np.array(values, dtype=object if name in TEXT_COLUMNS else np.float64)
            for name, values in self._columns.items()
        }

    def close(self) -> None:
        """End the threads of the simulation; the state stays. Done also on garbage collection."""
        self._end()

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _with_own_names(text: str) -> str:
    """Return a message about keys of a configuration with the arguments that give them."""
    for key, argument in (("domain", "box"), ("boundary", "boundary")):
        text = text.replace(f"problem.{key}", argument)
    return text.replace(" domain = ", " box = ")


def _state(
    position: Any, velocity: Any, mass: Any, internal_energy: Any, others: Mapping[str, Any]
) -> base.InitialState:
    """Return arrays as floats. Raises ConfigError if they are no numbers, or position is wrong."""
    given = {"position": position, "velocity": velocity, "mass": mass}
    given |= {"internal_energy": internal_energy, **others}
    arrays = {}
    for name, values in given.items():
        try:
            arrays[name] = np.array(0.0 if values is None else values, dtype=np.float64)
        except (ValueError, TypeError):
            raise ConfigError(f"sph.Simulation: {name}: expected an array of numbers") from None
    shape = arrays["position"].shape
    if len(shape) != 2 or shape[0] not in (1, 2, 3) or not shape[1]:
        hint = ". Try: the transpose" if len(shape) == 2 and shape[1] in (1, 2, 3) else ""
        raise ConfigError(
            f"sph.Simulation: position of the shape {shape}; expected (D, N), with D = 1, 2 or 3 "
            f"dimensions and N particles{hint}"
        )
    for name, values in arrays.items():
        if values.ndim == 0:
            arrays[name] = np.full(shape if name == "velocity" else shape[1], values)
    position, velocity, mass, energy = (arrays[name] for name in returned.STATE)
    return base.InitialState(position, velocity, mass, energy, {n: arrays[n] for n in others})
