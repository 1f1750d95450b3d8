"""The class of the problem that the table [problem] chooses, by name or by file."""

import os
from typing import Any

from sph.config import outside, physics
from sph.config.errors import Issue, suggestion, wrong_value
from sph.config.outside import Outside
from sph.config.toml_text import value_text
from sph.errors import DeclarationError, FileError
from sph.problems.base import Problem


def chosen(
    raw: dict[str, Any], start: str, issues: list[Issue], run: str = ""
) -> type[Problem] | None:
    """Return the class of the problem, or None, with an issue, if there is none.

    raw: the table [problem], in which the path of a file becomes absolute, and the keys that record
    the sources of the problem are filled in; start: directory where a relative path begins; run:
    name of the configuration of an existing run, whose problem may have changed since. Raises
    DeclarationError for a wrong class, and FileError if the file of an existing run is gone.
    """
    if "file" in raw and raw.get("name") != "file":
        return _in_file(raw, start, issues, run)
    path, name = ("problem", "name"), raw.get("name")
    if isinstance(name, str) and (found := outside.problem_class(name)):
        if not run:
            issues += _package_issues(raw, found)
        return found
    valid = outside.names()
    if name is None:
        text = f"is missing: expected one of {', '.join(valid)}; or problem.file"
        issues.append(Issue(path, text))
    elif isinstance(name, str):
        issues.append(Issue(path, f'= "{name}" is not a problem; {suggestion(name, valid)}'))
    else:
        issues.append(wrong_value(path, name, str))
    return None


def _in_file(
    raw: dict[str, Any], start: str, issues: list[Issue], run: str
) -> type[Problem] | None:
    path, name = ("problem", "file"), raw["file"]
    if not isinstance(name, str) or not name or "\0" in name:
        issues.append(wrong_value(path, name, str))
        return None
    raw["file"] = os.path.abspath(os.path.join(start, name))
    try:
        found, digest = outside.of_file(raw["file"])
    except DeclarationError as error:
        if run:
            raise FileError(
                f"{run} needs its problem file: {error}\nTry: put the file back; problem.py in "
                "the run directory is a copy, as the file was when the run began."
            ) from error
        issues.append(Issue(path, f"= {value_text(name)}: {error}"))
        return None
    given = raw.setdefault("file_sha256", digest)
    if given != digest and not run:
        text = (
            f"= {value_text(given)}: {raw['file']} has changed, or is another file: its SHA-256 is "
            f"{digest}. Try: the original file, or leave file_sha256 out"
        )
        issues.append(Issue(("problem", "file_sha256"), text))
    return found


def _package_issues(raw: dict[str, Any], problem: type[Problem]) -> list[Issue]:
    """Return an issue if problem.package is given, and is not the distribution that is there."""
    there = problem.model_fields.get("package")
    if not issubclass(problem, Outside) or there is None:
        return []
    given = raw.setdefault("package", there.default)
    if given == there.default:
        return []
    text = (
        f"= {value_text(given)}: {there.default} is installed. Try: that version, or leave package "
        "out"
    )
    return [Issue(("problem", "package"), text)]


def check_physics_key(problem: type[Problem], key: str, raw: dict[str, Any]) -> None:
    """Raise DeclarationError for a default of a key that no formulation has."""
    if issubclass(problem, Outside) and key not in physics.keys_of_other_formulations(raw):
        raise DeclarationError(
            f"{problem.origin}: defaults has 'physics.{key}', which is not a key; "
            f"{suggestion(key, physics.chosen(raw).model_fields)}"
        )
