"""Files of users that are found like those of sph: the package `sph_extensions` on the Python path.

The package mirrors the folders of sph: sph_extensions/kernels/mine.py is a kernel. It has no
__init__.py, so that several places may hold a share of it.
"""

import importlib.util

PACKAGE = "sph_extensions"


def counterpart(package: str) -> str:
    """Return the package of users for a package of sph, e.g. "sph_extensions.kernels"."""
    return package.replace("sph", PACKAGE, 1)


def exists(package: str) -> bool:
    """Return whether a package can be imported."""
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:  # of a package above it
        return False


def folders() -> list[str]:
    """Return the folders that make up the package, in the order of the Python path."""
    spec = importlib.util.find_spec(PACKAGE)
    return list(spec.submodule_search_locations or []) if spec else []
