"""CSV files: all particles, and the profile with the exact solution."""

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from sph import meanings
from sph.analysis import truth
from sph.analysis.export import fields
from sph.output.checkpoint import Checkpoint
from sph.output.files import replacing
from sph.problems.support import centred, uniaxial
from sph.quantity import FIELDS
from sph.state import Public

AXES = "xyz"
TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
PLACE = Public("", 1, 0, 0, 0, "Position")
BLOCK = 100_000  # rows that are made into text at once


def write(checkpoint: Checkpoint, directory: Path, suffix: str) -> Iterator[Path]:
    """Write particles`suffix`.csv and, for problems with profiles, profile`suffix`.csv."""
    yield _write(directory / f"particles{suffix}.csv", particles(checkpoint))
    if _has_profile(checkpoint):
        yield _write(directory / f"profile{suffix}.csv", profile(checkpoint))


def _has_profile(checkpoint: Checkpoint) -> bool:
    """Whether figures of the problem show profiles: in 1-D, or beside an exact solution."""
    problem, position = checkpoint.config.problem, checkpoint.particles.position
    eos = checkpoint.config.physics.eos_model()
    return len(position) == 1 or (
        problem.profiled and problem.exact(eos, checkpoint.time, position[:, :1]) is not None
    )


def particles(checkpoint: Checkpoint) -> dict[str, np.ndarray]:
    """Return columns (N,) in the order of the particles' IDs.

    id, x, y, z, vx, vy, vz (as many as there are dimensions), mass, density, internal_energy, h,
    further fields of the scene, and pressure. Components of vectors are NAME_x, of tensors NAME_xx.
    """
    return {name: values for name, values, _ in _columns(checkpoint)}


def _columns(checkpoint: Checkpoint) -> Iterator[tuple[str, np.ndarray, Public]]:
    """Yield name, values and declaration of each column of the particles."""
    found = {one.name: one for one in fields.of(checkpoint)}
    yield "id", found["id"].values, found.pop("id").public
    place = fields.position(checkpoint)
    for d in range(place.shape[1]):
        yield AXES[d], place[:, d], PLACE
    for one in found.values():
        if one.values.ndim == 1:
            yield one.name, one.values, one.public
        elif one.values.ndim == 2:
            stem = "v" if one.name == "velocity" else f"{one.name}_"
            for d in range(one.values.shape[1]):
                yield f"{stem}{AXES[d]}", one.values[:, d], one.public
        else:
            for i, j in TENSOR:
                if max(i, j) < one.values.shape[1]:
                    yield f"{one.name}_{AXES[i]}{AXES[j]}", one.values[:, i, j], one.public


def write_columns(checkpoint: Checkpoint, directory: Path) -> Path:
    """Write columns.csv: unit and meaning of each column of particles and profile."""
    config = checkpoint.config
    rows = {
        name: (fields.unit_of(config, public), public.description)
        for name, _, public in _columns(checkpoint)
    }
    for name in profile(checkpoint) if _has_profile(checkpoint) else ():
        known = FIELDS[name.removesuffix("_exact")]
        exact = ", exact solution" * name.endswith("_exact")
        row = (meanings.unit_of(config, known), f"{known.help}{exact}")
        rows.setdefault(name, row)
    units, texts = zip(*rows.values(), strict=True)
    columns = {"column": tuple(rows), "unit": units, "meaning": texts}
    return _write(directory / "columns.csv", {name: np.array(one) for name, one in columns.items()})


def write_times(times: Mapping[str, float], directory: Path) -> Path:
    """Write times.csv: the time of each exported checkpoint, by the number in the files' names."""
    return _write(
        directory / "times.csv",
        {"number": np.array(list(times)), "time": np.array(list(times.values()))},
    )


def profile(checkpoint: Checkpoint) -> dict[str, np.ndarray]:
    """Return columns (M,) of the particles where errors are taken, by ascending coordinate.

    The coordinate is x, or the distance r from the centre of problems that are round. Beside x,
    velocity is the component along x; beside r, v_r and in 2-D v_phi are those about the centre,
    which moves with the flow. NAME_exact is the exact solution at the particle, where it holds.
    """
    state, problem = checkpoint.particles, checkpoint.config.problem
    eos, time = checkpoint.config.physics.eos_model(), checkpoint.time
    inside, _ = truth.region(problem, eos, time, state.position)
    if not inside.any():
        inside = np.ones(state.number, dtype=bool)
    position = state.position[:, inside]
    along = _Axis(problem, time, position)
    found = {name: _scalar(checkpoint, name)[inside] for name in _scalars(problem)}
    found |= along.components(state.velocity[:, inside])
    columns = {along.name: along.coordinate, **found}
    if truth.left_out(checkpoint.config, time, state.position) is None:
        exact = problem.exact(eos, time, position) or {}
        if "velocity" in exact:
            exact = exact | along.components(exact["velocity"])
        columns |= {f"{name}_exact": exact[name] for name in found if name in exact}
    order = np.argsort(along.coordinate, kind="stable")
    return {name: values[order] for name, values in columns.items()}


class _Axis:
    """The coordinate of a profile, and the components of velocities along and across it."""

    def __init__(self, problem, time: float, position: np.ndarray):
        self._problem, self._offset = problem, centred.offset(problem, time, position)
        self._is_round = problem.radial and len(position) > 1
        self.name = "r" if self._is_round else "x"
        self.coordinate = centred.radius(self._offset) if self._is_round else position[0]

    def components(self, velocity: np.ndarray) -> dict[str, np.ndarray]:
        if not self._is_round:
            return {"velocity": velocity[0]}
        return centred.components(self._problem, self._offset, velocity)


def _scalars(problem) -> list[str]:
    """Fields of the problem's profiles besides the velocity, whose components all tables have."""
    return [name for name in problem.profiles if name not in ("velocity", "v_r", "v_phi")]


def _scalar(checkpoint: Checkpoint, name: str) -> np.ndarray:
    if name == "stress":
        return uniaxial.compressive_stress(checkpoint.particles, checkpoint.pressure)
    return checkpoint.field(name)


def _write(path: Path, columns: Mapping[str, np.ndarray]) -> Path:
    """Write floats with all digits, so that they read back to the same bits."""
    number = len(next(iter(columns.values())))
    with replacing(path) as unfinished:
        unfinished.write((",".join(columns) + "\n").encode())
        for first in range(0, number, BLOCK):
            text = io.StringIO()
            rows = zip(
                *(one[first : first + BLOCK].tolist() for one in columns.values()), strict=True
            )
            csv.writer(text, lineterminator="\n").writerows(rows)
            unfinished.write(text.getvalue().encode())
    return path
