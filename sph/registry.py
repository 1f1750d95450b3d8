"""Discovery of kernels, equations of state, schemes, parts and problems by folder.

Users may add choices in a package `sph_extensions` on the Python path: a file
sph_extensions/kernels/mine.py is found like sph/kernels/mine.py. This package has no __init__.py,
so it may be spread over several directories.
"""

import functools
import importlib
import importlib.util
import pkgutil
from types import ModuleType
from typing import Any

from sph.part import Part

EXTENSIONS = "sph_extensions"

_known: dict[tuple, str] = {}  # modules of model classes, by what Numba tells them apart by


def names(package: str, folders: bool = False) -> list[str]:
    """Return the choices in `package`, e.g. names("sph.kernels"): the names of its modules.

    folders: whether subpackages are choices as well, e.g. parts. Files whose name begins with an
    underscore or is "base" are shared code, not choices.
    """
    return sorted(_places(package, folders))


def load(package: str, name: str, folders: bool = False) -> ModuleType:
    """Return the module of that choice. Raises KeyError that names the valid choices."""
    places = _places(package, folders)
    if name not in places:
        raise KeyError(f"no {name!r} in {package}; expected one of {', '.join(sorted(places))}")
    return importlib.import_module(f"{places[name]}.{name}")


@functools.cache
def model_class(package: str, name: str) -> type:
    """Return the NamedTuple that a model's file defines.

    Raises TypeError if another model has equal class and field names: Numba distinguishes named
    tuples only by these, so both models would share their formulas.
    """
    module = load(package, name)
    (found,) = (
        kind
        for kind in vars(module).values()
        if isinstance(kind, type)
        and hasattr(kind, "_fields")
        and kind.__module__ == module.__name__
    )
    other = _known.setdefault((found.__name__, found._fields), module.__name__)
    if other != module.__name__:
        raise TypeError(
            f"{module.__name__} and {other} both define a model {found.__name__}"
            f"({', '.join(found._fields)}), which compiled code cannot distinguish. Try: rename one"
        )
    return found


def part_class(package: str, name: str) -> type[Part]:
    """Return the subclass of Part that the module of a part or formulation defines."""
    module = load(package, name, folders=True)
    (found,) = (
        kind
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, Part) and kind.__module__ == module.__name__
    )
    found.name = name
    return found


def model(package: str, choice: str | dict[str, Any] | None, label: str = "name"):
    """Return the model that a value of the configuration names, or None if `choice` is None.

    choice: a name, or a table of parameters with the name under the key `label`.
    """
    if choice is None:
        return None
    parameters = {label: choice} if isinstance(choice, str) else dict(choice)
    return model_class(package, parameters.pop(label))(**parameters)


def _places(package: str, folders: bool) -> dict[str, str]:
    """Return the package of each choice; those of sph have precedence over extensions."""
    found: dict[str, str] = {}
    for place in (package, package.replace("sph", EXTENSIONS, 1)):
        if place != package and not _exists(place):
            continue
        for module in pkgutil.iter_modules(importlib.import_module(place).__path__):
            if (folders or not module.ispkg) and not module.name.startswith("_"):
                found.setdefault(module.name, place)
    found.pop("base", None)
    return found


def extension_folders() -> list[str]:
    """The folders that make up `sph_extensions`, in the order of the Python path."""
    spec = importlib.util.find_spec(EXTENSIONS)
    return list(spec.submodule_search_locations or []) if spec else []


def _exists(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:  # of a package above it
        return False
