"""Messages on a wrong configuration: where, what was found, what was expected."""

import difflib
import math
import types
import typing
from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from sph.config.toml_text import Path, value_text


class Issue(NamedTuple):
    """One error: the path of the key, and the text that follows the key's name in the message."""

    path: Path
    text: str


def dotted(path: Path) -> str:
    """Return a path as the user writes it: ("problem", "domain", 1) gives "problem.domain[1]"."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def nearest(name: str, valid: Iterable[str]) -> str | None:
    """Return the valid name that is most similar to `name`, or None if none is similar."""
    by_lower = {one.lower(): one for one in valid}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.5)
    return by_lower[close[0]] if close else None


def suggestion(name: str, valid: Iterable[str]) -> str:
    """Return the end of a message on a wrong name: the most similar valid name, or all names."""
    valid = list(valid)
    close = nearest(name, valid)
    return f"did you mean {close}?" if close else f"expected one of {', '.join(valid) or 'none'}"


def wrong_value(path: Path, value: Any, annotation: Any, example: Any = None) -> Issue:
    """Return the issue that `value` does not match `annotation`, the type of its key.

    example: a valid value of the key, None if no example is known.
    """
    kinds = [_plain(one)[0] for one in branches(annotation)]
    hint = _such_as(path, example)
    if isinstance(value, str) and (close := nearest(value, valid_names(annotation))):
        hint = f'; did you mean "{close}"?'
    elif isinstance(value, float) and value.is_integer() and int in kinds:
        hint = _such_as(path, int(value))
    elif isinstance(value, dict) and any(is_list_of_tables(one) for one in kinds):
        hint = f". Try: [[{dotted(path)}]] for each, in place of [{dotted(path)}]"
    return Issue(path, f"= {_found(value)}: expected {describe(annotation)}{hint}")


def _such_as(path: Path, example: Any) -> str:
    """Return the end of a message with an example of the key that a path leads to."""
    key = next((str(step) for step in reversed(path) if isinstance(step, str)), "")
    return "" if example is None else f", such as {key} = {value_text(example)}"


def not_finite(value: Any, path: Path = ()) -> Iterator[Issue]:
    """Yield an issue for every infinity and NaN in nested tables and lists."""
    if isinstance(value, float) and not math.isfinite(value):
        yield Issue(path, f"= {_found(value)}: expected a finite number")
    elif isinstance(value, dict | list):
        for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
            yield from not_finite(entry, (*path, key))


def as_error(issues: Iterable[Issue]) -> PydanticCustomError:
    """Return an error to raise in a validator. Paths of the issues are relative to its value."""
    return PydanticCustomError("issues", "{issues}", {"issues": list(issues)})


def _found(value: Any) -> str:
    text = value_text(value)
    return text if len(text) <= 60 else text[:57] + "..."


# --- descriptions of types --------------------------------------------------------------------

_NOUNS = {float: "number", int: "whole number", str: "string"}
_BOUNDS = {"gt": "greater than", "ge": "of at least", "lt": "less than", "le": "of at most"}


def field_annotation(field: FieldInfo) -> Any:
    """Return the type of a field with its bounds."""
    return Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation


def _plain(annotation: Any) -> tuple[Any, list[Any]]:
    """Return the type without its annotations, and the list of its annotations."""
    if typing.get_origin(annotation) is not Annotated:
        return annotation, []
    bare, *said = typing.get_args(annotation)
    flat = [
        each for one in said for each in (one.metadata if isinstance(one, FieldInfo) else [one])
    ]
    return bare, flat


def branches(annotation: Any) -> list[Any]:
    """Return the alternatives of a union other than None; a list of the type itself if no union."""
    bare, said = _plain(annotation)
    if _choice(said) or typing.get_origin(bare) not in (types.UnionType, typing.Union):
        return [annotation]
    some = [one for one in typing.get_args(bare) if one is not type(None)]
    return [Annotated[(one, *said)] if said else one for one in some]


def choice_of(annotation: Any) -> Any:
    """Return the `sph.config.choices.Choice` that annotates a key, or None."""
    return _choice(_plain(annotation)[1])


def _choice(said: list[Any]) -> Any:
    return next((one for one in said if hasattr(one, "valid_names")), None)


def is_list_of_tables(bare: Any) -> bool:
    return typing.get_origin(bare) is list and _is_table(_plain(typing.get_args(bare)[0])[0])


def _is_table(bare: Any) -> bool:
    return isinstance(bare, type) and issubclass(bare, BaseModel)


def _bounds(said: list[Any]) -> str:
    # as text without ".0": `typing` takes equal types for one, so 0.0 may come back as 0
    found = {
        name: f"{getattr(one, name):.15g}" for one in said for name in _BOUNDS if hasattr(one, name)
    }
    if {"ge", "le"} <= found.keys():
        return f" from {found['ge']} to {found['le']}"
    parts = [f"{words} {found[name]}" for name, words in _BOUNDS.items() if name in found]
    return " " + " and ".join(parts) if parts else ""


def _length(said: list[Any]) -> str:
    low = next((one.min_length for one in said if hasattr(one, "min_length")), None)
    high = next((one.max_length for one in said if hasattr(one, "max_length")), None)
    if high is not None:
        return f"{high} " if low == high else f"{low or 0} to {high} "
    words = {None: "", 0: "", 1: "one or more "}
    return words.get(low, f"at least {low} ")


def describe(annotation: Any, plural: bool = False) -> str:
    """Return a description of a type and its bounds, e.g. "a number greater than 1"."""
    alternatives = branches(annotation)
    if len(alternatives) > 1:
        return _any_of(alternatives, plural)
    bare, said = _plain(alternatives[0])
    if choice := _choice(said):
        return choice.describe()
    if typing.get_origin(bare) is Literal:
        *most, last = [value_text(one) for one in typing.get_args(bare)]
        return f"{', '.join(most)} or {last}" if most else last
    if typing.get_origin(bare) is list:
        entries = describe(typing.get_args(bare)[0], plural=True)
        words = next((one for one in said if isinstance(one, str)), "")  # in place of a number
        length = "" if words else _length(said)
        return f"{'lists' if plural else 'a list'} of {length}{entries}" + (words and f", {words}")
    if _is_table(bare):
        return ("tables" if plural else "a table") + f" {{ {', '.join(bare.model_fields)} }}"
    if typing.get_origin(bare) is dict:
        return "a table"
    if bare is bool:
        return "true or false"
    noun = _NOUNS.get(bare, "value")
    return (f"{noun}s" if plural else f"a {noun}") + _bounds(said)


def _any_of(alternatives: list[Any], plural: bool) -> str:
    parts = []
    for one in alternatives:
        entries = typing.get_args(one) if typing.get_origin(one) is list else ()
        these = bool(entries) and entries[0] in alternatives
        parts.append("a list of these" if these else describe(one, plural))
    return (", or " if any('"' in part for part in parts[:-1]) else " or ").join(parts)


def valid_names(annotation: Any) -> list[str]:
    """Return all fixed names that are valid values of this type."""
    found: list[str] = []
    for branch in branches(annotation):
        bare, said = _plain(branch)
        if choice := _choice(said):
            found += choice.valid_names()
        elif typing.get_origin(bare) is Literal:
            found += [one for one in typing.get_args(bare) if isinstance(one, str)]
        elif typing.get_origin(bare) is list:
            found += valid_names(typing.get_args(bare)[0])
    return found


def inner(annotation: Any, path: Path) -> Any:
    """Return the type of the entry at `path` within a value of type `annotation`."""
    for step in path:
        found = []
        for branch in branches(annotation):
            bare, _ = _plain(branch)
            if isinstance(step, int) and typing.get_origin(bare) is list:
                found.append(typing.get_args(bare)[0])
            elif typing.get_origin(bare) is dict:
                found.append(typing.get_args(bare)[1])
            elif _is_table(bare) and step in bare.model_fields:
                found.append(field_annotation(bare.model_fields[step]))
        if not found:
            return Any
        annotation = typing.Union[tuple(found)]  # noqa: UP007 (a tuple of types)
    return annotation


# --- from pydantic's errors -------------------------------------------------------------------


class _Located(NamedTuple):
    path: Path  # steps into the value
    union: Path | None  # path of the first union passed on the way
    branch: str | int | None  # which of its alternatives was tried
    error: ErrorDetails


def _locate(error: ErrorDetails, raw: Any) -> _Located:
    """Separate the steps into the value from the names that pydantic gives to union branches."""
    steps = error["loc"]
    path, union, branch, value = [], None, None, raw
    for i, step in enumerate(steps):
        absent = i == 0 or (i == len(steps) - 1 and error["type"] == "missing")
        inside = (isinstance(value, dict) and step in value) or (
            isinstance(value, list) and isinstance(step, int)
        )
        if inside or absent:
            path.append(step)
            value = value[step] if inside else None
        elif union is None:
            union, branch = tuple(path), step
    return _Located(tuple(path), union, branch, error)


_HAVE_OWN_TEXT = ("value_error", "assertion_error", "issues")


def _of_one_branch(found: list[_Located]) -> list[_Located]:
    """Return the errors of one branch of a union, of which pydantic reports every branch.

    This is the branch that the user most likely meant, or one error for the whole union.
    """
    tried = defaultdict(list)
    for one in found:
        tried[one.branch].append(one)
    meant = [
        errors
        for errors in tried.values()
        if all(one.path != one.union or one.error["type"] in _HAVE_OWN_TEXT for one in errors)
    ]
    if not meant:
        return [next(one for one in found if one.path == one.union)]
    return min(meant, key=lambda errors: (len(errors), -max(len(one.path) for one in errors)))


def explain(
    model: type[BaseModel],
    raw: dict[str, Any],
    errors: list[ErrorDetails],
    table: str,
    elsewhere: dict[str, str],
) -> list[Issue]:
    """Return one issue for each error that pydantic found in `raw`, the table named `table`.

    `elsewhere` maps each key that belongs elsewhere to where that is, such as "in [physics]".
    """
    located = [_locate(error, raw) for error in errors]
    unions = defaultdict(list)
    for one in located:
        if one.union is not None:
            unions[one.union].append(one)
    kept = [one for one in located if one.union is None]
    kept += [one for found in unions.values() for one in _of_one_branch(found)]
    return [issue for one in kept for issue in _issues(one, model, (table,), elsewhere)]


def _issues(
    located: _Located, model: type[BaseModel], prefix: Path, elsewhere: dict[str, str]
) -> list[Issue]:
    path, error = prefix + located.path, located.error
    match error["type"]:
        case "issues":
            return [Issue(path + one.path, one.text) for one in error["ctx"]["issues"]]
        case "value_error" | "assertion_error":
            return [Issue(path, f": {error['ctx']['error']}")]
        case "missing":
            annotation, example = inner(model, located.path), _example(model, located.path)
            text = f"is missing: expected {describe(annotation)}"
            return [Issue(path, text + _such_as(path, example))]
        case "extra_forbidden":
            holder = inner(model, located.path[:-1])
            return [_unknown_key(path, holder, elsewhere if len(path) == 2 else {})]
    annotation, example = inner(model, located.path), _example(model, located.path)
    return [wrong_value(path, error["input"], annotation, example)]


def _example(model: type[BaseModel], path: Path) -> Any:
    """Return the example of the key at `path`, or that holds the entry at `path`, or None."""
    while path and isinstance(path[-1], int):
        path = path[:-1]
    for one in branches(inner(model, path[:-1])) if path else ():
        holder, _ = _plain(one)
        if _is_table(holder) and path[-1] in holder.model_fields:
            return (holder.model_fields[path[-1]].examples or [None])[0]
    return None


def _unknown_key(path: Path, holder: Any, elsewhere: dict[str, str]) -> Issue:
    valid = [
        key for one in branches(holder) if _is_table(_plain(one)[0]) for key in one.model_fields
    ]
    return unknown_key(path, valid, elsewhere)


def unknown_key(path: Path, valid: Iterable[str], elsewhere: dict[str, str]) -> Issue:
    """Return the issue that the last step of `path` is not a key of its table.

    `valid` holds the keys of the table; `elsewhere` maps other keys to where they belong.
    """
    key, table = str(path[-1]), dotted(path[:-1])
    if key in elsewhere:
        return Issue(path, f"is not a key of [{table}]: {key} belongs {elsewhere[key]}")
    return Issue(path, f"is not a key of [{table}]; {suggestion(key, valid)}")
