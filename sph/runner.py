"""The loop of a run over steps and outputs: checkpoints, history, progress and summary."""

from collections.abc import Iterator, Set
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import numpy as np

from sph import allocation, columns, faults
from sph.analysis import reference, summary, trial
from sph.clock import PLACING, Clock
from sph.config import Config
from sph.errors import DeclarationError, FileError, NumericalError, Stopped, first_line
from sph.neighbours.search import Origin
from sph.output import checkpoint as checkpoints
from sph.output import offenders
from sph.output.checkpoint import Checkpoint
from sph.output.history import History
from sph.output.history import read as read_history
from sph.output.recorder import Recorder
from sph.output.run_directory import RunDirectory
from sph.output.times import output_times
from sph.scene import Scene
from sph.shell_words import quoted
from sph.simulation import Simulation
from sph.steps import MOST
from sph.stop_signals import stop_signals
from sph.threads import available_processors


def run(config: Config, directory: RunDirectory, progress) -> dict:
    """Run `config` from its initial state. Return the summary.

    directory: its files of an earlier run are removed once there is an initial state. progress: see
    `sph.progress.Messages` and `Lines`. Raises NumericalError and Stopped, after the files of the
    run are written; FileError, ConfigError and others, before the first checkpoint without leaving
    a run directory.
    """
    with (
        session(directory, config, progress) as (stopped_by, clock),
        directory.withdrawn_unless_begun(),
    ):
        progress.note("preparing the initial state")
        for remark in config.problem.remarks():
            progress.note(remark)
        with closing(Simulation.of_problem(Scene(config), threads_of(config), clock)) as simulation:
            directory.make_room()
            directory.write_config(config.to_toml())
            if source := getattr(config.problem, "source", b""):
                directory.write_problem(source)
            if ended := simulation.relaxation:
                spent = round(clock.seconds[PLACING], 4)
                directory.write_relaxation({**ended._asdict(), "cpu_seconds": spent})
            _begin(simulation, directory, progress)
            history = new_history(config, simulation, directory)
            runner = Runner(config, directory, simulation, history, progress, stopped_by)
            return runner.from_start()


def _begin(simulation: Simulation, directory: RunDirectory, progress) -> None:
    """Prepare the first step, and try a user's problem. Raises NumericalError and others."""
    try:
        simulation.begin()
    except NumericalError as error:
        raise _failed_at_start(error, simulation, directory) from error
    if simulation.held_supports:
        progress.note(
            f"{simulation.held_supports} particle(s) have too few neighbours: their support "
            f"radius is limited to {simulation.scene.max_support:.4g} (physics.max_support)"
        )
    if note := faults.mostly_empty(simulation.scene, simulation.particles):
        progress.note(note)
    for note in trial.notes(simulation):
        progress.note(note)


@contextmanager
def session(directory: RunDirectory, config: Config, progress) -> Iterator[tuple[list[str], Clock]]:
    """Yield the list of stop signals and a clock, with the directory locked and signals handled."""
    if (threads := threads_of(config)) > (processors := available_processors()):
        progress.note(
            f"run.threads = {threads}, but this process may use only {processors} processor(s): "
            "more threads do not make the run faster, and do not change its results"
        )
    allocation.return_large_arrays()
    # the watchdog reports non-finite values, so warnings of NumPy are not needed
    quiet = np.errstate(all="ignore")
    with directory.alone(), stop_signals() as stopped_by, closing(Clock()) as clock, quiet:
        clock.on_compilation = lambda: progress.note(
            "compiling the code for these settings: up to a minute, only in the first run"
        )
        yield stopped_by, clock


def _failed_at_start(
    error: NumericalError, simulation: Simulation, directory: RunDirectory
) -> NumericalError:
    """Return the error with a table of neighbours; there is no history or checkpoint yet."""
    words = offenders.leave(directory.offenders, state_of(simulation), error.particle)
    return NumericalError(f"{error}\n{words}".rstrip(), error.particle)


def state_of(simulation: Simulation, lineage: tuple[str, ...] = ()) -> Checkpoint:
    """Return the checkpoint of a simulation, even of one that failed at its start."""
    particles, limit = simulation.particles, simulation.limit
    origin = simulation.search.origin or Origin(particles.position, particles.support, 0.0)
    found = Checkpoint(
        particles=particles,
        time=simulation.time,
        step=simulation.step,
        next_step=limit.dt if limit else 0.0,
        list_position=origin.position,
        list_support=origin.support,
        list_skin=origin.skin,
        config=simulation.scene.config,
        lineage=lineage,
        budget=simulation.budget,
    )
    found.scene = simulation.scene  # built already
    return found


def new_history(config: Config, simulation: Simulation, directory: RunDirectory) -> History:
    problem = config.problem
    there, own = [*simulation.columns()], [*problem.diagnostics(simulation.particles)]
    if twice := sorted({*columns.shared(problem.dimension), *there} & {*own}):
        raise DeclarationError(
            f"the problem {problem.name}: diagnostics returned {', '.join(twice)}, which the "
            "history has already; expected other names"
        )
    return History.create(directory.history, problem.dimension, [*there, *own])


def threads_of(config: Config) -> int:
    """Return the number of threads; "all" is every processor that the process may use."""
    if config.run.threads == "all":
        return available_processors()
    return config.run.threads


class Runner:
    """The loop over steps and outputs, from a start or a restart."""

    def __init__(self, config, directory, simulation, history, progress, stopped_by):
        self.config = config
        self.directory = directory
        self.simulation = simulation
        self.history = history
        self.progress = progress
        self.stopped_by = stopped_by  # names of received signals, see stop_signals
        self.number = 0  # of the next checkpoint
        self.saved_step = None  # step of the last checkpoint
        self.lineage = ()
        self.frames = Recorder(config, directory.frames)
        self.wall_before = self.cpu_before = 0.0  # of earlier sessions

    def from_start(self) -> dict:
        with self._closing():
            self.simulation.keep_row()
            self.frames.begin(self.simulation)
            self._write_checkpoint()
            return self._to_end()

    def from_checkpoint(self) -> dict:
        with self._closing():
            past = read_history(self.directory.history)
            if past["step"].size:
                self.wall_before = past["wall_seconds"][-1]
                self.cpu_before = past["cpu_seconds"][-1]
            else:  # a checkpoint without history: begin one, whose first row has no limiter
                self.simulation.keep_row()
                self._record()
            self.frames.begin(self.simulation)
            return self._to_end()

    @contextmanager
    def _closing(self):
        try:
            with self.frames.held():
                yield
        except BaseException:  # report this error, not one of closing the history
            with suppress(FileError):
                self._record()
                self.history.close()
            raise
        else:
            self.history.close()
        finally:
            self.progress.close()
            self.simulation.close()

    def _to_end(self) -> dict:
        simulation, end = self.simulation, self.config.time.end
        times = output_times(end, self.config.output.interval, simulation.time)
        if held := faults.held_courant(simulation.scene):
            self.progress.note(held)
        # diagnostics are those of each step
        most = 1 if self.config.problem.has_diagnostics or self.progress.each_step else MOST
        self.progress.start(simulation.time, end)
        try:
            for output in times:
                while simulation.time < output:
                    if self.stopped_by:
                        self._stop(self.stopped_by[0])
                    simulation.proceed(output, most, self.frames.due)
                    if self.config.problem.has_diagnostics:
                        self._record()
                    self.frames.record(simulation)
                    self._heed(self.progress.step(simulation))
                self._write_checkpoint()
        except NumericalError as error:
            raise self._failed(error) from error
        return self._close("done")

    def _heed(self, reason: str | None) -> None:
        """Stop before the next step if there is a reason."""
        if reason:
            self.stopped_by.append(reason)

    def _failed(self, error: NumericalError) -> NumericalError:
        """Return the error with a table of neighbours and the checkpoint to restart from."""
        words = offenders.leave(self.directory.offenders, self._checkpoint(), error.particle)
        try:
            last = self.directory.last_good()
            words += (
                f"The last valid checkpoint is {last}: "
                f"`sph restart {quoted(last)} --set …` continues it with other settings."
            )
            self._close("failed", reason=str(error))
        except FileError as full:  # the numerical failure is reported even if the disk is full
            words += f"\nThe end of the run could not be recorded: {first_line(str(full))}."
        return NumericalError(f"{error}\n{words}", error.particle)

    def _stop(self, name: str) -> None:
        simulation = self.simulation
        if self.saved_step != simulation.step:
            self._write_checkpoint()
        self._close("stopped", reason=name)
        raise Stopped(
            f"stopped by {name} at t = {simulation.time:.6g}, step {simulation.step}; wrote "
            f"{self.directory.checkpoint_path(self.number - 1)}.\n"
            f"`sph restart {quoted(self.directory.path)}` continues the run."
        )

    def _record(self) -> None:
        """Add the rows of the steps since the last call to the history."""
        simulation, problem = self.simulation, self.config.problem
        for row in simulation.take_rows():
            for name, before in (
                ("wall_seconds", self.wall_before),
                ("cpu_seconds", self.cpu_before),
            ):
                row[name] = [round(before + seconds, 6) for seconds in row[name]]
            if problem.has_diagnostics:  # a row at a time
                with simulation.clock.phase("diagnostics"):
                    found = problem.diagnostics(simulation.particles)
                row |= {name: [value] for name, value in found.items()}
                self._check_names(found.keys(), row.keys())
            self.history.extend(row)

    def _check_names(self, diagnostics: Set[str], columns: Set[str]) -> None:
        known = {*self.history.columns}
        if wrong := sorted((diagnostics - known) | (known - columns)):
            raise DeclarationError(
                f"the problem {self.config.problem.name}: diagnostics returned {', '.join(wrong)} "
                "in some steps only; expected the names of the first step in all steps"
            )

    def _write_checkpoint(self) -> None:
        """Flush the history, then write the checkpoint."""
        simulation = self.simulation
        simulation.check_fields()
        path = self.directory.checkpoint_path(self.number)
        self._record()
        with simulation.clock.phase("output"):
            self.history.flush()
            checkpoints.write(path, self._checkpoint())
        self.number += 1
        self.saved_step = simulation.step
        self._heed(self.progress.wrote(path, simulation))

    def _checkpoint(self) -> Checkpoint:
        return state_of(self.simulation, self.lineage)

    def _close(self, status: str, reason: str | None = None) -> dict:
        simulation = self.simulation
        self._record()
        self.history.flush()
        simulation.end()
        past = read_history(self.directory.history)
        try:
            result = summary.of_run(
                simulation, past, status=status, reason=reason, lineage=self.lineage,
                relaxation=self.directory.read_relaxation(),
            )  # fmt: skip
        except DeclarationError as error:
            raise DeclarationError(
                f"{error}\nThe checkpoints of the run are complete: mend the file, then "
                f"`sph restart {quoted(self.directory.path)}` writes the summary."
            ) from error.__cause__
        self.directory.write_summary(result)
        named = self.config.report.reference
        if named and status == "done":  # the summary is already written, if this fails
            fine = reference.Reference(Path(named))
            where = str(self.directory.path)
            result["errors"] = reference.errors_against(self._checkpoint(), fine, where)
            summary.warn(result, self.simulation)
            self.directory.write_summary(result)
        return result
