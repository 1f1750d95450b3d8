"""The settings of a run that differ from the defaults."""

import dataclasses
from typing import Any

from sph import config as configuration
from sph.config import Config, restarts
from sph.config.toml_text import value_text
from sph.errors import SphError


def different(config: Config) -> list[dict[str, Any]]:
    """Return key, value and default (None: none) of each key that differs from its default.

    Defaults are those of the problem and of the formulation. A key without a default, and all keys
    if the defaults cannot be found, count as different.
    """
    bare = dataclasses.replace(config)  # without cached properties
    problem, formulation = config.problem, config.physics.formulation
    given = problem.model_dump(exclude_none=True)
    needed = {
        name: given[name]
        for name, field in type(problem).model_fields.items()
        if field.is_required() and name in given
    } | {"name": problem.name}
    text = "[problem]\n" + "".join(f"{name} = {value_text(one)}\n" for name, one in needed.items())
    try:
        plain = configuration.from_text(f'{text}[physics]\nformulation = "{formulation}"\n')
    except SphError:  # of a problem whose keys depend on each other, or on a file
        return [_setting(key, value, None) for key, value in _all(config)]
    found = [_setting(f"problem.{key}", one, None) for key, one in needed.items() if key != "name"]
    return found + [_setting(one.key, one.now, one.was) for one in restarts.changes(plain, bare)]


def _setting(key: str, value: Any, default: Any) -> dict[str, Any]:
    return {"key": key, "value": value, "default": default}


def _all(config: Config):
    for table, section in vars(config).items():
        if hasattr(section, "model_dump"):
            for key, value in section.model_dump(exclude_none=True).items():
                yield f"{table}.{key}", value
