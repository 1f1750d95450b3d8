"""The configuration of a run: read from TOML, overridden, written as TOML, and a template."""

import dataclasses
import functools
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from sph.config import commented, outside, reading, removal
from sph.config.errors import dotted, suggestion
from sph.config.physics import Physics
from sph.config.sections import RESOURCES, SECTIONS, Output, Report, Run, Time
from sph.config.toml_text import Path as KeyPath
from sph.config.toml_text import key_text, value_text
from sph.config.units import Units
from sph.errors import ConfigError
from sph.problems.base import Problem


@dataclasses.dataclass(frozen=True)
class Config:
    """A complete and valid configuration: one attribute per table, with a value for every key."""

    problem: Problem
    physics: Physics
    time: Time
    output: Output
    report: Report
    run: Run
    units: Units = dataclasses.field(default_factory=lambda: Units.model_validate({}))

    def to_toml(self) -> str:
        """Return all keys in declared order as TOML that reads back to an equal configuration."""
        return _text(_tables(self))

    @functools.cached_property
    def recorded(self) -> str:
        """The TOML text that checkpoints keep: all keys but RESOURCES, which change no result."""
        tables = _tables(self)
        for key in RESOURCES:
            del tables["run"][key]
        return _text(tables)

    def override(self, overrides: Sequence[str]) -> "Config":
        """Return a copy with the overrides `a.b=VALUE` applied. Raises ConfigError."""
        tables = _tables(self)
        if isinstance(self.problem, outside.Outside):  # of the sources as they are now
            for key in outside.SOURCES:
                tables["problem"].pop(key, None)
        source = reading.Source("the configuration of the run", tables, {})
        return _resolve(source, overrides)


def load(path: str | Path, overrides: Sequence[str] = ()) -> Config:
    """Return the configuration in a file, with the overrides `a.b=VALUE` applied.

    Raises FileError if the file cannot be read, and ConfigError that lists every error in it.
    """
    directory = str(Path(path).parent)
    return _resolve(reading.parse(reading.read(path), str(path), directory), overrides)


def from_text(text: str, source: str = "the configuration") -> Config:
    """Return the configuration of an existing run from its TOML text. Raises ConfigError.

    source: name of the text in error messages.
    """
    return _resolve(reading.parse(text, source), (), recorded=True)


def from_tables(
    tables: Mapping[str, Any],
    overrides: Sequence[str] = (),
    source: str = "the configuration",
    problem: type[Problem] | None = None,
) -> Config:
    """Return the configuration of tables by name, with the overrides applied. Raises ConfigError.

    Numbers and arrays of NumPy, tuples and paths are taken as well; a relative path begins at the
    current directory. source: name of the tables in messages; problem: class of the problem, in
    place of the one that problem.name or problem.file names.
    """
    found = reading.Source(source, _plain(tables), {})
    return Config(**reading.resolve(found, overrides, SECTIONS, problem=problem))


def as_overrides(overrides: Sequence[str] | Mapping[str, Any]) -> list[str]:
    """Return overrides `a.b=VALUE` of a mapping {"a.b": VALUE}, or those given.

    None removes a key. Raises ConfigError for a whole table, which would lose its other keys.
    """
    if not isinstance(overrides, Mapping):
        return [overrides] if isinstance(overrides, str) else list(overrides)
    for key, one in overrides.items():
        if key in _names() and isinstance(one, Mapping):
            dotted_keys = ", ".join(f'"{key}.{name}": {value!r}' for name, value in one.items())
            raise ConfigError(
                f'overrides: "{key}" is a whole table; expected single keys, with a point. Try: '
                f"{{{dotted_keys}}}"
            )
    texts = {
        key: removal.NONE if one is None else value_text(_plain(one, (key,)))
        for key, one in overrides.items()
    }
    return [f"{key}={text}" for key, text in texts.items()]


def _plain(value: Any, path: KeyPath = ()) -> Any:
    """Return a value as TOML has it: with numbers of Python, lists and texts.

    path: of its key, for messages. Raises ConfigError for what TOML cannot express.
    """
    if isinstance(value, Mapping):
        given = {str(key): one for key, one in value.items() if one is not None}
        return {key: _plain(one, (*path, key)) for key, one in given.items()}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(one, (*path, k)) for k, one in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if not isinstance(value, bool | int | float | str):
        raise ConfigError(
            f"{dotted(path)} = {value!r}: expected a number, a text, a list or a table"
        )
    return value


def template(problem: str) -> str:
    """Return commented TOML for a problem: every key with its help, bounds and default.

    problem: a name, or the path of a Python file, which ends in .py. Raises ConfigError, which
    names the most similar problem, if there is no problem of that name.
    """
    if problem.endswith(".py"):
        default = _resolve(reading.Source(problem, {"problem": {"file": problem}}, {}), ())
        return commented.text({name: getattr(default, name) for name in _names()})
    if outside.problem_class(problem) is None:
        problems = outside.names()
        raise ConfigError(f'unknown problem "{problem}"; {suggestion(problem, problems)}')
    default = from_text(f'[problem]\nname = "{problem}"\n')
    return commented.text({name: getattr(default, name) for name in _names()})


def _resolve(source: reading.Source, overrides: Sequence[str], recorded: bool = False) -> Config:
    return Config(**reading.resolve(source, overrides, SECTIONS, recorded))


def _names() -> list[str]:
    return [field.name for field in dataclasses.fields(Config)]


def _tables(config: Config) -> dict[str, dict[str, Any]]:
    sections: dict[str, BaseModel] = {name: getattr(config, name) for name in _names()}
    # TOML cannot express None, the value of a key that is not set (gamma if eos is given).
    found = {name: section.model_dump(exclude_none=True) for name, section in sections.items()}
    return {name: keys for name, keys in found.items() if keys}  # [units] may be empty


def _text(tables: dict[str, dict[str, Any]]) -> str:
    return "\n".join(_table_text(name, keys) for name, keys in tables.items())


def _table_text(name: str, keys: dict[str, Any]) -> str:
    lines = (f"{key_text(key)} = {value_text(value)}\n" for key, value in keys.items())
    return f"[{name}]\n" + "".join(lines)
