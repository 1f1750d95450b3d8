"""Errors of declarations: they name the class and say what is expected."""

from collections.abc import Mapping
from typing import Any

from sph.errors import DeclarationError
from sph.quantity import Quantity


def check_entries(kind: type, name: str, found: Any, expected: type) -> None:
    """Check that an attribute is a tuple (or list) of `expected`."""
    if not isinstance(found, tuple | list) or hasattr(found, "_fields"):
        hint = " (a comma is missing)" if isinstance(found, expected) else ""
        raise wrong(kind, f"{name} = {found!r:.60}: expected a tuple of {_named(expected)}{hint}")
    for one in found:
        if not isinstance(one, expected):
            raise wrong(kind, f"{name}: {one!r:.60} is not a {_named(expected)}")


def check_quantities(kind: type, name: str, found: Any) -> None:
    """Check that an attribute maps names to quantities with a help text."""
    example = '{"tether_energy": Quantity("energy of the springs", "mass length^2 time^-2")}'
    if not isinstance(found, Mapping):
        raise wrong(kind, f"{name} = {found!r:.60}: expected names with quantities, as {example}")
    for key, one in found.items():
        if not isinstance(one, Quantity) or not one.help:
            raise wrong(
                kind, f"{name}: {key!r} has no meaning: expected a Quantity with a help text and a "
                f"unit, as {example}"
            )  # fmt: skip


def _named(kind: Any) -> str:
    return getattr(kind, "__name__", str(kind))


def label(kind: type) -> str:
    return f"{kind.__module__}.{kind.__name__}"


def wrong(kind: type, what: str) -> DeclarationError:
    return DeclarationError(f"{label(kind)}: {what}")
