"""Export of checkpoints: particles and profiles as CSV, particles as VTKHDF."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from sph.analysis.export import selection, tables, vtk
from sph.errors import ConfigError
from sph.output import checkpoint as checkpoints
from sph.output.files import explained, refuse_link

FORMATS = ("csv", "vtk")


def write(
    source: Path,
    formats: Sequence[str],
    times: Sequence[float] = (),
    every: bool = False,
    directory: Path | None = None,
) -> Iterator[Path]:
    """Write the particles of a run or checkpoint in each of `formats`; yield the files.

    Of a run, the last checkpoint, or those nearest to `times`, or `every` one. CSV has one file for
    each checkpoint, besides times.csv and columns.csv, which has units and meanings; VTKHDF one
    file with all of them as time steps. Files go to `directory`, by
    default export/ in the run directory, or beside a checkpoint that is in no run; they replace
    earlier ones. Raises ConfigError for contradictory choices, FileError for what is missing,
    damaged or cannot be written.
    """
    if not formats:
        raise ConfigError("no format is given.\nTry: --csv, --vtk or both.")
    chosen, default = selection.choose(Path(source), times, every)
    target = default if directory is None else Path(directory)
    if directory is None and target.name == selection.EXPORT:
        refuse_link(target)  # in a directory that may belong to another user
    with explained(f"cannot write to {target}"):
        target.mkdir(parents=True, exist_ok=True)
    if "csv" in formats:
        yield from _write_tables(chosen, target)
    if "vtk" in formats:
        suffix = _suffix(chosen[0]) if len(chosen) == 1 else ""
        yield vtk.write(
            (checkpoints.read(path) for path in chosen), target / f"particles{suffix}.vtkhdf"
        )


def _write_tables(chosen: Sequence[Path], target: Path) -> Iterator[Path]:
    times = {}
    for path in chosen:
        state = checkpoints.read(path)
        times[_suffix(path)[1:]] = state.time
        yield from tables.write(state, target, _suffix(path))
    yield tables.write_times(times, target)
    yield tables.write_columns(state, target)


def _suffix(path: Path) -> str:
    """_000005 of checkpoint_000005.h5, and _NAME of other files."""
    return f"_{path.stem.removeprefix('checkpoint_')}"
