"""Overrides KEY=none: the key is not given, as if the configuration did not contain it."""

from collections.abc import Iterable
from typing import Any

from sph.config.errors import Issue, unknown_key
from sph.config.toml_text import Path
from sph.problems.base import Problem, Section

NONE = "none"


def issues(
    paths: Iterable[Path],
    tables: dict[str, Any],
    problem: type[Problem],
    models: dict[str, type[Section]],
) -> list[Issue]:
    """Return issues of overrides with NONE: only keys whose default is no value take it.

    paths: of all overrides; tables: with the overrides applied.
    """
    found = []
    for path in paths:
        if path[0] not in models or _is_given(tables, path):
            continue
        fields = models[path[0]].model_fields
        key = str(path[1]) if len(path) > 1 else ""
        if key not in fields:
            found.append(unknown_key(path[:2], fields, {}))
        elif len(path) > 2:
            text = f"= {NONE}: expected a value; only a whole key of [{path[0]}] takes {NONE}"
            found.append(Issue(path, text))
        elif _default(problem, path, fields[key]) is not None:
            text = f"= {NONE}: expected a value; only keys without a default take {NONE}"
            found.append(Issue(path, text))
    return found


def _is_given(tables: dict[str, Any], path: Path) -> bool:
    where: Any = tables
    for step in path:
        if not isinstance(where, dict) or step not in where:
            return False
        where = where[step]
    return True


def _default(problem: type[Problem], path: Path, field: Any) -> Any:
    """Return the default of a key, that of the problem if it has one."""
    usual = field.get_default(call_default_factory=True)
    return problem.defaults.get(".".join(map(str, path)), usual)
