"""Find kernels, equations of state, schemes and problems by looking into their folder."""

import importlib
import pkgutil
from types import ModuleType


def names(package: str) -> list[str]:
    """Names of the modules in `package`, e.g. names("sph.kernels"): one file is one choice.

    Files whose name begins with an underscore or is "base" are shared parts, not choices.
    """
    path = importlib.import_module(package).__path__
    found = (module.name for module in pkgutil.iter_modules(path) if not module.ispkg)
    return sorted(name for name in found if not name.startswith("_") and name != "base")


def load(package: str, name: str) -> ModuleType:
    """The module of that choice. Raises KeyError naming the valid ones."""
    if name not in names(package):
        raise KeyError(f"no {name!r} in {package}; there are {', '.join(names(package))}")
    return importlib.import_module(f"{package}.{name}")


def model_class(package: str, name: str) -> type:
    """The NamedTuple that a model's file defines: the one class with fields and formulas in it.

    Its name must be its own in the whole program: Numba tells named tuples apart by the name of the
    class and the types of the fields, so two alike would silently share their formulas.
    """
    module = load(package, name)
    (model,) = (
        kind
        for kind in vars(module).values()
        if isinstance(kind, type)
        and hasattr(kind, "_fields")
        and kind.__module__ == module.__name__
    )
    return model
