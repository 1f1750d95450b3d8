"""From the text of a configuration to its valid tables, keeping in mind where each key stood."""

import re
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path as FilePath
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from sph import registry
from sph.config import checks
from sph.config.errors import (
    Issue,
    dotted,
    explain,
    not_finite,
    suggestion,
    wrong_value,
)
from sph.config.toml_text import Path, key_lines, value_text
from sph.errors import ConfigError, FileError
from sph.problems.base import Problem, Section

# Of two keys for the same thing, the one the user gives leaves the other's default out.
_IN_PLACE_OF = {"physics.eos": "gamma", "physics.gamma": "eos"}


class Source(NamedTuple):
    """Raw tables, and where each key was given: a line, or an override's own text."""

    name: str
    tables: dict[str, Any]
    places: dict[Path, int | str]

    def place(self, path: Path) -> int | str:
        """Where `path` was given, or the nearest table around it; 0 where nowhere."""
        ends = range(len(path), 0, -1)
        return next((self.places[path[:end]] for end in ends if path[:end] in self.places), 0)

    def report(self, issue: Issue) -> str:
        """The issue on one line, with its place."""
        place = self.place(issue.path)
        where = place if isinstance(place, str) else self.name
        line = f", line {place}" if isinstance(place, int) and place else ""
        return f"{where}{line}: {dotted(issue.path)}{_spaced(issue.text)}"

    def order(self, issue: Issue) -> tuple[bool, int]:
        """Sorts issues by line, those of overrides last."""
        place = self.place(issue.path)
        return (True, 0) if isinstance(place, str) else (False, place)


def _spaced(text: str) -> str:
    return text if text.startswith(":") else f" {text}"


# --- text to raw tables -----------------------------------------------------------------------


def read(path: str | FilePath) -> str:
    """The text of a file. Raises FileError."""
    try:
        return FilePath(path).read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise FileError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise FileError(f"{path}: a directory; expected a configuration file") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: not a configuration file (it is no UTF-8 text)") from None


def parse(text: str, name: str) -> Source:
    """Raw tables of a TOML text. Raises ConfigError where it is not TOML."""
    try:
        return Source(name, tomllib.loads(text), dict(key_lines(text)))
    except (ValueError, RecursionError) as error:
        raise ConfigError(_syntax_message(str(error), text, name)) from None


def _syntax_message(message: str, text: str, name: str) -> str:
    found = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", message, re.DOTALL)
    if found:
        return f"{name}, line {found[2]}, column {found[3]}: not valid TOML: {found[1]}"
    last = len(text.splitlines())
    return f"{name}, line {last}: not valid TOML: {message.removesuffix(' (at end of document)')}"


def _value(text: str) -> Any:
    """A value given on the command line: TOML, else the text itself."""
    try:
        found = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return found["value"] if list(found) == ["value"] else text


def _set(source: Source, override: str) -> None:
    """Set one `a.b=VALUE` in the source. Raises ConfigError if it has no such form."""
    name, equals, text = override.partition("=")
    path = tuple(step.strip() for step in name.split("."))
    if not equals or not all(path):
        raise ConfigError(f"--set {override}: expected TABLE.KEY=VALUE")
    try:
        override.encode()
    except UnicodeEncodeError:
        raise ConfigError(f"--set {override}: expected UTF-8 text, as in a file") from None
    table = source.tables
    for step in path[:-1]:
        if not isinstance(table.get(step), dict):
            table[step] = {}
        table = table[step]
    table[path[-1]] = _value(text)
    if other := _IN_PLACE_OF.get(dotted(path[:2])):
        source.tables[path[0]].pop(other, None)
    for old in [old for old in source.places if old[: len(path)] == path]:
        del source.places[old]
    source.places[path] = f"--set {override}"


# --- raw tables to valid ones -----------------------------------------------------------------


def resolve(
    source: Source,
    overrides: Sequence[str],
    sections: dict[str, type[Section]],
    recorded: bool = False,
) -> dict[str, Any]:
    """The valid tables by name. Raises ConfigError with one line for each thing wrong.

    recorded: the source describes a run that exists, which stays readable where a new run with its
    settings would be refused.
    """
    for override in overrides:
        _set(source, override)
    models: dict[str, type[Section]] = {"problem": Problem, **sections}
    raw, issues = _known_tables(source.tables, models)
    issues += checks.both_given(raw)
    problem = _problem_class(raw["problem"], issues)
    if problem is not None:
        models["problem"] = problem
        _fill_defaults(raw, problem)
        _fill_tables(raw["problem"], source, problem)
        issues += checks.shape_issues(raw["problem"], problem)
    issues += not_finite(raw)
    found = {}
    for name, model in models.items():
        if name == "problem" and problem is None:
            continue
        spoilt = {issue.path[1] for issue in issues if issue.path[0] == name and issue.path[1:]}
        try:
            found[name] = model.model_validate(_without(raw[name], spoilt))
        except ValidationError as error:
            details = _details(error, problem is not None, bool(spoilt))
            elsewhere = _tables_of_keys(models, besides=name)
            issues += explain(model, raw[name], details, name, elsewhere)
        except ArithmeticError as error:  # in a check across keys, such as a count of lattice cells
            text = (
                f": {error}; expected numbers nearer to 1, and a domain with sides of like length"
            )
            issues.append(Issue((name,), text))
    issues += checks.gas_issues(found)
    issues += checks.external_issues(found)
    if not recorded:
        issues += checks.pairing_issues(found)
    issues += checks.output_issues(found)
    if issues:
        raise ConfigError("\n".join(_reports(source, issues)))
    return found


def _without(table: dict[str, Any], keys: set[Any]) -> dict[str, Any]:
    """The table without keys that are known to be wrong: a problem's checks may rely on them."""
    return {key: value for key, value in table.items() if key not in keys}


def _details(error: ValidationError, problem_known: bool, spoilt: bool) -> list[ErrorDetails]:
    """The errors but for those that only follow from others already found."""
    found = error.errors(include_url=False)
    if not problem_known:  # what is missing may have a default that the problem gives
        found = [one for one in found if one["type"] != "missing"]
    return [one for one in found if one["loc"]] if spoilt else found


def _reports(source: Source, issues: Iterable[Issue]) -> list[str]:
    first: dict[Path, Issue] = {}
    for issue in issues:  # a key that is wrong in two ways is reported once
        first.setdefault(issue.path, issue)
    return [source.report(issue) for issue in sorted(first.values(), key=source.order)]


def _known_tables(
    given: dict[str, Any], models: dict[str, type[Section]]
) -> tuple[dict[str, dict[str, Any]], list[Issue]]:
    """A copy of every table, empty where not given; issues for all that is no table."""
    issues = []
    for name, value in given.items():
        if name not in models:
            issues.append(_unknown_table(name, value, models))
        elif not isinstance(value, dict):
            issues.append(Issue((name,), f"= {value_text(value)}: expected a table [{name}]"))
    raw = {}
    for name in models:
        value = given.get(name)
        raw[name] = dict(value) if isinstance(value, dict) else {}
    return raw, issues


def _unknown_table(name: str, value: Any, models: dict[str, type[Section]]) -> Issue:
    if name in (elsewhere := _tables_of_keys(models)):
        return Issue((name,), f"is not a table: it belongs in [{elsewhere[name]}]")
    if isinstance(value, dict):
        return Issue((name,), f"is not a table of a configuration; {suggestion(name, models)}")
    tables = ", ".join(f"[{one}]" for one in models)
    return Issue((name,), f"stands outside the tables; every key belongs in one of {tables}")


def _tables_of_keys(models: dict[str, type[Section]], besides: str = "") -> dict[str, str]:
    """The table of each key, but for one table's."""
    return {
        key: name for name, model in models.items() if name != besides for key in model.model_fields
    }


def _problem_class(raw: dict[str, Any], issues: list[Issue]) -> type[Problem] | None:
    """The class of the problem that is named; None, with an issue, where it names none."""
    valid, path = registry.names("sph.problems"), ("problem", "name")
    name = raw.get("name")
    if name in valid:
        return registry.load("sph.problems", name).Problem
    if name is None:
        issues.append(Issue(path, f"is missing: expected one of {', '.join(valid)}"))
    elif isinstance(name, str):
        issues.append(Issue(path, f'= "{name}" is not a problem; {suggestion(name, valid)}'))
    else:
        issues.append(wrong_value(path, name, str))
    return None


def _fill_defaults(raw: dict[str, dict[str, Any]], problem: type[Problem]) -> None:
    """Put the problem's own defaults under what the user gave."""
    for key, value in problem.defaults.items():
        table, name = key.split(".", 1)
        if _IN_PLACE_OF.get(key) not in raw[table]:
            raw[table].setdefault(name, value)


def _fill_tables(raw: dict[str, Any], source: Source, problem: type[Problem]) -> None:
    """Put a table's default under members of it that --set gives alone, as in any other table.

    A table that is given itself must be complete: half of a gas is not that of another tube.
    """
    for name, field in problem.model_fields.items():
        path = ("problem", name)
        whole = any(
            place[:2] == path and (place == path or isinstance(where, int))
            for place, where in source.places.items()
        )
        if isinstance(field.default, Section) and isinstance(raw.get(name), dict) and not whole:
            raw[name] = {**field.default.model_dump(), **raw[name]}
