"""Errors against a finer run of the same problem, for want of an exact solution."""

import os
from bisect import bisect_left
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from sph.analysis.errors import FIELDS, by_field
from sph.config import Config
from sph.domain import Domain
from sph.errors import ConfigError
from sph.output import checkpoint
from sph.output.checkpoint import Checkpoint
from sph.output.files import is_same_path
from sph.output.run_directory import RunDirectory

# Times closer than this, relative to the later one, are one: runs land on their outputs.
SAME_TIME = 1e-9
# Particles of the reference handled at once: some million pairs in 3-D.
CHUNK = 10_000


class Reference:
    """A run directory whose checkpoints stand for the truth. Raises FileError."""

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
    """See that a run into `target` will find at its end the reference it names, if it names one.

    target: None where nothing is to be written. Raises FileError where there is no such run or its
    checkpoint is damaged, ConfigError where it has none at time.end, is of another problem or is
    `target` itself.
    """
    if not config.report.reference:
        return
    path = Path(config.report.reference)
    if target is not None and is_same_path(path, target):
        raise ConfigError(
            f"report.reference = {path}: this is the directory that the run itself is to go to.\n"
            "Try: another directory for the run, with -o."
        )
    fine = Reference(path).at(config.time.end)
    _check(config, fine.config, path, "this run")


def errors_of(path: Path, reference: Reference) -> dict:
    """`errors_against` of the last state in a run directory. Raises as it, and FileError."""
    return errors_against(checkpoint.read(RunDirectory.open(path).latest()), reference, str(path))


def errors_against(coarse: Checkpoint, reference: Reference, name: str) -> dict:
    """Norms of a state against the reference at its particles, as those of `against_exact`.

    The reference's fields are carried there by its own kernels, which smooth them over its own
    spacing: it must be finer by more than the accuracy wanted. `name`: of the state's run, for
    errors. Raises FileError, and ConfigError where the two do not fit.
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
    """Fields of `state` at (D, M) points, velocity (D, M): NaN where no kernel reaches.

    A(x) = sum_j V_j A_j W(x - x_j, H_j) / sum_j V_j W(x - x_j, H_j), V = m/rho, over particles and
    their images (Shepard 1968); velocities of images in a wall are reflected.
    """
    particles, problem = state.particles, state.config.problem
    kernel = state.config.physics.kernel_model()
    dim, H = (0,) * particles.dimension, particles.support
    # The normalisation C of the kernel cancels.
    weight = particles.mass / (particles.density * H**particles.dimension)
    fields = _fields(state)
    scalars = np.stack([fields[name] for name in FIELDS if name != "velocity"])
    tree = cKDTree(points.T)
    low, high = points.min(axis=1), points.max(axis=1)
    sums = np.zeros((len(scalars) + particles.dimension + 1, points.shape[1]))
    domain = Domain(problem.box, problem.boundaries)
    for sign, offset in zip(*domain.images_within(H.max()), strict=True):
        image = sign[:, None] * particles.position + offset[:, None]
        values = np.vstack([scalars, sign[:, None] * fields["velocity"], np.ones_like(H)])
        reaches = (image + H > low[:, None]) & (image - H < high[:, None])
        near = np.flatnonzero(reaches.all(axis=0))
        for j in np.array_split(near, len(near) // CHUNK + 1):
            found = tree.query_ball_point(image[:, j].T, H[j])
            i = np.concatenate([*map(np.asarray, found), np.zeros(0)]).astype(int)
            j = np.repeat(j, [len(one) for one in found])
            q = np.linalg.norm(points[:, i] - image[:, j], axis=0) / H[j]
            share = weight[j] * kernel.w(dim, q)
            for total, value in zip(sums, values, strict=True):
                total += np.bincount(i, share * value[j], total.size)
    with np.errstate(invalid="ignore"):
        means = sums[:-1] / np.where(sums[-1] > 0.0, sums[-1], np.nan)
    names = [name for name in FIELDS if name != "velocity"]
    return dict(zip(names, means, strict=False)) | {"velocity": means[len(names) :]}


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
