"""Errors against a finer run of the same problem, for want of an exact solution."""

from pathlib import Path

import h5py
import numpy as np
from scipy.spatial import cKDTree

from sph.analysis.errors import FIELDS, norms
from sph.domain import Domain
from sph.errors import ConfigError, FileError
from sph.output import checkpoint
from sph.output.checkpoint import Checkpoint
from sph.output.run_directory import RunDirectory

# Times closer than this, relative to the later one, are one: runs land on their outputs.
SAME_TIME = 1e-9
# Particles of the reference handled at once: some million pairs in 3-D.
CHUNK = 10_000


class Reference:
    """A run directory whose checkpoints stand for the truth. Raises FileError."""

    def __init__(self, path: Path):
        self.run = RunDirectory.open(path)
        self._times = {_time(one): one for one in self.run.checkpoints()}
        self._read: tuple[float, Checkpoint] | None = None

    def at(self, time: float) -> Checkpoint:
        """The checkpoint at that time. Raises ConfigError where there is none."""
        nearest = min(self._times, key=lambda other: abs(other - time), default=np.inf)
        if not abs(nearest - time) <= SAME_TIME * max(abs(nearest), abs(time)):
            raise ConfigError(
                f"the reference {self.run.path} has no checkpoint at t = {time:.6g}.\n"
                "Try: a reference with the same time.end, or an output.interval that meets it."
            )
        if self._read is None or self._read[0] != nearest:  # one at a time: they may be large
            self._read = nearest, checkpoint.read(self._times[nearest])
        return self._read[1]


def errors_against(reference: Reference, path: Path) -> dict:
    """Norms of a run's last state against the reference at its particles, as `against_exact`.

    The reference's fields are carried there by its own kernels, which smooth them over its own
    spacing: it must be finer by more than the accuracy wanted. Raises FileError, and ConfigError
    where the two do not fit.
    """
    coarse = checkpoint.read(RunDirectory.open(path).latest())
    fine = reference.at(coarse.time)
    _check(coarse, fine, reference.run.path, path)
    config, particles = coarse.config, coarse.particles
    inside, words = config.problem.error_region(
        config.physics.eos_model(), coarse.time, particles.position
    )
    exact = at_points(fine, particles.position)
    inside = inside & np.isfinite(exact["density"])
    volume = (particles.mass / particles.density)[inside]
    state = _fields(coarse)
    fields = {name: norms((state[name] - exact[name])[..., inside], volume) for name in FIELDS}
    return {
        "region": words,
        "particles": int(inside.sum()),
        "reference": str(reference.run.path),
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
    for sign, offset in zip(*Domain(problem.box, problem.boundaries).images, strict=True):
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


def _check(coarse: Checkpoint, fine: Checkpoint, reference: Path, path: Path) -> None:
    ours, theirs = coarse.config.problem, fine.config.problem
    for key in ("name", "dimension"):
        if getattr(ours, key) != getattr(theirs, key):
            raise ConfigError(
                f"the reference {reference} has problem.{key} = {getattr(theirs, key)}, but "
                f"{path} has {getattr(ours, key)}."
            )


def _time(path: Path) -> float:
    try:
        with h5py.File(path, "r") as file:
            return float(file[checkpoint.GROUP]["time"][()])
    except (OSError, KeyError):
        raise FileError(f"{path} is not a checkpoint, or damaged.") from None
