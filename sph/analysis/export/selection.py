"""Which checkpoints are exported, and where to."""

from collections.abc import Sequence
from pathlib import Path

from sph.errors import ConfigError, FileError
from sph.output import checkpoint as checkpoints
from sph.output.run_directory import AGAIN, RunDirectory, find

EXPORT = "export"


def choose(source: Path, times: Sequence[float], every: bool) -> tuple[list[Path], Path]:
    """Return the checkpoints, in order of time, and the default directory of the export.

    Raises ConfigError for contradictory choices, FileError where there is no checkpoint.
    """
    if times and every:
        raise ConfigError("--time and --all exclude each other.\nTry: one of these.")
    if not source.is_dir():
        if times or every:
            raise ConfigError(
                f"{source} is one checkpoint: --time and --all choose among those of a run.\n"
                "Try: the run directory."
            )
        run, path = find(source)
        return [path], source.parent if run is None else run.path / EXPORT
    run = RunDirectory.open(source)
    known = run.checkpoints()
    if not known:
        raise FileError(f"{source} has no checkpoints, so there is nothing to export.{AGAIN}")
    if every:
        return known, run.path / EXPORT
    if not times:
        return [run.latest()], run.path / EXPORT
    nearest = {_nearest(known, time) for time in times}
    return [path for path in known if path in nearest], run.path / EXPORT


def _nearest(paths: Sequence[Path], time: float) -> Path:
    """The checkpoint nearest to `time`, the earlier of two; times ascend."""
    low, high = 0, len(paths) - 1
    while low < high:  # the first checkpoint at or after `time`
        middle = (low + high) // 2
        if _time(paths[middle]) < time:
            low = middle + 1
        else:
            high = middle
    if low > 0 and time - _time(paths[low - 1]) <= abs(_time(paths[low]) - time):
        return paths[low - 1]
    return paths[low]


def _time(path: Path) -> float:
    return checkpoints.read(path).time
