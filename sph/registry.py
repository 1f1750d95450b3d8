"""Find kernels, equations of state, schemes, parts and problems by looking into their folder.

Beside the folders of `sph` those of `sph_extensions` are looked into, a package that users make:
sph_extensions/kernels/mine.py on the Python path is found as sph/kernels/mine.py would be. It has
no __init__.py, so several places may hold a share of it.
"""

import importlib
import importlib.util
import pkgutil
from types import ModuleType
from typing import Any

from sph.part import Part

EXTENSIONS = "sph_extensions"

_known: dict[tuple, str] = {}  # modules of model classes, by what Numba tells them apart by


def names(package: str, folders: bool = False) -> list[str]:
    """Names of the modules in `package`, e.g. names("sph.kernels"): one file is one choice.

    folders: folders are choices too, e.g. parts. Files whose name begins with an underscore or is
    "base" are shared, not choices.
    """
    return sorted(_places(package, folders))


def load(package: str, name: str, folders: bool = False) -> ModuleType:
    """The module of that choice. Raises KeyError naming the valid ones."""
    places = _places(package, folders)
    if name not in places:
        raise KeyError(f"no {name!r} in {package}; there are {', '.join(sorted(places))}")
    return importlib.import_module(f"{places[name]}.{name}")


def model_class(package: str, name: str) -> type:
    """The NamedTuple that a model's file defines: the one class with fields and formulas in it.

    Raises TypeError where it is not decorated with `sph.model.model`, or where its name is not its
    own in the whole program: Numba tells named tuples apart by the name of the class and of the
    fields, so two alike would share their formulas.
    """
    module = load(package, name)
    (found,) = (
        kind
        for kind in vars(module).values()
        if isinstance(kind, type)
        and hasattr(kind, "_fields")
        and kind.__module__ == module.__name__
    )
    if not hasattr(found, "issues"):
        raise TypeError(
            f"{module.__name__}: decorate {found.__name__} with @model(Base) of sph.model, where "
            f"Base is the class in {package} that has what a model may leave out"
        )
    other = _known.setdefault((found.__name__, found._fields), module.__name__)
    if other != module.__name__:
        raise TypeError(
            f"{module.__name__} and {other} both define a model {found.__name__}"
            f"({', '.join(found._fields)}), which compiled code cannot tell apart: rename one"
        )
    return found


def part_class(package: str, name: str) -> type[Part]:
    """The subclass of Part that a part's or a formulation's module defines; its name is set."""
    module = load(package, name, folders=True)
    (found,) = (
        kind
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, Part) and kind.__module__ == module.__name__
    )
    found.name = name
    return found


def model(package: str, choice: str | dict[str, Any] | None, label: str = "name"):
    """The model that a value of the configuration names, or None where it is None.

    choice: a name, or a table of parameters with the name under `label`.
    """
    if choice is None:
        return None
    parameters = {label: choice} if isinstance(choice, str) else dict(choice)
    return model_class(package, parameters.pop(label))(**parameters)


def _places(package: str, folders: bool) -> dict[str, str]:
    """The package that holds each choice; the program's own go first."""
    found: dict[str, str] = {}
    for place in (package, package.replace("sph", EXTENSIONS, 1)):
        if place != package and not _exists(place):
            continue
        for module in pkgutil.iter_modules(importlib.import_module(place).__path__):
            if (folders or not module.ispkg) and not module.name.startswith("_"):
                found.setdefault(module.name, place)
    found.pop("base", None)
    return found


def _exists(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:  # of a package above it
        return False
