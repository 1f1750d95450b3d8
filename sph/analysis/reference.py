"""Errors against a finer run of the same problem, where no exact solution exists."""

import os
from bisect import bisect_left
from pathlib import Path

import numpy as np

from sph.analysis import interpolate
from sph.analysis.errors import FIELDS, by_field
from sph.config import Config
from sph.domain import Domain
from sph.errors import ConfigError
from sph.output import checkpoint
from sph.output.checkpoint import Checkpoint
from sph.output.files import is_same_path
from sph.output.run_directory import RunDirectory
from sph.summary import Errors

# Times closer than this, relative to the later one, are one: runs land on their outputs.
SAME_TIME = 1e-9


class Reference:
    """A run directory whose checkpoints errors are taken against. Raises FileError."""

    def __init__(self, path: Path):
        self.run = RunDirectory.open(path)
        self._times: dict[Path, float] = {}
        self._read: tuple[Path, Checkpoint] | None = None

    def at(self, time: float) -> Checkpoint:
        """The checkpoint at that time. Raises ConfigError where there is none, FileError."""
        paths = self.run.checkpoints()  # their times rise
        i = bisect_left(paths, time - SAME_TIME * abs(time), key=self._time)
        if i == len(paths) or not self._time(paths[i]) <= time + SAME_TIME * abs(time):
            raise ConfigError(
                f"the reference {self.run.path} has no checkpoint at t = {time:.6g}.\n"
                "Try: a reference with the same time.end, or an output.interval that meets it."
            )
        return self._state(paths[i])

    def _time(self, path: Path) -> float:
        if path not in self._times:
            self._times[path] = self._state(path).time
        return self._times[path]

    def _state(self, path: Path) -> Checkpoint:
        if self._read is None or self._read[0] != path:  # one at a time: they may be large
            self._read = path, checkpoint.read(path)
        return self._read[1]


def check(config: Config, target: Path | None) -> None:
    """Check that a run into `target` will find its reference, if it names one, when it ends.

    target: None where the run writes nothing. Raises FileError where there is no such run or its
    checkpoint is damaged, ConfigError where it has none at time.end, is of another problem or is
    `target` itself.
    """
    if not config.report.reference:
        return
    path = Path(config.report.reference)
    if target is not None and is_same_path(path, target):
        raise ConfigError(
            f"report.reference = {path}: this is the directory that the run itself is to go to.\n"
            "Try: another directory for the run, with -o (output=)."
        )
    fine = Reference(path).at(config.time.end)
    _check(config, fine.config, path, "this run")


def errors_of(path: Path, reference: Reference) -> Errors:
    """`errors_against` of the last state in a run directory. Raises FileError and ConfigError."""
    return errors_against(checkpoint.read(RunDirectory.open(path).latest()), reference, str(path))


def errors_against(coarse: Checkpoint, reference: Reference, name: str) -> Errors:
    """Norms of a state against the reference, taken at the particles of the state.

    The reference's fields are interpolated to these particles by its own kernels, which smooth them
    over its particle spacing: the reference must be finer by more than the accuracy wanted. `name`:
    the state's run, for error messages. Raises FileError, and ConfigError where the two do not fit.
    """
    fine = reference.at(coarse.time)
    _check(coarse.config, fine.config, reference.run.path, name)
    config, particles = coarse.config, coarse.particles
    inside, words = config.problem.error_region(
        config.physics.eos_model(), coarse.time, particles.position
    )
    exact = at_points(fine, particles.position)
    inside = inside & np.isfinite(exact["density"])
    fields = by_field(_fields(coarse), exact, particles.mass / particles.density, inside)
    return {
        "region": words,
        "particles": int(inside.sum()),
        "reference": os.path.abspath(reference.run.path),
        "fields": fields,
    }


def at_points(state: Checkpoint, points: np.ndarray) -> dict[str, np.ndarray]:
    """Fields of `state` at (D, M) points, see `interpolate`; velocity (D, M), the others (M,)."""
    config, fields = state.config, _fields(state)
    names = [name for name in FIELDS if name != "velocity"]
    domain = Domain(config.problem.box, config.problem.boundaries)
    scalars, velocity = interpolate.at_points(
        np.stack([fields[name] for name in names]), fields["velocity"], state.particles, domain,
        config.physics.kernel_model(), points,
    )  # fmt: skip
    return dict(zip(names, scalars, strict=True)) | {"velocity": velocity}


def _fields(state: Checkpoint) -> dict[str, np.ndarray]:
    particles = state.particles
    return {
        "density": particles.density,
        "velocity": particles.velocity,
        "pressure": state.pressure,
        "internal_energy": particles.internal_energy,
    }


def _check(coarse: Config, fine: Config, reference: Path, name: str) -> None:
    ours, theirs = coarse.problem, fine.problem
    for key in ("name", "dimension"):
        if getattr(ours, key) != getattr(theirs, key):
            raise ConfigError(
                f"the reference {reference} has problem.{key} = {getattr(theirs, key)}, but "
                f"{name} has {getattr(ours, key)}.\nTry: a reference of the same problem."
            )
