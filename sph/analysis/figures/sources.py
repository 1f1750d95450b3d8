"""What is drawn: runs and checkpoints, and their state as the pictures ask for it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from sph.analysis import errors, truth
from sph.analysis.figures import style
from sph.config import Config
from sph.domain import Domain
from sph.errors import FileError
from sph.output import checkpoint, frames, same_run
from sph.output.run_directory import AGAIN, RunDirectory, find
from sph.problems.support import centred, uniaxial
from sph.quantity import FIELDS


@dataclass(frozen=True)
class Source:
    """A run directory with its checkpoints, or one checkpoint (`run`: where it lies, if in one)."""

    path: Path
    run: RunDirectory | None
    checkpoints: tuple[Path, ...]

    @property
    def is_run(self) -> bool:
        return self.path.is_dir()

    @property
    def label(self) -> str:
        """The run's name, with the checkpoint's where it is one."""
        if self.run is None:
            return self.path.stem
        name = self.run.path.resolve().name
        return name if self.is_run else f"{name}/{self.path.stem}"

    def last(self) -> "State":
        """The last state. Raises FileError."""
        return State(checkpoint.read(self.checkpoints[-1]))

    def over_time(self, most: int) -> "States":
        """The first, the last and others between them, at most `most`, as even as that allows."""
        return States([self.checkpoints[i] for i in evenly(len(self.checkpoints), most)])

    def for_movie(self) -> "States":
        """The frames of the run, if it has at least two, otherwise its checkpoints.

        Raises FileError if there are fewer than two of these.
        """
        paths = self.run.frames.paths() if self.run and self.is_run else []
        if len(paths) >= 2:
            return States(paths, self.last().checkpoint.config)
        if not self.is_run or len(self.checkpoints) < 2:
            raise FileError(
                f"{self.path}: a movie needs a run directory with two frames or checkpoints.\n"
                "Try: a run with output.frames = 100."
            )
        return States(self.checkpoints)


@dataclass(frozen=True)
class States:
    """States of one run, read one by one: a large run's do not fit into memory together.

    paths: of checkpoints, or of frames if there is a `config`, that of the run. Iteration raises
    FileError, also for a checkpoint of another problem than the first.
    """

    paths: Sequence[Path]
    config: Config | None = None

    def ends(self) -> "States":
        """The first and the last state."""
        return States([self.paths[0], self.paths[-1]], self.config)

    def __iter__(self) -> Iterator["State"]:
        first = None
        for path in self.paths:
            if self.config is not None:
                yield State(frames.read(path, self.config))
                continue
            state = State(checkpoint.read(path))
            first = first or state.problem
            same_run.check_problem(path, state.problem, first)
            yield state


def evenly(count: int, most: int) -> list[int]:
    """At most `most` of 0 … count - 1 with the first and the last, equally spaced if possible.

    Otherwise equally spaced from the last backwards; only the first interval is shorter.
    """
    if count <= most:
        return list(range(count))
    last = count - 1
    for intervals in range(most - 1, 2, -1):
        if last % intervals == 0:
            return list(range(0, count, last // intervals))
    stride = -(-last // (most - 1))
    return sorted({0, *range(last, -1, -stride)})


def find_source(path: Path) -> Source:
    """The run or checkpoint at `path`. Raises FileError where there is nothing to draw."""
    path = Path(path)
    if path.is_dir():
        run = RunDirectory.open(path)
        found = tuple(run.checkpoints())
        if not found:
            raise FileError(f"{path} has no checkpoints, so there is nothing to draw.{AGAIN}")
        return Source(path, run, found)
    home, path = find(path)
    return Source(path, home, (path,))


def labels(sources: Sequence[Source]) -> list[str]:
    """A name for each; whole paths where the short names do not tell them apart.

    Of points of a sweep, TABLE.KEY=VALUE,…, only what not all of them have, without the tables.
    """
    short = [source.label for source in sources]
    if len(set(short)) < len(short):
        return [str(source.path) for source in sources]
    parts = [name.split(",") for name in short]
    if len(parts) == 1 or not all("=" in part for name in parts for part in name):
        return short
    shared = set.intersection(*map(set, parts))
    told = [
        ", ".join(_without_table(part) for part in name if part not in shared) for name in parts
    ]
    return told if all(told) else short


def _without_table(setting: str) -> str:
    """eta=1.6 of physics.eta=1.6."""
    key, _, value = setting.partition("=")
    return f"{key.rpartition('.')[2]}={value}"


def von_mises(S: np.ndarray) -> np.ndarray:
    """(N,) the equivalent stress (3/2 S : S)^1/2 of deviatoric stresses (D, D, N).

    S has no trace, and in 1-D and 2-D the normal stresses of the other directions are equal.
    """
    D, trace = len(S), np.einsum("iin->n", S)
    squares = (S * S).sum(axis=(0, 1))
    if D < 3:
        squares = squares + trace**2 / (3 - D)
    return np.sqrt(1.5 * squares)


@dataclass(frozen=True)
class State:
    """A checkpoint or a frame as the pictures ask for it."""

    checkpoint: checkpoint.Checkpoint | frames.Frame

    @property
    def particles(self):
        return self.checkpoint.particles

    @property
    def problem(self):
        return self.checkpoint.config.problem

    @property
    def time(self) -> float:
        return self.checkpoint.time

    @property
    def dimension(self) -> int:
        return self.particles.dimension

    @property
    def kernel(self):
        return self.checkpoint.config.physics.kernel_model()

    @cached_property
    def eos(self):
        return self.checkpoint.config.physics.eos_model()

    @cached_property
    def domain(self) -> Domain:
        return Domain(self.problem.box, self.problem.boundaries)

    @property
    def title(self) -> str:
        """What it is, whenever."""
        number = f"{self.particles.number:,}".replace(",", r"\,")
        return f"{self.name}, {self.dimension}-D, $N = {number}$"

    @property
    def name(self) -> str:
        return self.problem.title or self.problem.name.replace("_", " ")

    @property
    def when(self) -> str:
        return f"$t$ = {style.shortest(self.time)} {self.units.symbol(0, 0, 1)}".rstrip()

    @property
    def units(self):
        """The table [units]."""
        return self.checkpoint.config.units

    def labelled(self, label: str, field: str) -> str:
        """The label of a field, or of a coordinate x or r, with its unit if the run has one."""
        return style.labelled(label, FIELDS[field].unit, self.units)

    @property
    def is_solid(self) -> bool:
        return self.particles.get("deviatoric_stress") is not None

    @property
    def has_surface(self) -> bool:
        """Whether matter ends at the particles' outer layer: gas would expand, others do not."""
        return self.checkpoint.config.physics.formulation == "continuum"

    def scalar(self, name: str) -> np.ndarray:
        """Return a quantity (N,): density, pressure, internal_energy, plastic_strain, speed |v|,
        v_r and v_phi about the problem's centre, von_mises, or stress, -sigma_xx of a solid.
        """
        if name in ("v_r", "v_phi"):
            return centred.components(self.problem, self.offset, self.particles.velocity)[name]
        if name == "speed":
            return np.linalg.norm(self.particles.velocity, axis=0)
        if name == "von_mises":
            return von_mises(self.particles.deviatoric_stress)
        if name == "pressure":
            return self.checkpoint.pressure
        if name == "stress":
            return uniaxial.compressive_stress(self.particles, self.checkpoint.pressure)
        return getattr(self.particles, name)

    def exact(self, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """The exact solution at (D, M) positions, or None."""
        return self.problem.exact(self.eos, self.time, position)

    @cached_property
    def may_have_exact(self) -> bool:
        """Whether the problem has an exact solution at this time, though it may not hold here."""
        return self.exact(self.particles.position[:, :1]) is not None

    @cached_property
    def left_out(self) -> str | None:
        """Why the exact solution is not to be drawn, None where it is."""
        return truth.left_out(self.checkpoint.config, self.time, self.particles.position)

    def errors(self) -> dict[str, float]:
        """L1 by field where the exact solution holds; empty where it does not."""
        found = errors.against_exact(
            self.checkpoint.config, self.time, self.particles, self.checkpoint.pressure
        )
        return {name: norm["L1"] for name, norm in found["fields"].items()} if found else {}

    @cached_property
    def offset(self) -> np.ndarray:
        """(D, N) offset of particles from the centre of the solution, which moves with `drift`."""
        return centred.offset(self.problem, self.time, self.particles.position)

    @cached_property
    def radius(self) -> np.ndarray:
        """(N,) distance of particles from the centre of the solution."""
        return centred.radius(self.offset)

    @property
    def is_radial(self) -> bool:
        """Whether profiles are drawn against the distance from the problem's centre."""
        return self.problem.radial and self.dimension > 1
