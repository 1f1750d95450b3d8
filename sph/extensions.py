"""Models, parts and problems of users: the package `sph_extensions` on the Python path.

The package has the same folders as sph: sph_extensions/kernels/mine.py is a kernel. It has no
__init__.py (it is a namespace package), so several directories of the Python path may each contain
a folder `sph_extensions`.
"""

import importlib
import importlib.util
import traceback
from types import ModuleType

from sph.errors import DeclarationError

PACKAGE = "sph_extensions"


def counterpart(package: str) -> str:
    """Return the user's counterpart of a package, e.g. "sph_extensions.kernels"."""
    return package.replace("sph", PACKAGE, 1)


def exists(package: str) -> bool:
    """Return whether a package can be imported."""
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:  # a package above does not exist
        return False


def load(module: str) -> ModuleType:
    """Return a module of sph or of users.

    Raises DeclarationError, which names file and line, if that of a user cannot be imported.
    """
    try:
        return importlib.import_module(module)
    except DeclarationError:
        raise
    except Exception as error:
        if not module.startswith(f"{PACKAGE}."):
            raise
        if isinstance(error, SyntaxError):
            where = f"{error.filename}, line {error.lineno}"
        else:
            frames = traceback.extract_tb(error.__traceback__)
            inside = [one for one in frames if f"/{PACKAGE}/" in one.filename]
            where = f"{inside[-1].filename}, line {inside[-1].lineno}" if inside else module
        name = type(error).__name__
        raise DeclarationError(f"{where}: cannot be imported: {name}: {error}") from error


def folders() -> list[str]:
    """Return the folders that make up the package, in the order of the Python path."""
    spec = importlib.util.find_spec(PACKAGE)
    return list(spec.submodule_search_locations or []) if spec else []
