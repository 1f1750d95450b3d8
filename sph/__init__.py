"""Smoothed particle hydrodynamics from the command line."""

import hashlib
import os
from pathlib import Path

from sph.version import __version__

__all__ = ["__version__"]


def _source_hash() -> str:
    """Hash of every source file of the package.

    Numba's on-disk cache of a function does not see an edit to a function it calls in another
    file, so compiled code is kept in a directory that no two versions of the sources share. Nor
    does it see that bounds are to be checked: code with and without must not meet.
    """
    root = Path(__file__).parent
    digest = hashlib.sha256(os.environ.get("NUMBA_BOUNDSCHECK", "").encode())
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _set_cache_directory() -> None:
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    import numba.core.config
    import platformdirs

    base = Path(platformdirs.user_cache_dir("sph")) / "numba"
    numba.core.config.CACHE_DIR = str(base / f"{__version__}-{_source_hash()}")


_set_cache_directory()
