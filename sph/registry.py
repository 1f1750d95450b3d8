"""Discovery of kernels, equations of state, schemes, parts and problems by folder.

Users may add choices in a package `sph_extensions` on the Python path (`sph.extensions`): a file
sph_extensions/kernels/mine.py works like sph/kernels/mine.py.
"""

import functools
import importlib
import pkgutil
from types import ModuleType
from typing import Any

from sph import declarations, extensions
from sph.errors import DeclarationError
from sph.part import Part

_known: dict[tuple, str] = {}  # module of each model class, by the names that identify it to Numba


def names(package: str, folders: bool = False) -> list[str]:
    """Return the names of the choices in `package`, e.g. names("sph.kernels"), sorted.

    folders: whether subpackages are choices too, as in "sph.parts". A file whose name begins with
    an underscore, or is base.py, holds shared code and is not a choice.
    """
    return sorted(_places(package, folders))


def load(package: str, name: str, folders: bool = False) -> ModuleType:
    """Return the module of that choice.

    Raises KeyError that names the valid choices, and DeclarationError for an extension that cannot
    be imported.
    """
    places = _places(package, folders)
    if name not in places:
        raise KeyError(f"no {name!r} in {package}; expected one of {', '.join(sorted(places))}")
    return extensions.load(f"{places[name]}.{name}")


@functools.cache
def model_class(package: str, name: str) -> type:
    """Return the NamedTuple that a model's file defines.

    Raises DeclarationError if the class is declared wrongly, or if another model has the same class
    name and field names: Numba identifies a NamedTuple by these names alone, so both models would
    use the formulas of one of them.
    """
    module = load(package, name)
    found: Any = declarations.only_class(
        module,
        (
            kind
            for kind in vars(module).values()
            if isinstance(kind, type)
            and hasattr(kind, "_fields")
            and kind.__module__ == module.__name__
        ),
        "a NamedTuple",
    )
    if not hasattr(found, "_is_model"):
        raise DeclarationError(
            f"{module.__name__}: decorate {found.__name__} with @model(Base) of sph.model, where "
            f"Base is the class in {package} with the defaults of its models"
        )
    declarations.check_model(found, importlib.import_module(package))
    other = _known.setdefault((found.__name__, found._fields), module.__name__)
    if other != module.__name__:
        raise DeclarationError(
            f"{module.__name__} and {other} both define a model {found.__name__}"
            f"({', '.join(found._fields)}), which compiled code cannot distinguish. Try: rename one"
        )
    return found


@functools.cache
def part_class(package: str, name: str) -> type[Part]:
    """Return the subclass of Part that the module of a part or formulation defines.

    Raises DeclarationError if the class is declared wrongly.
    """
    module = load(package, name, folders=True)
    base = importlib.import_module(package).BASE
    found = declarations.only_class(
        module,
        (
            kind
            for kind in vars(module).values()
            if isinstance(kind, type)
            and issubclass(kind, base)
            and kind.__module__ == module.__name__
        ),
        f"a subclass of {base.__name__}",
    )
    declarations.check_part_class(found, optional=base is Part)
    return found


def model(package: str, choice: str | dict[str, Any] | None, label: str = "name"):
    """Return the model that a value of the configuration names, or None if `choice` is None.

    choice: a name, or a table of parameters with the name under the key `label`. A list becomes a
    tuple, which can be hashed and compiled.
    """
    if choice is None:
        return None
    table = {label: choice} if isinstance(choice, str) else choice
    parameters = {key: tuple(one) if isinstance(one, list) else one for key, one in table.items()}
    return model_class(package, parameters.pop(label))(**parameters)


def _places(package: str, folders: bool) -> dict[str, str]:
    """Return the package of each choice.

    Raises DeclarationError if a choice of users has the name of one of sph.
    """
    found: dict[str, str] = {}
    for place in (package, extensions.counterpart(package)):
        if not extensions.exists(place):
            continue
        for module in pkgutil.iter_modules(importlib.import_module(place).__path__):
            if (folders or not module.ispkg) and not module.name.startswith("_"):
                if module.name in found:
                    raise DeclarationError(
                        f"{place}.{module.name}: {package} has a choice of this name; expected "
                        "another name"
                    )
                found[module.name] = place
    found.pop("base", None)
    return found
