"""What a file with an initial state holds, and the checks that do not depend on its format."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from sph.errors import FileError
from sph.problems.base import Units

if TYPE_CHECKING:
    from sph.problems.files.units import Conversion

NUMBERS = "fiu"  # kinds of NumPy types: floating-point, signed and unsigned


@dataclass(eq=False)
class Contents:
    """An initial state, and the box and the units that the file states."""

    path: str
    sha256: str
    position: np.ndarray  # (D, N)
    velocity: np.ndarray  # (D, N)
    mass: np.ndarray  # (N,)
    internal_energy: np.ndarray  # (N,) per unit mass
    box: np.ndarray | None = None  # (D, 2) ends; None if the file states none
    boundary: str | list[str] = "open"
    others: Mapping[str, np.ndarray] = field(default_factory=dict)  # (N,) each
    names: Mapping[str, str] = field(default_factory=dict)  # of the datasets, for messages
    rounding: float = 0.0  # relative rounding error of the positions in the file
    units: Units | None = None  # that the file states
    unit_fault: str = ""  # why units that the file states cannot be used
    conversion: "Conversion | None" = None  # that `sph.problems.files.units.convert` has made


def refusal(path: str, found: str, expected: str, remedy: str = "") -> FileError:
    """Return the error for a file: what was found, what was expected, and what to try."""
    advice = f"\nTry: {remedy}." if remedy else ""
    return FileError(f"{path}: {found}; expected {expected}.{advice}")


def as_rows(path: str, name: str, array: np.ndarray, n: int | None, most: int) -> np.ndarray:
    """Return a dataset of vectors as (N, columns) float64, with up to `most` columns.

    n: the number of particles; None if this dataset decides it. A (N,) array has one column.
    """
    check_kind(path, name, array)
    rows = array[:, None] if array.ndim == 1 else array
    expected = "one row for each particle" if n is None else f"{n} rows, one for each particle"
    if rows.ndim != 2 or rows.shape[1] > most or (n is not None and len(rows) != n):
        raise refusal(
            path,
            f"{name} has the shape {array.shape}",
            f"{expected}, and up to {most} columns",
            "the transposed array" if array.ndim == 2 and array.shape[0] <= most else "",
        )
    return rows.astype(np.float64, copy=False)


def as_scalars(path: str, name: str, array: np.ndarray, n: int) -> np.ndarray:
    """Return a dataset of one number for each of n particles as (N,) float64."""
    check_kind(path, name, array)
    flat = array[:, 0] if array.ndim == 2 and array.shape[1] == 1 else array
    if flat.shape != (n,):
        raise refusal(path, f"{name} has the shape {array.shape}", f"({n},), one for each particle")
    return flat.astype(np.float64, copy=False)


def check_kind(path: str, name: str, array: np.ndarray) -> None:
    """Raise FileError unless the array holds real numbers."""
    if array.dtype.kind not in NUMBERS:
        raise refusal(path, f"{name} is of type {array.dtype}", "real numbers")


def rounding(array: np.ndarray) -> float:
    """Return the relative rounding error of numbers of that type."""
    return float(np.finfo(array.dtype).eps) if array.dtype.kind == "f" else 0.0


def along_axes(path: str, name: str, rows: np.ndarray, dimension: int) -> np.ndarray:
    """Return (D, N) of (N, columns) vectors; further columns must not vary over the particles.

    Raises FileError if there are fewer than D columns, or if a further column varies.
    """
    columns = rows.shape[1]
    if columns < dimension:
        raise refusal(path, f"{name} has {columns} column(s)", f"{dimension} in {dimension}-D")
    for column in range(dimension, columns):
        low, high = rows[:, column].min(), rows[:, column].max()
        if low != high:
            raise refusal(
                path,
                f"{name} ranges from {low:.6g} to {high:.6g} along {'xyz'[column]}",
                f"one value for all particles in {dimension}-D",
                f"problem.dimension = {column + 1}",
            )
    return np.ascontiguousarray(rows[:, :dimension].T)


def check(found: Contents) -> Contents:
    """Return the contents. Raises FileError that names the dataset and the first wrong particle."""
    names = found.names
    for key in ("position", "velocity", "mass", "internal_energy"):
        _check_finite(found.path, names[key], getattr(found, key))
    for key, array in found.others.items():
        _check_finite(found.path, names.get(key, key), array)
    _check_all(found.path, names["mass"], found.mass, found.mass > 0.0, "numbers above 0")
    energy = found.internal_energy
    _check_all(found.path, names["internal_energy"], energy, energy >= 0.0, "numbers of at least 0")
    if "density" in found.others:
        density = found.others["density"]
        _check_all(found.path, names["density"], density, density > 0.0, "numbers above 0")
    return found


def _check_finite(path: str, name: str, array: np.ndarray) -> None:
    _check_all(path, name, array, np.isfinite(array), "finite numbers")


def _check_all(path: str, name: str, array: np.ndarray, fine: np.ndarray, expected: str) -> None:
    """Raise FileError unless all entries of an array, (N,) or (D, N), are fine."""
    if fine.all():
        return
    rows = fine.reshape(-1, fine.shape[-1]).all(axis=0)
    first = int(np.argmin(rows))
    values = np.atleast_1d(array[..., first][~fine[..., first]])
    wrong = int((~rows).sum())
    count = f"; {wrong} rows in all are wrong" if wrong > 1 else ""
    raise refusal(path, f"{name} has {values[0]:.6g} in row {first} (from 0){count}", expected)


def check_inside(found: Contents, box: np.ndarray, boundaries: tuple[str, ...]) -> None:
    """Raise FileError if a particle is outside the box (D, 2) along an axis that is not open.

    Particles beyond an end by no more than the rounding error of the file move to that end, and
    those at the upper end of a periodic axis to the lower end, which is the same place.
    """
    for axis, ((low, high), kind) in enumerate(zip(box, boundaries, strict=True)):
        if kind == "open":
            continue
        x = found.position[axis]
        margin = 2.0 * found.rounding * max(abs(low), abs(high))
        outside = (x < low - margin) | (x > high + margin)
        if outside.any():
            first = int(np.argmax(outside))
            raise refusal(
                found.path,
                f"{found.names['position']} has {x[first]:.9g}{_in_file(found, x[first])} along "
                f"{'xyz'[axis]} for particle {first + 1}: {outside.sum()} particle(s) are outside "
                "the box",
                f"{low:.9g} to {high:.9g}{_in_run(found)}, because the boundary along "
                f"{'xyz'[axis]} is {kind}",
                'problem.domain = [lo, hi], or problem.boundary = "open"',
            )
        np.clip(x, low, high, out=x)
        if kind == "periodic":
            x[x == high] = low


def _in_run(found: Contents) -> str:
    """Return the run's unit of length in words, if the numbers of the file were converted to it."""
    length = _lengths(found)
    return f" in the unit of length of [units] ({length[1]:.6g} cm)" if length else ""


def _in_file(found: Contents, x: float) -> str:
    """Return the number that the file has in place of a converted position."""
    length = _lengths(found)
    return f" ({x * length[1] / length[0]:.9g} in the file)" if length else ""


def _lengths(found: Contents) -> tuple[float, float] | None:
    """Return the units of length of the file and of the run in cm; None without conversion."""
    of_file, of_run = found.conversion or (None, None)
    return (of_file[0], of_run[0]) if of_file and of_run and of_file != of_run else None


def extent(position: np.ndarray) -> np.ndarray:
    """Return (D, 2), the ends of the positions (D, N) along each axis, at least 1e-3 apart.

    The ends are apart by at least that share of the longest axis, so that a box exists.
    """
    low, high = position.min(axis=1), position.max(axis=1)
    least = 1e-3 * (float((high - low).max()) or 1.0)
    wider = 0.5 * np.maximum(0.0, least - (high - low))
    return np.stack([low - wider, high + wider], axis=1)
