"""Figures of a run that limits may name; parts of a name stand between dots.

errors.FIELD.NORM          as in the summary: against the exact solution, where it holds
relative.FIELD.NORM        norm of (value - exact)/|exact| of each particle
report.NAME                figures of the problem, as in the summary
nearest.KIND               distance to the nearest neighbour, in spacings; KIND is median, smallest
conservation.NAME, cost.NAME, steps, particles, time
history.COLUMN.KIND        over all steps; KIND is first, last, min or max
state.FIELD.KIND           over the particles at the end; KIND is min or max
warnings.KIND              1 where the run ended with a warning of that kind, else 0
change.FIELD               largest |last - first| of a particle, over its own first value for
                           scalars, over the largest first length for vectors
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sph import warnings
from sph.analysis import truth
from sph.analysis.errors import norms
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import Checkpoint
from sph.output.history import read as read_history
from sph.output.run_directory import RunDirectory
from sph.summary import Summary, lookup

KINDS = (
    "errors", "relative", "report", "nearest", "conservation", "cost", "steps", "particles",
    "time", "history", "state", "change", "warnings",
)  # fmt: skip
NONE = float("nan")  # the value of a figure that a run does not have

OF_HISTORY: dict[str, Callable[[np.ndarray], Any]] = {
    "first": lambda x: x[0],
    "last": lambda x: x[-1],
    "min": np.min,
    "max": np.max,
}
OF_STATE = {"min": np.min, "max": np.max}


class Figures:
    """Figures of the run in a directory, each computed when it is asked for."""

    def __init__(self, directory: Path, summary: Summary | None):
        self.run = RunDirectory(directory)
        self.summary: Mapping[str, Any] = summary or {}

    def value(self, name: str) -> float:
        """The figure of that name; NaN where the run has no such figure. Raises FileError."""
        kind, *rest = name.split(".")
        makers: dict[str, Callable[..., Any]] = {
            "errors": self._error, "relative": self._relative, "history": self._of_history,
            "state": self._of_state, "change": self._change, "warnings": self._warnings,
        }  # fmt: skip
        try:
            return float(makers[kind](*rest) if kind in makers else lookup(self.summary, name))
        except (KeyError, AttributeError, IndexError, TypeError, ValueError):
            return NONE

    @cached_property
    def _history(self) -> dict[str, np.ndarray]:
        return read_history(self.run.history)

    @cached_property
    def _first(self) -> Checkpoint:
        return checkpoints.read(self.run.checkpoints()[0])

    @cached_property
    def _last(self) -> Checkpoint:
        return checkpoints.read(self.run.checkpoints()[-1])

    def _warnings(self, kind: str):
        return warnings.kinds(self.summary).count(kind)

    def _error(self, field: str, norm: str):
        return lookup(self.summary, f"errors.fields.{field}.{norm}")

    def _of_history(self, column: str, kind: str):
        values = self._history[column]
        return np.mean(values == kind) if values.dtype == object else OF_HISTORY[kind](values)

    def _of_state(self, field: str, kind: str):
        return OF_STATE[kind](_length(self._last.field(field)))

    def _change(self, field: str):
        before, after = (one.by_id(one.field(field)) for one in (self._first, self._last))
        size = np.abs(before) if before.ndim == 1 else _length(before).max()
        return (np.abs(_length(after - before)) / size).max()

    def _relative(self, field: str, norm: str):
        state, eos = self._last, self._last.config.physics.eos_model()
        problem, position = state.config.problem, state.particles.position
        if truth.left_out(state.config, state.time, position):
            return NONE
        exact = (problem.exact(eos, state.time, position) or {})[field]
        inside, _ = truth.region(problem, eos, state.time, position)
        with np.errstate(divide="ignore", invalid="ignore"):
            difference = (state.field(field) - exact) / np.abs(_length(exact))
        volume = state.particles.mass / state.particles.density
        return lookup(norms(difference[..., inside], volume[inside]), norm)


def _length(values: np.ndarray) -> np.ndarray:
    """Scalars (N,) as they are, vectors (D, N) as their lengths (N,)."""
    return np.linalg.norm(values, axis=0) if values.ndim == 2 else values
