"""Checks that the files in a run directory belong to one run."""

import itertools
from pathlib import Path

import numpy as np

from sph import config as configuration
from sph.config.outside import SOURCES, has_changed
from sph.errors import ConfigError, FileError
from sph.output import history
from sph.output.checkpoint import Checkpoint
from sph.output.files import read_text

REMEDY = f"Try: move the files of the other run out of the directory; or {history.ALONE}"


def check_configuration(path: Path, checkpoint: Checkpoint) -> None:
    """Raise FileError if config.toml can be read and has another problem."""
    try:
        there = configuration.from_text(read_text(path), str(path))
    except (ConfigError, FileError, OSError):
        return  # missing or of another version: the checkpoint holds the configuration as well
    check_problem(path, there.problem, checkpoint.config.problem)


def check_problem(path: Path, problem, of_the_run) -> None:
    """Raise FileError if the problem in `path` differs from that of the run."""
    there, here = problem.model_dump(), of_the_run.model_dump()
    keys = [key for key in there | here if key not in SOURCES]
    if other := [key for key in keys if there.get(key) != here.get(key)]:
        raise _other(path, f"problem.{', problem.'.join(other)} differ from its other files")


def check_history(path: Path, checkpoint: Checkpoint) -> None:
    """Raise FileError if the history does not lead to the state in the checkpoint."""
    p, config = checkpoint.particles, checkpoint.config
    with np.errstate(all="ignore"):
        sums = {
            "t": checkpoint.time,
            "kinetic_energy": float(0.5 * np.sum(p.mass * p.velocity**2)),
            "internal_energy": float(p.mass @ p.internal_energy),
        }
        diagnostics = list(config.problem.diagnostics(p))
    optional = checkpoint.scene.columns
    if has_changed(config.problem):
        before = history.diagnostics_in(path, p.dimension, optional)
        _check_diagnostics(path, config.problem.origin, before, diagnostics)
    history.check(path, p.dimension, diagnostics, optional, checkpoint.step, sums)


def _check_diagnostics(path: Path, origin: str, before: list[str], now: list[str]) -> None:
    """Raise FileError if the columns of a changed problem file are not those of the history."""
    if set(before) != set(now):
        raise FileError(
            f"{origin} has changed since the run began: its diagnostics return "
            f"{', '.join(now) or 'nothing'}, but {path} has the columns of the run, "
            f"{', '.join(before) or 'none'} of diagnostics. A history keeps its columns.\n"
            f"Try: the same names in diagnostics as when the run began; or {history.ALONE}"
        )


def check_order(earlier: Path, later: Path, before: Checkpoint, after: Checkpoint) -> None:
    """Raise FileError if two checkpoints with consecutive numbers are not of one run."""
    check_problem(later, after.config.problem, before.config.problem)
    if not np.array_equal(np.sort(before.particles.id), np.sort(after.particles.id)):
        raise _other(later, f"its particle IDs differ from those of {earlier.name}")
    if after.step <= before.step or after.time <= before.time:
        raise _other(
            later,
            f"step {after.step}, t = {after.time!r} is not after step {before.step}, "
            f"t = {before.time!r} of {earlier.name}",
        )
    if after.lineage[: len(before.lineage)] != before.lineage:
        raise _other(later, f"its lineage does not continue that of {earlier.name}")
    if after.lineage == before.lineage and after.config.recorded != before.config.recorded:
        raise _other(
            later, f"its configuration differs from that of {earlier.name}: {_key(before, after)}"
        )


def _key(before: Checkpoint, after: Checkpoint) -> str:
    """Return the first key that differs, with both values."""
    tables = [one.config.recorded.splitlines() for one in (before, after)]
    pairs = itertools.zip_longest(*tables, fillvalue="nothing")
    return next(f"{there} and {here}" for there, here in pairs if there != here)


def _other(path: Path, why: str) -> FileError:
    return FileError(f"{path} belongs to another run: {why}.\n{REMEDY}")
