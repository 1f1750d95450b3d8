"""A case of the stress suite: a TOML file in `cases/` beside this one, found by its name.

The file is a configuration, as `sph run` takes it, with further keys:

    title, hard        what the case is, and what is hard about it
    [limits]           figure = { at_most, at_least, why }, see `figures`: bounds on a right answer
    [reaches]          figure = { ideal, why }: a figure for which SPH cannot reach the exact answer
    [settings.NAME]    about; set: keys as `--set` takes them; limits: more bounds; fails =
                       { limit | exit, because }: an expected failure, by breaking that limit, or
                       with exit code 3 and these words
"""

import fnmatch
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import Field, ValidationError, model_validator

from sph.config import reading
from sph.config.errors import Issue, as_error, explain, suggestion
from sph.config.sections import SECTIONS
from sph.errors import ConfigError
from sph.problems.base import Section

FOLDER = Path(__file__).parent / "cases"
TABLES = ("problem", "physics", *SECTIONS)  # of the configuration in a case


class Bound(Section):
    """Bounds of a figure, and where the numbers come from."""

    at_most: float | None = None
    at_least: float | None = None
    why: str = Field(min_length=1)

    @model_validator(mode="after")
    def _bounds_something(self):
        if self.at_most is None and self.at_least is None:
            raise ValueError("expected at_most, at_least or both")
        return self

    def holds(self, value: float) -> bool:
        """Whether `value` is within the bounds; NaN, a missing figure, never is."""
        above = self.at_least is None or value >= self.at_least
        below = self.at_most is None or value <= self.at_most
        return above and below and value == value

    def closeness(self, value: float) -> float:
        """`value` relative to the bound: 1 on the bound, more beyond it."""
        if value != value:
            return float("inf")
        low, high = self.at_least, self.at_most
        if low is not None and high is not None:
            return abs(2.0 * value - (high + low)) / (high - low)
        # a share means something where both are above zero
        if high is not None and min(high, value) > 0.0:
            return value / high
        if low is not None and min(low, value) > 0.0:
            return low / value
        return float(not self.holds(value))

    def __str__(self) -> str:
        low = "" if self.at_least is None else f"at least {self.at_least:g}"
        high = "" if self.at_most is None else f"at most {self.at_most:g}"
        return " and ".join(filter(None, (low, high)))


# Bounds of every case, unless the case gives its own for the figure.
ALWAYS = {
    "conservation.energy_drift_max": Bound(
        at_most=1e-3, why="the scheme conserves energy but for the error of the time integration"
    ),
    "history.min_internal_energy.min": Bound(at_least=0.0, why="internal energy is not negative"),
}


class Reach(Section):
    """A figure for which SPH cannot reach the exact answer."""

    ideal: float
    why: str = Field(min_length=1)


class Failing(Section):
    """An expected failure: the setting breaks a limit, or ends with these words."""

    limit: str | None = None
    exit: str | None = None
    because: str = Field(min_length=1)

    @model_validator(mode="after")
    def _in_one_way(self):
        if (self.limit is None) == (self.exit is None):
            raise ValueError("expected limit or exit, one of the two")
        return self


class Setting(Section):
    """One way of running a case."""

    about: str = Field(min_length=1)
    set: list[str] = Field(default=[])
    limits: dict[str, Bound] = Field(default={})
    fails: Failing | None = None


class Case(Section):
    """A hard case: a configuration, its limits, and the settings to run it with."""

    name: str
    title: str = Field(min_length=1)
    hard: str = Field(min_length=1)
    configuration: dict[str, dict[str, Any]]
    limits: dict[str, Bound] = Field(default={})
    reaches: dict[str, Reach] = Field(default={})
    settings: dict[str, Setting] = Field(min_length=1)

    @model_validator(mode="after")
    def _limits_exist(self):
        for name, setting in self.settings.items():
            limit = setting.fails and setting.fails.limit
            if limit and limit not in self.bounds(name):
                valid = sorted(self.bounds(name))
                text = f'= "{limit}" is not a figure with a limit; {suggestion(limit, valid)}'
                raise as_error([Issue(("settings", name, "fails", "limit"), text)])
        if all(setting.fails for setting in self.settings.values()):
            text = ": expected at least one setting without `fails`"
            raise as_error([Issue(("settings",), text)])
        return self

    def bounds(self, setting: str) -> dict[str, Bound]:
        """All limits of a setting, by figure: its own override the case's, and those ALWAYS."""
        return ALWAYS | self.limits | self.settings[setting].limits

    def to_toml(self) -> str:
        """The configuration that the settings change."""
        return tomli_w.dumps(self.configuration)


def read(path: Path) -> Case:
    """The case in a file. Raises FileError if it cannot be read, ConfigError if it is invalid."""
    source = reading.parse(reading.read(path), str(path))
    own = {key: value for key, value in source.tables.items() if key not in TABLES}
    tables = {key: value for key, value in source.tables.items() if key in TABLES}
    reserved = {"name": path.stem, "configuration": tables}
    issues = [Issue((key,), "is not a key of a case") for key in own if key in reserved]
    try:
        found = Case.model_validate(own | reserved)
    except ValidationError as error:
        details = error.errors(include_url=False)
        wrong = explain(Case, own | reserved, details, "case", {})
        issues += [issue._replace(path=issue.path[1:]) for issue in wrong]
    if issues:
        raise ConfigError("\n".join(map(source.report, sorted(issues, key=source.order))))
    return found


def names() -> list[str]:
    """Names of all cases."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load(only: Sequence[str] = ()) -> list[Case]:
    """The cases of these names, or patterns such as `noh_*`; all cases where none is given.

    Raises ConfigError where no case matches.
    """
    there = names()
    chosen = set() if only else set(there)
    for pattern in only:
        found = fnmatch.filter(there, pattern)
        if not found:
            raise ConfigError(f'there is no case "{pattern}"; {suggestion(pattern, there)}')
        chosen.update(found)
    return [read(FOLDER / f"{name}.toml") for name in sorted(chosen)]
