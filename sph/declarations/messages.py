"""Errors of declarations: they name the class and say what is expected."""

from typing import Any

from sph.errors import DeclarationError


def check_entries(kind: type, name: str, found: Any, expected: type) -> None:
    """Check that an attribute is a tuple (or list) of `expected`."""
    if not isinstance(found, tuple | list) or hasattr(found, "_fields"):
        hint = " (a comma is missing)" if isinstance(found, expected) else ""
        raise wrong(kind, f"{name} = {found!r:.60}: expected a tuple of {_named(expected)}{hint}")
    for one in found:
        if not isinstance(one, expected):
            raise wrong(kind, f"{name}: {one!r:.60} is not a {_named(expected)}")


def _named(kind: Any) -> str:
    return getattr(kind, "__name__", str(kind))


def label(kind: type) -> str:
    return f"{kind.__module__}.{kind.__name__}"


def wrong(kind: type, what: str) -> DeclarationError:
    return DeclarationError(f"{label(kind)}: {what}")
