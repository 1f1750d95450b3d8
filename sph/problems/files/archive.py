"""Initial states in NumPy's .npz files, with the names of `sph.problems.base.InitialState`."""

import zipfile
import zlib

import numpy as np

from sph.problems.files.contents import (
    Contents,
    along_axes,
    as_rows,
    as_scalars,
    check,
    refusal,
    rounding,
)

NEEDED = ("position", "velocity", "mass", "internal_energy")
DAMAGE = (zipfile.BadZipFile, zlib.error, ValueError, EOFError, KeyError, NotImplementedError)


def read(file, path: str, dimension: int | None, digest: str) -> Contents:
    """Return the contents of an open .npz file. Raises FileError.

    Arrays: position and velocity (N, D), or (D, N) for more than three particles; mass and
    internal_energy (N,); `domain` (D, 2), the ends of a periodic box; further names are (N,) fields
    such as the density.
    """
    arrays = _arrays(file, path)
    missing = [name for name in NEEDED if name not in arrays]
    if missing:
        raise refusal(
            path,
            f"it has no array {' and no '.join(missing)}, but {', '.join(arrays) or 'none at all'}",
            "position, velocity, mass and internal_energy",
        )
    rows = as_rows(path, "position", _upright(arrays["position"]), None, 3)
    n, dim = len(rows), dimension or rows.shape[1]
    if n == 0:
        raise refusal(path, "position holds no particle", "at least one")
    velocity = as_rows(path, "velocity", _upright(arrays["velocity"]), n, 3)
    found = Contents(
        path,
        digest,
        along_axes(path, "position", rows, dim),
        along_axes(path, "velocity", velocity, dim),
        as_scalars(path, "mass", arrays["mass"], n),
        as_scalars(path, "internal_energy", arrays["internal_energy"], n),
        names={name: name for name in arrays},
        rounding=rounding(arrays["position"]),
    )
    if "domain" in arrays:
        found.box, found.boundary = _box(path, arrays["domain"], dim), "periodic"
    found.others = {
        name: as_scalars(path, name, array, n)
        for name, array in arrays.items()
        if name not in (*NEEDED, "domain")
    }
    return check(found)


def _arrays(file, path: str) -> dict[str, np.ndarray]:
    try:
        with np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except DAMAGE as error:
        raise refusal(
            path,
            f"it cannot be read as an .npz file ({error})",
            "arrays of numbers that numpy.savez wrote",
        ) from error


def _upright(array: np.ndarray) -> np.ndarray:
    """Return vectors as rows: (N, D) of (D, N), where N is too large for a dimension."""
    if array.ndim == 2 and array.shape[0] <= 3 < array.shape[1]:
        return array.T
    return array


def _box(path: str, array: np.ndarray, dimension: int) -> np.ndarray:
    box = np.tile(array, (dimension, 1)) if array.shape == (2,) else array
    if (
        box.shape != (dimension, 2)
        or box.dtype.kind not in "fiu"
        or not (box[:, 0] < box[:, 1]).all()
    ):
        raise refusal(
            path,
            f"domain is {array.tolist()}",
            f"[lo, hi] for all axes, or {dimension} rows [lo, hi], with lo < hi",
        )
    return box.astype(np.float64)
