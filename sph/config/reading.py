"""Reading of a configuration: TOML text to validated tables, with the line of each key."""

import os
import re
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path as FilePath
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from sph.config import checks, outside, physics, problem_choice, removal
from sph.config.errors import (
    Issue,
    dotted,
    explain,
    not_finite,
    suggestion,
)
from sph.config.toml_text import Path, key_lines, value_text
from sph.config.units import Units
from sph.errors import ConfigError, FileError
from sph.problems.base import Problem, Section

# Keys that exclude each other: if the user gives one, the default of the other is not used.
_IN_PLACE_OF = {
    "physics.eos": ("gamma", "materials"),
    "physics.gamma": ("eos", "materials"),
    "physics.strength": ("materials",),
    "physics.materials": ("eos", "gamma", "strength"),
}
# A problem's default strength belongs to its default equation of state: a user who gives the
# equation of state of a liquid must not get a solid.
_WITHOUT_DEFAULT = {**_IN_PLACE_OF, "physics.strength": ("eos", "gamma", "materials")}


class Source(NamedTuple):
    """Tables before validation, and the origin of each key: a line number or an override."""

    name: str
    tables: dict[str, Any]
    places: dict[Path, int | str]
    directory: str = ""  # of the file; "" is the current directory

    def place(self, path: Path) -> int | str:
        """Return the origin of `path`, or of the innermost table around it that has one, else 0.

        The origin of a table that only overrides of its keys made is the first of these.
        """
        if len(path) > 1 and path not in self.places:
            inside = (one for one in self.places if one[: len(path)] == path)
            path = next(inside, path)
        ends = range(len(path), 0, -1)
        return next((self.places[path[:end]] for end in ends if path[:end] in self.places), 0)

    def report(self, issue: Issue) -> str:
        """Return the message of an issue, one line that begins with its origin."""
        place = self.place(issue.path)
        where = place if isinstance(place, str) else self.name
        line = f", line {place}" if isinstance(place, int) and place else ""
        return f"{where}{line}: {dotted(issue.path)}{_spaced(issue.text)}"

    def order(self, issue: Issue) -> tuple[bool, int]:
        """Return a key that sorts issues by line, with those of overrides last."""
        place = self.place(issue.path)
        return (True, 0) if isinstance(place, str) else (False, place)


def _spaced(text: str) -> str:
    return text if text.startswith(":") else f" {text}"


# --- text to tables ---------------------------------------------------------------------------


def read(path: str | FilePath) -> str:
    """Return the text of a file. Raises FileError."""
    try:
        return FilePath(path).read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise FileError(f"{path}: file not found") from None
    except IsADirectoryError:
        raise FileError(f"{path}: is a directory; expected a configuration file") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: not a configuration file (it is not UTF-8 text)") from None


def parse(text: str, name: str, directory: str = "") -> Source:
    """Return the tables of a TOML text. Raises ConfigError if the text is not valid TOML.

    directory: where relative paths in the text begin.
    """
    try:
        return Source(name, tomllib.loads(text), dict(key_lines(text)), directory)
    except (ValueError, RecursionError) as error:
        raise ConfigError(_syntax_message(str(error), text, name)) from None


def _syntax_message(message: str, text: str, name: str) -> str:
    found = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", message, re.DOTALL)
    if found:
        line, column = int(found[2]), int(found[3])
        there = text.splitlines()[line - 1] if line <= len(text.splitlines()) else ""
        hint = _syntax_hint(there, column)
        return f"{name}, line {line}, column {column}: not valid TOML: {found[1]}{hint}"
    last = len(text.splitlines())
    return f"{name}, line {last}: not valid TOML: {message.removesuffix(' (at end of document)')}"


def _syntax_hint(line: str, column: int) -> str:
    """Return the end of a message on a line that is not valid TOML."""
    rest = line[column - 1 :]
    if rest.startswith(".") or _POINT.match(rest):
        return " (TOML needs digits on both sides of a point: 0.5)"
    header = _HEADER.fullmatch(line)
    if header and header[1] in REPEATED:
        return f". Try: [[problem.{header[1]}]] for each, in place of [problem.{header[1]}]"
    return ""


# Keys of [problem] of sph that are a table for each of several things, [[problem.KEY]].
REPEATED = ("body", "region")
_HEADER = re.compile(r"\s*\[+\s*problem\s*\.\s*(\w+)\s*\]+\s*(?:#.*)?")

# A number without a digit before or after its point, which TOML does not know.
_POINT = re.compile(r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?(?![\w.])")


def _value(text: str) -> Any:
    """Return a value given on the command line: parsed as TOML, or else the text itself."""
    try:
        found = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return float(text) if _POINT.fullmatch(text.strip()) else text
    return found["value"] if list(found) == ["value"] else text


def _set(source: Source, override: str) -> Path:
    """Set one override `a.b=VALUE` in the source, and return its path.

    VALUE = none removes the key. Raises ConfigError if the form is wrong.
    """
    name, equals, text = override.partition("=")
    path = tuple(step.strip() for step in name.split("."))
    if not equals or not all(path):
        raise ConfigError(f"--set {override}: expected TABLE.KEY=VALUE")
    try:
        override.encode()
    except UnicodeEncodeError:
        raise ConfigError(f"--set {override}: expected UTF-8 text") from None
    table = source.tables
    for step in path[:-1]:
        if not isinstance(table.get(step), dict):
            table[step] = {}
        table = table[step]
    if text.strip() == removal.NONE:
        table.pop(path[-1], None)
    else:
        table[path[-1]] = _value(text)
        for other in _IN_PLACE_OF.get(dotted(path[:2]), ()):
            source.tables[path[0]].pop(other, None)
    for old in [old for old in source.places if old[: len(path)] == path]:
        del source.places[old]
    source.places[path] = f"--set {override}"
    return path


# --- validation -------------------------------------------------------------------------------


def resolve(
    source: Source,
    overrides: Sequence[str],
    sections: dict[str, type[Section]],
    recorded: bool = False,
    problem: type[Problem] | None = None,
) -> dict[str, Any]:
    """Return the validated tables by name. Raises ConfigError with one line for each error.

    recorded: the source is the configuration of an existing run. Such a run stays readable even if
    a new run with its settings would be refused. problem: class of the problem, if not chosen by
    [problem].
    """
    paths = [_set(source, override) for override in overrides]
    models: dict[str, type[Section]] = {
        "problem": Problem, "physics": physics.table(physics.DEFAULT), **sections
    }  # fmt: skip
    raw, issues = _known_tables(source.tables, models)
    issues += checks.both_given(raw)
    if problem is None:
        is_in_file = isinstance(source.places.get(("problem", "file")), int)
        start, run = source.directory if is_in_file else "", source.name if recorded else ""
        problem = problem_choice.chosen(raw["problem"], start, issues, run)
    if problem is not None:
        models["problem"] = problem
        raw["physics"].setdefault(
            "formulation", problem.defaults.get("physics.formulation", physics.DEFAULT)
        )
        models["physics"] = physics.chosen(raw["physics"])
        issues += removal.issues(paths, source.tables, problem, models)
        _fill_defaults(raw, problem, models)
        _fill_tables(raw["problem"], source, problem)
        _make_paths_absolute(raw["problem"], source, problem)
        raw["problem"], faults = problem.filled(raw["problem"], _in_cgs(raw["units"]))
        issues += [Issue(("problem", *fault.path), fault.text) for fault in faults]
        issues += checks.shape_issues(raw["problem"], problem)
    issues += not_finite(raw)
    found = {}
    for name, model in models.items():
        if name == "problem" and problem is None:
            continue
        spoilt = {issue.path[1] for issue in issues if issue.path[0] == name and issue.path[1:]}
        try:
            with outside.validating(model):
                found[name] = model.model_validate(_without(raw[name], spoilt))
        except ValidationError as error:
            details = _details(error, problem is not None, bool(spoilt))
            tables = _tables_of_keys(models, besides=name)
            elsewhere = {key: f"in [{one}]" for key, one in tables.items()}
            if name == "physics":
                elsewhere |= physics.keys_of_other_formulations(raw["physics"])
            issues += explain(model, raw[name], details, name, elsewhere)
        except ArithmeticError as error:  # in a validator, such as the count of lattice cells
            text = f": {error}; expected numbers closer to 1, and domain sides of similar length"
            issues.append(Issue((name,), text))
    issues += checks.gas_issues(found)
    issues += checks.part_issues(found)
    issues += checks.under_physics(found)
    checks.under_units(found)
    issues += checks.steps_issues(found)
    if not recorded:
        issues += checks.pairing_issues(found)
    issues += checks.output_issues(found)
    if issues:
        raise ConfigError("\n".join(_reports(source, issues)))
    return found


def _in_cgs(raw: dict[str, Any]) -> tuple[float, float, float] | None:
    """Return [units] in cm, g and s; None if not given, or wrong, which is reported elsewhere."""
    try:
        units = Units.model_validate(raw)
    except ValidationError:
        return None
    return units.in_cgs() if units.are_given else None


def _without(table: dict[str, Any], keys: set[Any]) -> dict[str, Any]:
    """Return the table without keys known to be wrong, on which a problem's checks may rely."""
    return {key: value for key, value in table.items() if key not in keys}


def _details(error: ValidationError, problem_known: bool, spoilt: bool) -> list[ErrorDetails]:
    """Return the errors that do not merely follow from errors already reported."""
    found = error.errors(include_url=False)
    if not problem_known:  # the problem might give a default for a missing key
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
    """Return a copy of every table (empty if not given), and issues for all that is not a table."""
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
        return Issue((name,), f"is not a table but a key of [{elsewhere[name]}]")
    if isinstance(value, dict):
        return Issue((name,), f"is not a table of the configuration; {suggestion(name, models)}")
    tables = ", ".join(f"[{one}]" for one in models)
    return Issue((name,), f"is outside all tables: expected every key in one of {tables}")


def _tables_of_keys(models: dict[str, type[Section]], besides: str = "") -> dict[str, str]:
    """Return the table of each key, except for the keys of table `besides`."""
    return {
        key: name for name, model in models.items() if name != besides for key in model.model_fields
    }


def _fill_defaults(
    raw: dict[str, dict[str, Any]], problem: type[Problem], models: dict[str, type[Section]]
) -> None:
    """Add the problem's own defaults to keys that the user did not give.

    A default for a key that the formulation does not have is for another formulation.
    """
    given = {f"{table}.{name}" for table, keys in raw.items() for name in keys}
    for key, value in problem.defaults.items():
        table, name = key.split(".", 1)
        if name not in models[table].model_fields:
            problem_choice.check_physics_key(problem, name, raw["physics"])
            continue
        if not given & {f"{table}.{other}" for other in _WITHOUT_DEFAULT.get(key, ())}:
            raw[table].setdefault(name, value)


def _make_paths_absolute(raw: dict[str, Any], source: Source, problem: type[Problem]) -> None:
    """Let paths in the file begin at its directory, and those of --set at the current one."""
    for key in problem.paths:
        if isinstance(path := raw.get(key), str) and path:
            is_in_file = isinstance(source.places.get(("problem", key)), int)
            start = source.directory if is_in_file else ""
            raw[key] = os.path.abspath(os.path.join(start, path))


def _fill_tables(raw: dict[str, Any], source: Source, problem: type[Problem]) -> None:
    """Complete inline tables of [problem] of which --set gives some keys, from their defaults.

    An inline table that the file gives must be complete. Otherwise a gas could be mixed from two
    shock tubes.
    """
    for name, field in problem.model_fields.items():
        path = ("problem", name)
        whole = any(
            place[:2] == path and (place == path or isinstance(where, int))
            for place, where in source.places.items()
        )
        if isinstance(field.default, Section) and isinstance(raw.get(name), dict) and not whole:
            raw[name] = {**field.default.model_dump(), **raw[name]}
