"""Checks of the classes of models, and of the number of classes in a file."""

import inspect
import types
from collections.abc import Iterable
from typing import Any, Literal, get_args, get_origin, get_type_hints

from sph.declarations.messages import wrong
from sph.errors import DeclarationError
from sph.model import parameters


def only_class(module: types.ModuleType, found: Iterable[type], what: str) -> type:
    """Return the one class in `found`, those of the module that are `what`."""
    found = list(found)
    if len(found) != 1:
        names = ", ".join(kind.__name__ for kind in found) or "none"
        raise DeclarationError(
            f"{module.__file__}: expected one class that is {what}, found {names}"
        )
    return found[0]


def check_model(kind: Any, package: types.ModuleType) -> None:
    """Check a class with the decorator @model. package: that of its folder."""
    reserved = {"name", "switch", *(name for name in dir(kind) if name not in kind._fields)}
    try:
        get_type_hints(kind, include_extras=True)
    except Exception as error:
        raise wrong(kind, f"an annotation cannot be resolved ({error})") from error
    for name in kind._fields:
        if name in reserved or name == "issues":
            raise wrong(kind, f"parameter {name!r}: this name is reserved; rename it")
    for name, default in kind._field_defaults.items():
        if not isinstance(default, bool | int | float) and default not in _words(kind, name):
            raise wrong(kind, f"parameter {name!r}: the default is {default!r}, expected a number")
    if missing := [name for name in kind.required() if not hasattr(kind, name)]:
        raise wrong(kind, f"{', '.join(missing)} missing: expected a method or parameter")
    for name, verb in vars(package).items():
        expected = getattr(verb, "verb_parameters", None)
        method = getattr(kind, name, None)
        if expected is None or not inspect.isfunction(method):
            continue
        found = list(inspect.signature(method).parameters)
        if found[1:] != expected[1:]:
            raise wrong(kind, f"{name}({', '.join(found)}): expected {name}({', '.join(expected)})")


def _words(kind: Any, name: str) -> list[Any]:
    """Return the values of a Literal that the type of a parameter contains."""
    hint, _ = parameters(kind)[name]
    return [word for one in get_args(hint) if get_origin(one) is Literal for word in get_args(one)]
