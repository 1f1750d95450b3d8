"""Run directories as rows of a table: their settings, errors and costs."""

import json
import os
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sph import warnings
from sph.config.toml_text import value_text
from sph.errors import FileError
from sph.output.files import read_text
from sph.output.run_directory import RunDirectory
from sph.sweep.manifest import SweepDirectory

# Seconds of a run that are not spent on the gas, nor grow with it.
STARTING = "start of Numba"


@dataclass
class Row:
    """One run, or one that did not come to be."""

    path: Path
    name: str
    settings: dict[str, Any]  # every key of the resolved configuration but [run], as table.key
    summary: dict[str, Any]
    status: str  # "done", "stopped", "failed" or "unfinished"
    reason: str = ""
    reference: dict | None = None  # errors against a named run, in place of the summary's own
    sweep: str = ""  # which of several sweeps it is of
    n: int = field(init=False)
    cost: dict[str, float] = field(init=False)  # by the names of --x

    def __post_init__(self):
        self.n = self.summary.get("particles", 0)
        self.cost = _cost(self.summary) if self.summary else {}

    @property
    def is_restarted(self) -> bool:
        """Whether earlier sessions are in its cost, of which the compile time is not known."""
        return bool(self.summary) and self.summary["cost"]["session"]["steps"] < self.steps

    @property
    def truth(self) -> str | None:
        """The run that its errors are against, or None where that is the exact solution."""
        return (self.reference or self.summary.get("errors") or {}).get("reference")

    @property
    def warnings(self) -> list[str]:
        """The kinds of warning that it ended with."""
        return warnings.kinds(self.summary)

    @property
    def steps(self) -> int:
        return self.summary.get("steps", 0)

    def error(self, name: str, norm: str) -> float | None:
        """The norm of a field's error, or the size of a figure given as table.name; or None."""
        errors = self.reference or self.summary.get("errors") or {}
        if "." not in name:
            return _number(errors.get("fields", {}).get(name, {}).get(norm))
        found: Any = self.summary
        for step in name.split("."):
            found = found.get(step) if isinstance(found, dict) else None
        return _number(found)

    def figures(self) -> list[str]:
        """Names of what `error` has a number for."""
        errors = self.reference or self.summary.get("errors") or {}
        tables = {name: self.summary.get(name) or {} for name in ("report", "conservation")}
        further = [f"{table}.{name}" for table, names in tables.items() for name in names]
        return [*errors.get("fields", {}), *further]

    def value(self, key: str) -> str:
        """The value of a setting as it is shown."""
        if key not in self.settings:
            return "–"
        found = self.settings[key]
        if isinstance(found, dict) and "name" in found:  # a model with parameters
            rest = [f"{name}={value_text(one)}" for name, one in found.items() if name != "name"]
            return f"{found['name']}({', '.join(rest)})"
        return found if isinstance(found, str) else value_text(found)


def read(sources: Sequence[Path]) -> list[Row]:
    """The runs that are or lie in these directories. Raises FileError where there are none.

    Of more than one sweep, each row has the name of its own.
    """
    rows: dict[Path, Row] = {}
    sources = list(dict.fromkeys(map(Path, sources)))
    sweeps = [source for source in sources if SweepDirectory(source).is_one]
    for source in sources:
        found = _runs_in(source)
        mine = {path.resolve(): _row(path) for path in found}
        if source in sweeps:
            mine |= _never_begun(SweepDirectory(source))
            for row in mine.values() if len(sweeps) > 1 else ():
                row.sweep = source.resolve().name
        elif not found:
            there = "holds no runs" if source.is_dir() else "does not exist"
            raise FileError(f"{source} {there}.\nTry: a run directory, or one that holds some.")
        rows |= mine
    found = list(rows.values())
    _shorten_models(found)
    return found


def varied_keys(rows: Sequence[Row]) -> list[str]:
    """Keys whose values differ, but for what only goes with problem.name, such as its own keys."""
    keys = dict.fromkeys(key for row in rows for key in row.settings)
    by_problem: dict[str, Row] = {}
    for row in rows:
        by_problem.setdefault(row.value("problem.name"), row)
    one_problem = len(by_problem) == 1

    def varies(key: str) -> bool:
        if one_problem or key == "problem.name":
            return len({row.value(key) for row in rows}) > 1
        firsts = {name: first.value(key) for name, first in by_problem.items()}
        return any(row.value(key) != firsts[row.value("problem.name")] for row in rows)

    return [key for key in keys if varies(key)]


def _shorten_models(rows: Sequence[Row]) -> None:
    """Leave a model's parameters out of the settings where no other run has others for it."""
    models: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        for key, value in row.settings.items():
            if isinstance(value, dict) and "name" in value:
                models.setdefault((key, value["name"]), []).append(row)
    for (key, name), those in models.items():
        if all(row.settings[key] == those[0].settings[key] for row in those):
            for row in those:
                row.settings[key] = name


def _runs_in(directory: Path) -> list[Path]:
    """`directory` if it is a run, else those in it, in the order a reader would count."""
    if _is_run(directory):
        return [directory]
    if not directory.is_dir():
        return []
    return sorted(filter(_is_run, directory.iterdir()), key=lambda path: natural(path.name))


def _is_run(path: Path) -> bool:
    return (path / "config.toml").is_file() and (path / "checkpoints").is_dir()


def natural(name: str) -> list:
    """Sorts n=50 before n=100."""
    parts = re.split(r"(\d+\.?\d*)", name)
    return [(float(part), "") if part[:1].isdecimal() else (-1.0, part) for part in parts]


def _row(path: Path) -> Row:
    path = path.resolve()
    run = RunDirectory(path)
    try:
        tables = tomllib.loads(read_text(run.config))
        settings = {
            f"{table}.{key}": value
            for table, keys in tables.items()
            if table != "run"
            for key, value in keys.items()
        }
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise FileError(f"{run.config} cannot be read: {error}") from None
    if not run.summary.exists():
        return Row(path, path.name, settings, {}, "unfinished", "it has not ended")
    try:
        summary = json.loads(read_text(run.summary))
        return Row(path, path.name, settings, summary, summary["status"], summary["reason"] or "")
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FileError(f"{run.summary} cannot be read: {error!r}") from None


def _never_begun(sweep: SweepDirectory) -> dict[Path, Row]:
    """Points of a sweep without a run: those that failed before they had one, and the rest."""
    failures = sweep.failures()
    rows = {}
    for point in sweep.plan().points:
        path = Path(os.path.realpath(sweep.path / point.name))  # a link to itself is no error
        if not _is_run(path):
            reason = failures.get(point.name)
            status = "unfinished" if reason is None else "failed"
            rows[path] = Row(path, point.name, {}, {}, status, reason or "it was not begun")
    return rows


def _cost(summary: dict) -> dict[str, float]:
    """Cost by the names of --x: seconds without compiling and starting, updates, particles."""
    cost = summary["cost"]
    session = cost["session"]
    apart = session["compile_cpu_seconds"] + session["phases_cpu_seconds"].get(STARTING, 0.0)
    return {
        "cpu": cost["cpu_seconds"] - apart,
        "wall": cost["wall_seconds"] - apart,  # both are the work of one thread
        "updates": summary["particles"] * summary["steps"],
        "n": summary["particles"],
    }


def _number(value: Any) -> float | None:
    """Its size if it is a positive finite number: nothing else has a place on a log scale."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return abs(float(value)) or None
