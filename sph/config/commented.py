"""The commented configuration that `sph new` prints."""

import textwrap
import typing
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sph.config import restarts
from sph.config.choices import ModelChoice
from sph.config.errors import branches, choice_of, describe, field_annotation
from sph.config.toml_text import value_text
from sph.docstrings import docstring
from sph.problems.base import Section


def text(sections: Mapping[str, Section]) -> str:
    """Return TOML with every key; a comment above each gives its help, bounds and default."""
    return "\n".join(_table(name, section) for name, section in sections.items())


def _table(name: str, section: Section) -> str:
    model = type(section)
    unset = getattr(model, "filled_in", ())
    values = {key: None if key in unset else getattr(section, key) for key in model.model_fields}
    keys = (
        _key(key, field, _help(model, key), values[key], _restart(model, key))
        for key, field in model.model_fields.items()
    )
    summary = _comment(docstring(model).partition("\n\n")[0])
    return f"{summary}[{name}]\n\n" + "\n".join(keys)


def _help(model: type[BaseModel], key: str) -> str:
    """Return the description of a key, from the class or the nearest base class that has one."""
    fields = (base.model_fields.get(key) for base in model.__mro__ if issubclass(base, BaseModel))
    return next((field.description for field in fields if field and field.description), key)


def _restart(model: type[Section], key: str) -> str:
    """Return the key's class in a restart, or "" if all keys of its table have the same class."""
    return "" if model.restart else f"in a restart: {restarts.class_of(model, key)}"


def _key(key: str, field: FieldInfo, sentence: str, value: Any, restart: str) -> str:
    annotation = field_annotation(field)
    shown = _plain(value)
    default = "" if shown is None else f"default {value_text(shown)}"
    kind = describe(annotation)
    fits = default and len(kind) + len(default) < 90
    lines = [f"{kind}; {default}"] if fits else [kind, default]
    above = _comment(sentence) + "".join(_comment(f"  {line}") for line in lines)
    above += _comment(f"  {restart}") if restart else ""
    entries = "".join(_entries(branch) for branch in branches(annotation))
    return above + entries + _line(key, field, shown)


def _plain(value: Any) -> Any:
    """Return a value of numbers, texts, lists and tables."""
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_none=True)
    return [_plain(one) for one in value] if isinstance(value, list) else value


def _entries(branch: Any) -> str:
    """Return a comment line for each key of an inline table, "" if the value is not a table.

    For a table that names a model: the parameters of each model that has some.
    """
    tables: dict[str, type[BaseModel]]
    bare = typing.get_args(branch)[0] if typing.get_origin(branch) is typing.Annotated else branch
    if isinstance(choice := choice_of(branch), ModelChoice):
        tables = {f"{name}: ": choice.parameters(name) for name in choice.valid_names()}
    elif isinstance(branch, type) and issubclass(branch, BaseModel):
        tables = {"": branch}
    elif typing.get_origin(bare) is list:
        return "".join(_entries(entry) for entry in typing.get_args(bare))
    else:
        return ""
    return "".join(
        _comment(f"  {of}{key}: {field.description or key}, {describe(field_annotation(field))}")
        for of, table in tables.items()
        for key, field in table.model_fields.items()
    )


def _line(key: str, field: FieldInfo, value: Any) -> str:
    if value is not None:
        return f"{key} = {value_text(value)}\n"
    example = f" {value_text(field.examples[0])}" if field.examples else ""
    return f"# {key} ={example}\n"


def _comment(sentence: str) -> str:
    if not sentence.strip():
        return ""
    indent = " " * (len(sentence) - len(sentence.lstrip()))
    words = " ".join(sentence.split())
    lines = textwrap.wrap(
        words, 98, initial_indent=indent, subsequent_indent=indent + "  ", break_long_words=False
    )
    return "".join(f"# {line}\n" for line in lines)
