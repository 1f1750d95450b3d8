"""Run a simulation to its end: checkpoints, history, progress, and the summary it closes with."""

import os
import signal
from contextlib import contextmanager
from pathlib import Path

from sph.analysis import summary
from sph.clock import Clock
from sph.config import Config
from sph.errors import FileError, NumericalError, Stopped
from sph.neighbours.search import Origin
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import Checkpoint
from sph.output.files import copy_file
from sph.output.history import History
from sph.output.history import read as read_history
from sph.output.run_directory import RunDirectory, checkpoint_number, find
from sph.scene import Scene
from sph.simulation import Simulation

# A time closer than this, relative to the interval, to an output is that output.
SAME_TIME = 1e-9


def run(config: Config, directory: RunDirectory, progress) -> dict:
    """Run `config` from its initial state in an empty run directory; returns the summary.

    `progress` has start(time, end), step(simulation), wrote(path) and close(). Raises NumericalError
    or Stopped, with what was reached kept in the directory.
    """
    clock = Clock()
    directory.write_config(config.to_toml())
    simulation = Simulation.start(Scene(config), threads_of(config), clock)
    extra = config.problem.diagnostics(simulation.particles)
    history = History.create(directory.history, config.problem.dimension, list(extra))
    return _Runner(config, directory, simulation, history, progress, number=0).from_start()


def restart(
    config: Config, checkpoint: Checkpoint, number: int, directory: RunDirectory, progress
) -> dict:
    """Go on from `checkpoint`, which is number `number` of `directory`; later ones are replaced.

    `config` is the checkpoint's with what the user changed. Returns the summary.
    """
    clock = Clock()
    directory.write_config(config.to_toml())
    directory.drop_checkpoints_after(number)
    origin = Origin(checkpoint.list_position, checkpoint.list_support, checkpoint.list_skin)
    simulation = Simulation.resume(
        Scene(config), checkpoint.particles, checkpoint.time, checkpoint.step,
        checkpoint.next_step, origin, threads_of(config), clock,
    )  # fmt: skip
    if directory.history.exists():
        history = History.resume(directory.history, checkpoint.step)
    else:  # a lone checkpoint: the history begins with it
        extra = config.problem.diagnostics(simulation.particles)
        history = History.create(directory.history, config.problem.dimension, list(extra))
    lineage = (*checkpoint.lineage, f"restarted at step {checkpoint.step}, t = {checkpoint.time!r}")
    runner = _Runner(config, directory, simulation, history, progress, number + 1, lineage)
    return runner.from_checkpoint()


def prepare_restart(source: Path, directory: Path | None):
    """The checkpoint to go on from, its number, and the run directory to go on in.

    source: a run directory or a checkpoint; directory: a new run directory, or None for the one
    that the checkpoint is in. Raises FileError.
    """
    home, path = find(source)
    checkpoint = checkpoints.read(path)
    if directory is None and home is None:
        raise FileError(f"{path} is not in a run directory.\nTry: -o DIR, to go on in a new one.")
    if directory is None or (home is not None and directory.resolve() == home.path.resolve()):
        return checkpoint, checkpoint_number(path), home
    target = RunDirectory.create(directory)
    number = checkpoint_number(path) or 0
    if home is None:
        number = 0
        copy_file(path, target.checkpoint_path(0))
    else:
        for earlier in home.checkpoints():
            if checkpoint_number(earlier) <= number:
                copy_file(earlier, target.checkpoint_path(checkpoint_number(earlier)))
        copy_file(home.history, target.history)
    return checkpoint, number, target


def threads_of(config: Config) -> int:
    """The number of threads a configuration asks for; "all" is every processor we may use."""
    if config.run.threads == "all":
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return config.run.threads


def output_times(end: float, interval: float) -> list[float]:
    """Times of the checkpoints after the first: every interval, and the end."""
    times = []
    while (len(times) + 1) * interval < end - SAME_TIME * interval:
        times.append((len(times) + 1) * interval)
    return [*times, end]


class _Runner:
    """The loop over steps and outputs of one session."""

    def __init__(self, config, directory, simulation, history, progress, number, lineage=()):
        self.config = config
        self.directory = directory
        self.simulation = simulation
        self.history = history
        self.progress = progress
        self.number = number  # of the next checkpoint
        self.lineage = lineage
        self.wall_before = self.cpu_before = 0.0  # of earlier sessions

    def from_start(self) -> dict:
        with self._closing():
            self._record()
            self._write_checkpoint()
            return self._to_end()

    def from_checkpoint(self) -> dict:
        with self._closing():
            past = read_history(self.directory.history)
            if past["step"].size:
                self.wall_before = past["wall_seconds"][-1]
                self.cpu_before = past["cpu_seconds"][-1]
            return self._to_end()

    @contextmanager
    def _closing(self):
        try:
            yield
        finally:
            self.history.close()
            self.progress.close()
            self.simulation.close()
            self.simulation.clock.close()

    def _to_end(self) -> dict:
        simulation, end = self.simulation, self.config.time.end
        self.progress.start(simulation.time, end)
        try:
            with _stop_signals() as stopped_by:
                for output in output_times(end, self.config.output.interval):
                    while simulation.time < output:
                        if stopped_by:
                            self._stop(stopped_by[0])
                        simulation.advance(output)
                        self._record()
                        self.progress.step(simulation)
                    if simulation.time == output:
                        self._write_checkpoint()
        except NumericalError as error:
            self._close("failed", reason=str(error))
            last = self.directory.checkpoint_path(self.number - 1)
            raise NumericalError(
                f"{error}\nThe last good checkpoint is {last}: "
                f"`sph restart {last} --set …` goes on from there with other settings."
            ) from error
        return self._close("done")

    def _stop(self, name: str) -> None:
        path = self._write_checkpoint()
        self._close("stopped", reason=name)
        raise Stopped(
            f"stopped by {name} at t = {self.simulation.time:.6g}, step {self.simulation.step}; "
            f"wrote {path}.\n`sph restart {self.directory.path}` goes on from there."
        )

    def _record(self) -> None:
        """One row of the history: the state now, and the step that the criteria allow from it."""
        simulation, totals, limit = self.simulation, self.simulation.totals, self.simulation.limit
        row = {
            "step": simulation.step,
            "t": simulation.time,
            "dt": limit.dt,
            "limiter_particle": limit.particle,
            "limiter": limit.criterion,
            "kinetic_energy": totals.kinetic_energy,
            "internal_energy": totals.internal_energy,
            "total_energy": totals.energy,
            "min_density": totals.min_density,
            "max_density": totals.max_density,
            "min_internal_energy": totals.min_internal_energy,
            "max_internal_energy": totals.max_internal_energy,
            "wall_seconds": round(self.wall_before + simulation.clock.wall, 6),
            "cpu_seconds": round(self.cpu_before + simulation.clock.cpu, 6),
        }
        row |= {f"momentum_{axis}": p for axis, p in zip("xyz", totals.momentum.tolist(), strict=False)}
        with simulation.clock.phase("diagnostics"):
            row |= self.config.problem.diagnostics(simulation.particles)
        self.history.append(row)

    def _write_checkpoint(self) -> Path:
        """Write the state, after the history up to it."""
        simulation, origin = self.simulation, self.simulation.search.origin
        path = self.directory.checkpoint_path(self.number)
        with simulation.clock.phase("output"):
            self.history.flush()
            checkpoints.write(
                path,
                Checkpoint(
                    particles=simulation.particles,
                    time=simulation.time,
                    step=simulation.step,
                    next_step=simulation.limit.dt,
                    list_position=origin.position,
                    list_support=origin.support,
                    list_skin=origin.skin,
                    config=self.config,
                    lineage=self.lineage,
                ),
            )
        self.number += 1
        self.progress.wrote(path, simulation)
        return path

    def _close(self, status: str, reason: str | None = None) -> dict:
        self.history.flush()
        result = summary.of_run(
            self.simulation,
            read_history(self.directory.history),
            status=status,
            reason=reason,
        )
        self.directory.write_summary(result)
        return result


@contextmanager
def _stop_signals():
    """A list that holds the name of the first SIGINT or SIGTERM once one has come.

    A second one acts as it would without us, for those who cannot wait for the end of a step.
    """
    came: list[str] = []
    numbers = (signal.SIGINT, signal.SIGTERM)

    def note(number, _frame):
        came.append("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
        for one in numbers:
            signal.signal(one, before[one])

    before = {number: signal.getsignal(number) for number in numbers}
    for number in numbers:
        signal.signal(number, note)
    try:
        yield came
    finally:
        for number in numbers:
            signal.signal(number, before[number])
