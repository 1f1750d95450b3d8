"""A run directory as an object, with checkpoints that are read when needed."""

import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, overload

import numpy as np

from sph import config as configuration
from sph.analysis import truth
from sph.api.concise import concise
from sph.api.particles import Particles
from sph.config import Config
from sph.output import checkpoint as checkpoints
from sph.output import history
from sph.output.files import read_text
from sph.output.run_directory import RunDirectory
from sph.summary import Summary


class Checkpoint(Particles):
    """A checkpoint: its particles, as `Particles`, with time, step and configuration.

    The file is read when the first field is asked for. Reading raises FileError.
    """

    def __init__(self, path: Path, scratch: object = None):
        """scratch: what keeps a temporary directory; kept as long as this object."""
        self.path, self._scratch = path, scratch
        super().__init__(lambda: self._read.particles, lambda: self._read.pressure)

    @cached_property
    @concise
    def _read(self) -> checkpoints.Checkpoint:
        return checkpoints.read(self.path)

    @property
    def time(self) -> float:
        """Time of the checkpoint, in code units."""
        return self._read.time

    @property
    def step(self) -> int:
        """Number of time steps until then."""
        return self._read.step

    @property
    def config(self) -> Config:
        """The configuration, one attribute for each table: `checkpoint.config.physics.gamma`."""
        return self._read.config

    @property
    def lineage(self) -> tuple[str, ...]:
        """A sentence for each restart before this checkpoint."""
        return self._read.lineage

    @property
    def state_hash(self) -> str:
        """SHA-256 of the state: equal for runs that are equal bit for bit."""
        return checkpoints.hash_of(self._read)

    @concise
    def exact(self, position: np.ndarray | None = None) -> dict[str, np.ndarray] | None:
        """Return the exact solution at this time, None if there is none for this configuration.

        position: (D, M) points; the particles, in the order of IDs, if not given. The dictionary
        has density (M,), velocity (D, M), pressure and internal_energy (M,).
        """
        if truth.departure(self.config, self.time):
            return None
        points = self.position if position is None else np.asarray(position, dtype=float)
        problem, eos = self.config.problem, self.config.physics.eos_model()
        return problem.exact(eos, self.time, points)

    def __repr__(self) -> str:
        return f"<checkpoint {self.path.name}>"


class Checkpoints(Sequence[Checkpoint]):
    """The checkpoints of a run in the order of time. A file is read when a field is asked for.

    The sequence keeps the checkpoint that was used last, no others: a loop over all needs the
    memory of one.
    """

    def __init__(self, paths: Sequence[Path], scratch: object = None):
        """scratch: see `Checkpoint`."""
        self._paths, self._scratch = tuple(paths), scratch
        self._last: Checkpoint | None = None

    def __len__(self) -> int:
        return len(self._paths)

    @overload
    def __getitem__(self, index: int) -> Checkpoint: ...
    @overload
    def __getitem__(self, index: slice) -> "Checkpoints": ...
    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return Checkpoints(self._paths[index], self._scratch)
        path = self._paths[index]
        if self._last is None or self._last.path != path:
            self._last = Checkpoint(path, self._scratch)
        return self._last

    def __iter__(self) -> Iterator[Checkpoint]:
        return (self[k] for k in range(len(self)))

    def __repr__(self) -> str:
        return f"<{len(self)} checkpoints>"


class Run:
    """A run: its directory, configuration, summary, history and checkpoints."""

    def __init__(self, directory: RunDirectory, scratch: object = None):
        """scratch: see `Checkpoint`."""
        self._directory, self._scratch = directory, scratch

    @property
    def directory(self) -> Path:
        """The run directory."""
        return self._directory.path

    @property
    def status(self) -> str:
        """ "done", "stopped" or "failed"; "unfinished" if the run is going on or was killed."""
        return str(self._directory.read_summary().get("status", "unfinished"))

    @cached_property
    @concise
    def config(self) -> Config:
        """The configuration with all defaults, one attribute for each table. Raises FileError."""
        path = self._directory.config
        return configuration.from_text(read_text(path), str(path))

    @cached_property
    @concise
    def summary(self) -> Summary:
        """The content of summary.json, a dictionary. Raises FileError if the run has not ended."""
        return self._directory.whole_summary()

    @cached_property
    @concise
    def history(self) -> dict[str, np.ndarray]:
        """The columns of history.csv by name, (steps,) each, with a row for each time step.

        float64, but for `limiter`, which has names. Raises FileError.
        """
        return history.read(self._directory.history)

    @cached_property
    def checkpoints(self) -> Checkpoints:
        """The checkpoints, read when a field is asked for: `run.checkpoints[-1].density`."""
        return Checkpoints(self._directory.checkpoints(), self._scratch)

    def __repr__(self) -> str:
        return f"<run in {self.directory}, {self.status}>"


@concise
def open(directory: str | os.PathLike[str]) -> Run:
    """Return the run in a run directory that `sph run` or `sph.run` wrote.

    Nothing is read but the names of its checkpoints. The state is that of this moment: open a run
    that is going on again to see more. Raises FileError if there is no run directory.

    >>> run = sph.open(done.directory)
    >>> run.status
    'done'
    >>> run.checkpoints[-1].density.shape
    (99,)
    """
    return Run(RunDirectory.open(Path(directory)))
