"""The configuration of a run: read from TOML, overridden, written as TOML, and a template."""

import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from sph import registry
from sph.config import commented, reading
from sph.config.errors import suggestion
from sph.config.physics import Physics
from sph.config.sections import RESOURCES, SECTIONS, Output, Report, Run, Time
from sph.config.toml_text import key_text, value_text
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
        source = reading.Source("the configuration of the run", _tables(self), {})
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


def template(problem: str) -> str:
    """Return commented TOML for a problem: every key with its help, bounds and default.

    Raises ConfigError, which names the most similar problem, if there is no problem of that name.
    """
    problems = registry.names("sph.problems")
    if problem not in problems:
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
    return {name: section.model_dump(exclude_none=True) for name, section in sections.items()}


def _text(tables: dict[str, dict[str, Any]]) -> str:
    return "\n".join(_table_text(name, keys) for name, keys in tables.items())


def _table_text(name: str, keys: dict[str, Any]) -> str:
    lines = (f"{key_text(key)} = {value_text(value)}\n" for key, value in keys.items())
    return f"[{name}]\n" + "".join(lines)
