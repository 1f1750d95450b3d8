"""The settings of a run that differ from the defaults."""

import dataclasses
from typing import Any

from pydantic import BaseModel

from sph import config as configuration
from sph.config import Config, outside, restarts
from sph.config.toml_text import value_text
from sph.errors import SphError
from sph.problems.base import Section

# What names a problem, and where it was found.
NOT_SETTINGS = {"problem.name", *(f"problem.{key}" for key in outside.SOURCES)}


def different(config: Config) -> list[dict[str, Any]]:
    """Return key, value and default (None: none) of each key that differs from its default.

    Defaults are those of the problem and of the formulation. A key without a default counts as
    different. The name of the problem is left out.
    """
    bare = dataclasses.replace(config)  # without cached properties
    needed = {
        name: value
        for name, value in config.problem.model_dump(exclude_none=True).items()
        if type(config.problem).model_fields[name].is_required() and name != "name"
    }
    try:
        plain = _defaults(config, needed)
    except SphError:  # of a problem of a user, or whose keys depend on each other
        return _by_key(bare)
    found = [_setting(f"problem.{key}", value, None) for key, value in needed.items()]
    return found + [_setting(one.key, one.now, one.was) for one in restarts.changes(plain, bare)]


def _defaults(config: Config, needed: dict[str, Any]) -> Config:
    """Return the configuration with the problem, its formulation and the keys `needed` alone."""
    given = {"name": config.problem.name, **needed}
    lines = [f"{key} = {value_text(value)}" for key, value in given.items()]
    formulation = value_text(config.physics.formulation)
    lines += ["[physics]", f"formulation = {formulation}"]
    return configuration.from_text("\n".join(["[problem]", *lines, ""]))


def _by_key(config: Config) -> list[dict[str, Any]]:
    """Compare each key with the default in its declaration, or that of the problem for it."""
    found, own = [], config.problem.defaults
    tables = {name: table for name, table in vars(config).items() if isinstance(table, Section)}
    for name, table in tables.items():
        values = table.model_dump()
        for key, field in type(table).model_fields.items():
            default = None if field.is_required() else field.get_default(call_default_factory=True)
            default = _plain(own.get(f"{name}.{key}", default))
            if values[key] != default and f"{name}.{key}" not in NOT_SETTINGS:
                found.append(_setting(f"{name}.{key}", values[key], default))
    return found


def _setting(key: str, value: Any, default: Any) -> dict[str, Any]:
    return {"key": key, "value": value, "default": default}


def _plain(value: Any) -> Any:
    """Return a value as `model_dump` does."""
    if isinstance(value, BaseModel):
        return value.model_dump()
    return [_plain(one) for one in value] if isinstance(value, list) else value
