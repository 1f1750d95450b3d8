"""Run directories as rows of a table: their settings, errors and costs."""

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sph import warnings
from sph.config import reading
from sph.config.sections import RESOURCES
from sph.config.toml_text import value_text
from sph.errors import ConfigError, FileError
from sph.output.files import read_text
from sph.output.run_directory import RunDirectory
from sph.summary import Errors, Relaxation, Summary, lookup, wall_without_start
from sph.sweep.manifest import SweepDirectory


@dataclass
class Row:
    """One run, or a point of a sweep without a run."""

    path: Path
    name: str
    settings: dict[str, Any]  # resolved configuration, as table.key, without RESOURCES
    summary: Summary | None  # None before the run has ended
    status: str  # "done", "stopped", "failed" or "unfinished"
    reason: str = ""
    reference: Errors | None = None  # errors against a named run, in place of the summary's own
    sweep: str = ""  # the name of its sweep, where several are compared
    n: int = field(init=False)
    steps: int = field(init=False)
    cost: dict[str, float] = field(init=False)  # by the names of --x

    def __post_init__(self):
        self.n = self.summary["particles"] if self.summary else 0
        self.steps = self.summary["steps"] if self.summary else 0
        self.cost = _cost(self.summary) if self.summary else {}

    @property
    def ended(self) -> Summary:
        """The summary of a run that has ended, as all runs with an error have."""
        assert self.summary is not None
        return self.summary

    @property
    def is_restarted(self) -> bool:
        """Whether its wall-clock seconds contain the start of earlier sessions."""
        return self.summary is not None and self.summary["cost"]["session"]["steps"] < self.steps

    @property
    def errors(self) -> Errors | None:
        """Its errors, against the reference of the report or else those of its summary."""
        return self.reference or (self.summary["errors"] if self.summary else None)

    @property
    def relaxation(self) -> Relaxation | None:
        """How relaxation to a glass ended; None for runs that did not begin from a glass."""
        return self.summary.get("relaxation") if self.summary else None

    @property
    def truth(self) -> str | None:
        """The run that its errors are against, or None where that is the exact solution."""
        return self.errors.get("reference") if self.errors else None

    @property
    def warnings(self) -> list[str]:
        """The kinds of warning that it ended with."""
        return warnings.kinds(self.summary or {})

    def error(self, name: str, norm: str) -> float | None:
        """The norm of a field's error, or the size of a figure given as table.name; or None."""
        if "." in name:
            return _number(lookup(self.summary, name)) if self.summary else None
        fields = self.errors["fields"] if self.errors else {}
        return _number(lookup(fields, f"{name}.{norm}"))

    def figures(self) -> list[str]:
        """The names of which `error` may have a number."""
        names = [*self.errors["fields"]] if self.errors else []
        if self.summary:
            names += [f"report.{name}" for name in self.summary["report"] or {}]
            names += [f"conservation.{name}" for name in self.summary["conservation"]]
            names += [f"relaxation.{name}" for name in self.relaxation or {}]
        return names

    def value(self, key: str) -> str:
        """The value of a setting, as tables show it."""
        if key not in self.settings:
            return "none"
        found = self.settings[key]
        if isinstance(found, dict) and "name" in found:  # a model with parameters
            rest = [f"{name}={value_text(one)}" for name, one in found.items() if name != "name"]
            return f"{found['name']}({', '.join(rest)})"
        return found if isinstance(found, str) else value_text(found)


def read(sources: Sequence[Path]) -> list[Row]:
    """The runs in these directories, which may be run directories. Raises FileError without runs.

    Rows have the name of their sweep where there is more than one.
    """
    rows: dict[Path, Row] = {}
    sources = list(dict.fromkeys(map(Path, sources)))
    sweeps = [source for source in sources if SweepDirectory(source).is_one]
    for source in sources:
        paths = _runs_in(source)
        mine = {path.resolve(): _row(path) for path in paths}
        if source in sweeps:
            mine |= _never_begun(SweepDirectory(source))
            for row in mine.values() if len(sweeps) > 1 else ():
                row.sweep = source.resolve().name
        elif not paths:
            there = "holds no runs" if source.is_dir() else "does not exist"
            there = "is a file" if source.is_file() else there
            raise FileError(f"{source} {there}.\nTry: a run directory, or one that holds some.")
        rows |= mine
    found = list(rows.values())
    _shorten_models(found)
    _shorten_tables(found)
    return found


def varied_keys(rows: Sequence[Row]) -> list[str]:
    """Keys whose values differ, without keys that differ only because the problem does."""
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
    """Leave the parameters of a model out of the settings where all runs agree in them."""
    models: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        for key, value in row.settings.items():
            if isinstance(value, dict) and "name" in value:
                models.setdefault((key, value["name"]), []).append(row)
    for (key, name), those in models.items():
        if all(row.settings[key] == those[0].settings[key] for row in those):
            for row in those:
                row.settings[key] = name


def _shorten_tables(rows: Sequence[Row]) -> None:
    """Of a table that some runs lack, such as problem.relax, keep the keys whose values differ."""
    for key in dict.fromkeys(key for row in rows for key in row.settings):
        those = [row for row in rows if key in row.settings]
        tables = [row.settings[key] for row in those]
        if len(those) == len(rows) or any(not _is_plain_table(one) for one in tables):
            continue
        names = dict.fromkeys(name for one in tables for name in one)
        differ = [name for name in names if any(one.get(name) != tables[0].get(name)
                                                for one in tables)]  # fmt: skip
        for row, table in zip(those, tables, strict=True):
            left = [f"{name}={value_text(table[name])}" for name in differ if name in table]
            row.settings[key] = f"{{{', '.join(left)}}}" if left else "given"


def _is_plain_table(value: Any) -> bool:
    """Whether a setting is a table that is not a model with parameters."""
    return isinstance(value, dict) and "name" not in value


def _runs_in(directory: Path) -> list[Path]:
    """`directory` if it is a run, else the runs in it, in natural order (9 before 10)."""
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
    settings = _settings(run.config)
    if not run.summary.exists():
        return Row(path, path.name, settings, None, "unfinished", "it has not ended")
    summary = run.whole_summary()
    return Row(path, path.name, settings, summary, summary["status"], summary["reason"] or "")


def _settings(path: Path) -> dict[str, Any]:
    """Every key of a run's config.toml but RESOURCES, as table.key. Raises FileError."""
    try:
        tables = reading.parse(read_text(path), str(path)).tables
    except ConfigError as error:
        raise FileError(str(error)) from None
    for table, keys in tables.items():
        if not isinstance(keys, dict):
            raise FileError(f"{path}: {table} = {value_text(keys)}: expected a table [{table}]")
    return {
        f"{table}.{key}": value
        for table, keys in tables.items()
        for key, value in keys.items()
        if not (table == "run" and key in RESOURCES)
    }


def _never_begun(sweep: SweepDirectory) -> dict[Path, Row]:
    """Points of a sweep without a run directory: they failed at once, or have not started."""
    failures = sweep.failures()
    rows = {}
    for point in sweep.plan().points:
        path = Path(os.path.realpath(sweep.path / point.name))  # a link to itself is no error
        if not _is_run(path):
            reason = failures.get(point.name)
            status = "unfinished" if reason is None else "failed"
            rows[path] = Row(path, point.name, {}, None, status, reason or "not started")
    return rows


def _cost(summary: Summary) -> dict[str, float]:
    """Cost by the names of --x: two times without compilation and start, updates, particles."""
    return {
        "cpu": summary["cost"]["cpu_seconds"],
        "wall": wall_without_start(summary["cost"]),
        # summaries of earlier versions have none
        "updates": summary["cost"].get("updates", summary["particles"] * summary["steps"]),
        "n": summary["particles"],
    }


def _number(value: Any) -> float | None:
    """The modulus of a finite number other than 0; None for all else: axes are logarithmic."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value):
        return None
    return abs(float(value)) or None
