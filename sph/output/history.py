"""The history of a run: a CSV file with one row for every step."""

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sph.errors import FileError
from sph.output.files import explained, write_text

TEXT_COLUMNS = {"limiter"}


def columns(dimension: int) -> list[str]:
    """The columns of every run: code units, `limiter_particle` an ID, momentum by axis."""
    return [
        "step",
        "t",
        "dt",
        "limiter_particle",
        "limiter",
        "kinetic_energy",
        "kinetic_energy_without_bulk",
        "internal_energy",
        "total_energy",
        "energy_drift",
        "energy_injected",
        *(f"momentum_{axis}" for axis in "xyz"[:dimension]),
        "min_density",
        "max_density",
        "min_internal_energy",
        "max_internal_energy",
        "wall_seconds",
        "cpu_seconds",
    ]


class History:
    """Writes history.csv: rows are kept in memory until `flush`, which writes whole lines.

    Floats are written so that they read back to the same bits.
    """

    def __init__(self, path: Path, names: Sequence[str]):
        self.path = path
        self.columns = tuple(names)
        self._lines = io.StringIO()
        self._writer = csv.writer(self._lines, lineterminator="\n")
        with explained(f"cannot write {path}"):
            self._descriptor = os.open(path, os.O_WRONLY | os.O_APPEND)

    @classmethod
    def create(cls, path: Path, dimension: int, extra: Sequence[str] = ()) -> "History":
        """A new history with the columns of `columns(dimension)` and `extra`. Raises FileError."""
        names = [*columns(dimension), *extra]
        write_text(Path(path), _as_text([names]))
        return cls(Path(path), names)

    @classmethod
    def resume(cls, path: Path, step: int) -> "History":
        """Go on after `step`: later rows are dropped. Raises FileError."""
        names, rows = _names_and_rows(Path(path))
        kept = [row for row in rows if int(row[0]) <= step]
        write_text(Path(path), _as_text([names, *kept]))
        return cls(Path(path), names)

    def append(self, row: Mapping[str, object]) -> None:
        """Add one step: a value for every column. Raises KeyError where one is missing."""
        self._writer.writerow([row[name] for name in self.columns])

    def flush(self) -> None:
        """Write what was added, for readers and before a checkpoint. Raises FileError."""
        unwritten = self._lines.getvalue().encode()
        self._lines.seek(0)
        self._lines.truncate()
        with explained(f"cannot write {self.path}"):
            # one call as a rule, so that a reader sees whole lines
            while unwritten:
                unwritten = unwritten[os.write(self._descriptor, unwritten) :]

    def close(self) -> None:
        """Flush and close. Raises FileError."""
        self.flush()
        os.close(self._descriptor)


def read(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history, each (steps,): float64, or object where they hold text.

    A last line that is not yet complete is left out. Raises FileError.
    """
    names, rows = _names_and_rows(Path(path))
    by_column = zip(*rows, strict=True) if rows else [()] * len(names)
    return {
        name: np.array(values, dtype=object if name in TEXT_COLUMNS else np.float64)
        for name, values in zip(names, by_column, strict=True)
    }


def _names_and_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    """The header and the complete rows of `path`."""
    try:
        text = path.read_bytes().decode()
    except FileNotFoundError:
        raise FileError(f"there is no history {path}.\nTry: the directory of a run.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"cannot read {path}: {error}.") from error
    complete = text[: text.rfind("\n") + 1]
    names, *rows = list(csv.reader(io.StringIO(complete))) or [[]]
    if names[:2] != ["step", "t"]:
        raise FileError(f"{path} is not a history: its first line must begin with step,t.")
    for number, row in enumerate(rows, start=2):
        if not _is_row(names, row):
            raise FileError(
                f"{path}, line {number}: {len(names)} values were expected, and numbers in all "
                f"columns but {', '.join(sorted(TEXT_COLUMNS))}.\nTry: remove that line."
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


def _as_text(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
