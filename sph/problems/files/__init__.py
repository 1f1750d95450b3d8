"""Initial states from files: HDF5 in the layout of GADGET and SWIFT, and NumPy's .npz.

A file is opened once: its SHA-256 and its arrays come from the same open file.
"""

import hashlib
import os
import stat
from pathlib import Path

from sph.errors import FileError
from sph.problems.files.contents import Contents, refusal
from sph.problems.files.units import Conversion, convert

# A configuration without a path uses this file, which `scripts/two_clouds.py` writes.
SAMPLE = Path(__file__).parent / "two_clouds.hdf5"

ZIP = b"PK"  # an .npz file is a ZIP archive

_last: list[Contents] = []  # of `read`, until `take`


def read(path: str, dimension: int | None, units: Conversion) -> Contents:
    """Return the contents of a file in the units of the run, and keep them for `take`.

    dimension: number of space dimensions; that of the file if None. Raises FileError if the file
    cannot be read, is of another kind, or does not hold a valid initial state of gas.
    """
    _last.clear()
    found = convert(_read(path, dimension), units)
    _last.append(found)
    return found


def kept(path: str, sha256: str, dimension: int, units: Conversion) -> Contents | None:
    """Return the contents of the last `read` if that was of this file in these units, or None."""
    for last in _last:
        is_same = (last.path, last.sha256, len(last.position)) == (path, sha256, dimension)
        if is_same and last.conversion == units.of(last):
            return last
    return None


def take(path: str, sha256: str, dimension: int, units: Conversion) -> Contents:
    """Return the contents of the last `read` if that was of this file, otherwise read it.

    Nothing is kept, so that the memory is free once the caller has used the arrays.
    """
    found = kept(path, sha256, dimension, units)
    _last.clear()
    return found or convert(_read(path, dimension), units)


def _read(path: str, dimension: int | None) -> Contents:
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise refusal(path, "is not a regular file", "an HDF5 or .npz file")
        with open(path, "rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            file.seek(0)
            start = file.read(len(ZIP))
            file.seek(0)
            if not start:
                raise refusal(path, "is empty", "an HDF5 or .npz file")
            return _reader(start)(file, path, dimension, digest)
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(
            f"{path}: cannot be read ({reason}).\nTry: another problem.path; a relative path in a "
            "configuration file begins at the directory of that file."
        ) from None


def _reader(start: bytes):
    """Return the function that reads files which begin like this."""
    if start == ZIP:
        from sph.problems.files import archive

        return archive.read
    from sph.problems.files import gadget  # imports h5py, which takes 0.1 s

    return gadget.read
