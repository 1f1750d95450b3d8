"""The comparison: series of runs that differ in N, the Pareto front, and fitted orders."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sph.analysis.report import front
from sph.analysis.report.runs import Row, natural, varied_keys

RESOLUTION = "problem.n"

# Names of a cost, in a sentence and as a column, and its unit.
COSTS = {
    "cpu": ("CPU time", "CPU s", "s"),
    "wall": ("wall-clock time", "wall s", "s"),
    "updates": ("particle updates", "updates", ""),
    "n": ("number of particles", "N", ""),
}


# The cost of a step is proportional to N, and steps become no fewer: a cost that grows more slowly
# than this power of N is mostly that of starting a run, and times of short runs are noise.
LEAST_GROWTH = 0.9


# What runs without an exact solution are compared by.
DRIFT = "conservation.energy_drift_max"


class Question(NamedTuple):
    """What a report compares."""

    # of the errors, or table.name of a figure of the summary; empty: density, or DRIFT if no run
    # has errors
    field: str = ""
    norm: str = "L1"
    cost: str = "cpu"  # a key of COSTS
    by: tuple[str, ...] = ()  # keys that distinguish lines; empty: all that vary but N
    reference: Path | None = None  # the run that errors are taken against, if one is

    @property
    def error_name(self) -> str:
        return self.field if "." in self.field else f"{self.norm} error of {self.field}"


class Series(NamedTuple):
    """Runs of one sweep that differ in N alone, in order of N: one line of a figure."""

    sweep: str  # empty where there is one
    label: str
    group: str  # by --by; lines of one group have one colour
    members: tuple[int, ...]  # indices into the report's compared rows
    order: float | None  # p of error ~ spacing^p, spacing ~ N^(-1/D)
    exponent: float | None  # of error ~ cost^exponent
    has_fixed_costs: bool = False  # the cost grows more slowly than N: no exponent is given


class Report(NamedTuple):
    """Runs with an error, in order of their series, and runs without one."""

    question: Question
    keys: list[str]  # what varies
    rows: list[Row]
    error: np.ndarray  # (M,)
    cost: np.ndarray  # (M,)
    on_front: np.ndarray  # (M,) mask
    excess: np.ndarray  # (M,) cost over the cost of the front at the same error
    series: list[Series]
    without: list[Row]


def compare(rows: Sequence[Row], question: Question) -> Report:
    """The report on these runs."""
    errors = {id(row): row.error(question.field, question.norm) for row in rows}
    is_compared = {id(row): row.status == "done" and errors[id(row)] is not None for row in rows}
    found = []
    for sweep in dict.fromkeys(row.sweep for row in rows):
        of_it = [row for row in rows if row.sweep == sweep and row.settings]
        found += _lines(
            [row for row in of_it if is_compared[id(row)]], varied_keys(of_it), question
        )
    ordered = [row for line in found for row in line.rows]
    error = np.array([errors[id(row)] for row in ordered])
    cost = np.array([row.cost[question.cost] for row in ordered], dtype=float)
    series, start = [], 0
    for line in found:
        which = np.arange(start, start := start + len(line.rows))
        series.append(_series(line, which, error, cost))
    keys = varied_keys([row for row in rows if row.settings])
    without = [row for row in rows if not is_compared[id(row)]]
    best, excess = front.on_front(cost, error), front.excess(cost, error)
    return Report(question, keys, ordered, error, cost, best, excess, series, without)


class _Line(NamedTuple):
    """Runs that make a series."""

    label: str
    group: str
    rows: list[Row]


def _lines(rows: list[Row], keys: list[str], question: Question) -> list[_Line]:
    """The lines of one sweep, or of all runs, in the order of their settings."""
    lines, groups = _line_keys(keys, question.by)
    members: dict[tuple[str, ...], list[Row]] = {}
    for row in sorted(rows, key=lambda row: row.n):
        members.setdefault(tuple(row.value(key) for key in lines), []).append(row)
    found = [members[values] for values in sorted(members, key=lambda one: [*map(natural, one)])]
    return [_Line(_label(one[0], lines), _label(one[0], groups), one) for one in found]


def _line_keys(keys: list[str], by: Sequence[str]) -> tuple[list[str], list[str]]:
    """Keys that distinguish lines, and keys that distinguish their colours."""
    if RESOLUTION in by:
        return list(by), list(by)
    lines = [key for key in keys if key != RESOLUTION]
    return [*lines, *(key for key in by if key not in lines)], list(by) or lines


def _label(row: Row, keys: Sequence[str]) -> str:
    """Settings without their tables, e.g. alpha = 1.0."""
    names = {key: "problem" if key == "problem.name" else key.rpartition(".")[2] for key in keys}
    return ", ".join(f"{name} = {row.value(key)}" for key, name in names.items())


def _series(line: _Line, which, error, cost) -> Series:
    number = np.array([row.n for row in line.rows], dtype=float)
    by_number = front.slope(number, error[which])
    dimensions = {row.ended["dimension"] for row in line.rows}
    order = None
    if by_number is not None and len(dimensions) == 1:
        order = -by_number * dimensions.pop()
    growth = front.slope(number, cost[which])
    has_fixed_costs = growth is not None and growth < LEAST_GROWTH
    exponent = None if has_fixed_costs else front.slope(cost[which], error[which])
    members = tuple(which.tolist())
    return Series(
        line.rows[0].sweep, line.label, line.group, members, order, exponent, has_fixed_costs
    )
