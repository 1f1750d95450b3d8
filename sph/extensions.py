"""Models, parts and problems of users: the package `sph_extensions` on the Python path.

The package has the same folders as sph: sph_extensions/kernels/mine.py is a kernel. It has no
__init__.py (it is a namespace package), so several directories of the Python path may each contain
a folder `sph_extensions`.
"""

import importlib.util

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


def folders() -> list[str]:
    """Return the folders that make up the package, in the order of the Python path."""
    spec = importlib.util.find_spec(PACKAGE)
    return list(spec.submodule_search_locations or []) if spec else []
