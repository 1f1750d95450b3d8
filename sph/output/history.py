"""The history of a run: a CSV file with one row for each step."""

import csv
import functools
import io
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sph import columns
from sph.errors import FileError
from sph.output.files import check_in_place, explained, open_to_append, read_text, write_text

TEXT_COLUMNS = {"limiter"}

# Columns whose last values a restart continues.
COUNTED = (
    "t", "kinetic_energy", "kinetic_energy_without_bulk", "internal_energy", "energy_drift",
    "energy_injected", "wall_seconds", "cpu_seconds",
)  # fmt: skip
ALONE = (
    "copy the checkpoint out of the run directory: `sph restart COPY -o DIR` continues it with a "
    "new history."
)
# Relative tolerance of sums over particles: another order of summation changes them by round-off,
# another state by far more.
SAME_SUM = 1e-6


class History:
    """Writes history.csv. Rows are kept in memory until `flush`, which writes whole lines.

    Floats are written with all digits, so that they read back to the same bits.
    """

    def __init__(self, path: Path, names: Sequence[str]):
        self.path = path
        self.columns = tuple(names)
        self._lines = io.StringIO()
        self._texts = [k for k, name in enumerate(self.columns) if name in TEXT_COLUMNS]
        self._descriptor = open_to_append(path)

    @classmethod
    def create(cls, path: Path, dimension: int, extra: Sequence[str] = ()) -> "History":
        """Create a history with the columns of every run and `extra`. Raises FileError."""
        names = [*columns.shared(dimension), *extra]
        write_text(Path(path), _as_text([names]))
        return cls(Path(path), names)

    @classmethod
    def resume(cls, path: Path, step: int) -> "History":
        """Open a history to continue after `step`; remove later rows. Raises FileError."""
        names, rows = _names_and_rows(Path(path))
        kept = [row for row in rows if int(row[0]) <= step]
        write_text(Path(path), _as_text([names, *kept]))
        return cls(Path(path), names)

    def extend(self, columns: Mapping[str, Sequence[object]]) -> None:
        """Add rows of steps, by column. Raises KeyError if a column is missing."""
        texts = [map(str, columns[name]) for name in self.columns]
        for column in self._texts:
            texts[column] = map(_quoted, texts[column])
        # csv.writer looks at every digit for a comma, which takes half as long again
        self._lines.writelines(",".join(row) + "\n" for row in zip(*texts, strict=True))

    def flush(self) -> None:
        """Write and sync the rows added so far. Needed before a checkpoint of the same step.

        Raises FileError, also if the file was moved or replaced.
        """
        unwritten = self._lines.getvalue().encode()
        if not unwritten:
            return
        check_in_place(self.path, self._descriptor)
        self._lines.seek(0)
        self._lines.truncate()
        with explained(f"cannot write {self.path}"):
            # usually one call, so that a reader sees whole lines
            while unwritten:
                unwritten = unwritten[os.write(self._descriptor, unwritten) :]
            os.fsync(self._descriptor)

    def close(self) -> None:
        """Flush and close. Raises FileError."""
        try:
            self.flush()
        finally:
            os.close(self._descriptor)


def read(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a history, each (steps,): float64, or object for columns of text.

    An incomplete last line is ignored. Raises FileError, also if a column of every run is missing.
    """
    names, rows = _names_and_rows(Path(path))
    _check_columns(Path(path), names, columns.shared(1))
    by_column = zip(*rows, strict=True) if rows else [()] * len(names)
    return {
        name: np.array(values, dtype=object if name in TEXT_COLUMNS else np.float64)
        for name, values in zip(names, by_column, strict=True)
    }


def check(
    path: Path, dimension: int, diagnostics: Sequence[str], optional: Sequence[str], step: int,
    sums: Mapping[str, float],
) -> None:  # fmt: skip
    """Raise FileError if a restart cannot continue this history after `step`.

    Steps must be consecutive from the first row to `step`, values finite, and the row of `step`
    must agree with `sums`. diagnostics: columns of the
    problem, which must be there; optional: columns of the scene, which older files may lack.
    """
    path = Path(path)
    names, rows = _names_and_rows(path)
    ours = columns.shared(dimension)
    _check_columns(path, names, [*ours, *diagnostics])
    foreign = [one for one in names if one not in (*ours, *diagnostics, *optional)]
    if foreign:
        raise _of_another_run(path, f"it has columns {', '.join(foreign)}")
    kept = [row for row in rows if int(row[0]) <= step]
    first = int(kept[0][0]) if kept else step
    for expected, row in enumerate(kept, start=first):
        if int(row[0]) != expected:
            raise _of_another_run(path, f"step {expected} is missing before step {row[0]}")
        values = dict(zip(names, row, strict=True))
        for name in (*COUNTED, *optional):
            if not math.isfinite(float(values.get(name, 0.0))):
                raise _of_another_run(path, f"{name} = {values[name]} at step {expected}")
    if first + len(kept) - 1 != step:
        raise _of_another_run(path, f"step {step}, that of the checkpoint, is missing")
    for name, value in sums.items():
        if not math.isclose(float(values[name]), value, rel_tol=SAME_SUM):
            raise _of_another_run(
                path, f"{name} = {values[name]} at step {step}, but {value!r} in the checkpoint"
            )


def diagnostics_in(path: Path, dimension: int, optional: Sequence[str]) -> list[str]:
    """Return the columns of a history that are neither those of every run nor `optional`.

    Raises FileError if a column of every run is missing.
    """
    names, _ = _names_and_rows(Path(path))
    ours = columns.shared(dimension)
    _check_columns(Path(path), names, ours)
    return [one for one in names if one not in (*ours, *optional)]


def _of_another_run(path: Path, why: str) -> FileError:
    return FileError(
        f"{path} is damaged or belongs to another run: {why}.\nTry: an earlier checkpoint; or "
        f"{ALONE}"
    )


def _check_columns(path: Path, names: Sequence[str], needed: Sequence[str]) -> None:
    missing = [name for name in needed if name not in names]
    if missing:
        raise FileError(
            f"{path} has no columns {', '.join(missing)}: its first line is damaged, or another "
            f"version of sph wrote it.\nTry: the version of sph that wrote it; or {ALONE}"
        )


def _names_and_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    """Return the header and the complete rows of `path`."""
    try:
        text = read_text(path)
    except FileNotFoundError:
        raise FileError(f"{path}: history not found.\nTry: a run directory.") from None
    complete = text[: text.rfind("\n") + 1]
    names, *rows = list(csv.reader(io.StringIO(complete))) or [[]]
    if names[:2] != ["step", "t"] or len(set(names)) < len(names):
        raise FileError(
            f"{path} is not a history: expected a first line that begins with step,t and names "
            "each column once.\nTry: a run directory."
        )
    for number, row in enumerate(rows, start=2):
        if not _is_row(names, row):
            raise FileError(
                f"{path}, line {number}: expected {len(names)} values, with numbers in all columns "
                f"except {', '.join(sorted(TEXT_COLUMNS))}.\nTry: remove that line."
            )
    return names, rows


def _is_row(names: Sequence[str], row: Sequence[str]) -> bool:
    if len(row) != len(names):
        return False
    try:
        int(row[0])
        for name, value in zip(names, row, strict=True):
            if name not in TEXT_COLUMNS:
                float(value)
    except ValueError:
        return False
    return True


@functools.lru_cache(64)  # the names of a few criteria
def _quoted(text: str) -> str:
    return _as_text([[text]])[:-1]


def _as_text(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
