"""Restart from a checkpoint, bit for bit as without a stop if no setting changes."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sph import config as configuration
from sph import fingerprint
from sph.analysis import reference, summary, trial
from sph.clock import Clock
from sph.config import Config, outside, restarts
from sph.config.restarts import Change
from sph.errors import AtEnd, ConfigError, FileError, SphError
from sph.integrators import step_size
from sph.neighbours.search import Origin
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import Checkpoint
from sph.output.files import copy_file, is_same_path
from sph.output.history import History
from sph.output.history import read as read_history
from sph.output.offenders import PART
from sph.output.run_directory import RunDirectory, checkpoint_number, find
from sph.output.times import output_times
from sph.runner import Runner, new_history, session, threads_of
from sph.scene import Scene
from sph.simulation import Simulation
from sph.totals import Budget


def restart(
    source: Path, overrides: Sequence[str], directory: Path | None, progress
) -> tuple[dict, RunDirectory]:
    """Continue a run. Return the summary and the run directory.

    source: a checkpoint, or a run directory, of which the last valid checkpoint is used; overrides:
    `a.b=VALUE`; directory: a new run directory, or None for that of the checkpoint, in which later
    checkpoints are replaced. Raises as `run`, and FileError, ConfigError and AtEnd before anything
    is changed.
    """
    home, path = find(source)
    checkpoint = checkpoints.read(path)
    if home is not None:
        home.check_belongs(path, checkpoint, directory)
    if PART in checkpoint.lineage:
        raise FileError(
            f"{path} contains only {PART}: it cannot be restarted.\n"
            "Try: the last valid checkpoint of the run, with other settings."
        )
    config = checkpoint.config.override(overrides)
    changed = restarts.changes(checkpoint.config, config)
    _check_changes(changed, config, checkpoint)
    _note_sources(changed, config, progress)
    in_place = directory is None or (home is not None and is_same_path(directory, home.path))
    is_closed = not (in_place and _is_last_without_summary(home, path, checkpoint.time))
    _check_steps_left(source, changed, config, checkpoint.time, is_closed)
    reference.check(config, directory or (home and home.path))
    if source.is_dir():
        _note_damaged(home, path, progress)
        _note_other_settings(home, checkpoint.config, config, progress)
    target, number = _place_to_go_on(home, path, checkpoint.step, directory)
    if reason := fingerprint.differences(checkpoint.computed_by):
        progress.note(reason)
    with session(target, config, progress) as (stopped_by, clock):
        lineage = (
            *checkpoint.lineage,
            restarts.lineage(checkpoint.step, checkpoint.time, changed),
        )
        next_step = _coming_step(config, checkpoint)
        begun = dataclasses.replace(
            checkpoint, config=config, lineage=lineage, next_step=next_step,
            budget=_budget(checkpoint, target),
        )  # fmt: skip
        with target.withdrawn_unless_begun(is_copy=True):
            simulation = _resumed(begun, clock)
            for note in trial.notes(simulation):
                progress.note(note)
        _begin_anew(target, number, begun, config.recorded != checkpoint.config.recorded)
        if target.history.exists():
            history = History.resume(target.history, checkpoint.step)
        else:
            history = new_history(config, simulation, target)
        runner = Runner(config, target, simulation, history, progress, stopped_by)
        runner.number, runner.saved_step = number + 1, checkpoint.step
        runner.lineage = lineage
        return runner.from_checkpoint(), target


def _begin_anew(target: RunDirectory, number: int, begun: Checkpoint, is_changed: bool) -> None:
    """Prepare the directory for a restart from checkpoint `number`; consistent at every moment.

    First, files of later states are removed. Then the changed settings are written to the
    checkpoint itself, so that they are not lost if the restart is stopped before its first step.
    Last, config.toml is written, which no restart reads.
    """
    for old in (target.summary, target.offenders):
        old.unlink(missing_ok=True)
    target.drop_checkpoints_after(number)
    target.frames.drop_after(begun.step)
    if is_changed:
        checkpoints.write(target.checkpoint_path(number), begun)
    target.write_config(begun.config.to_toml())


def _resumed(checkpoint: Checkpoint, clock: Clock) -> Simulation:
    config = checkpoint.config
    origin = Origin(checkpoint.list_position, checkpoint.list_support, checkpoint.list_skin)
    return Simulation.resume(
        Scene(config), checkpoint.particles, checkpoint.time, checkpoint.step,
        checkpoint.next_step, origin, threads_of(config), clock, checkpoint.budget,
    )  # fmt: skip


def _budget(checkpoint: Checkpoint, target: RunDirectory) -> Budget | None:
    """Return the energy budget of the checkpoint; the history has that of one of format 1."""
    if checkpoint.budget is not None or not target.history.exists():
        return checkpoint.budget
    past = read_history(target.history)
    rows = past["step"] <= checkpoint.step
    if not rows.any():
        return None
    added = past["energy_added"][rows][-1] if "energy_added" in past else 0.0
    return Budget(past["energy_injected"][rows][-1], added, summary.baseline(past))


def _coming_step(config: Config, checkpoint: Checkpoint) -> float:
    """Return the checkpoint's next step, adapted to changed limits on the time step (eq 32)."""
    now, before, p = config.physics, checkpoint.config.physics, checkpoint.particles
    scene = Scene(config)
    held, held_before = (s.step_bounds.courant for s in (scene, Scene(checkpoint.config)))
    ratio = held / held_before  # 1 if unchanged: bit for bit
    step = checkpoint.next_step * ratio
    if (each := p.get("time_step")) is not None:  # of individual steps
        each *= ratio
    if step > checkpoint.next_step:
        limit = step_size.StepLimit(step, 0, "checkpoint")
        step = step_size.before_contact(limit, scene.step_bounds, p, scene.domain).dt
    if now.energy_limit and not before.energy_limit:
        warm = p.internal_energy > 0.0  # as in step_size: u = 0 does not limit the step
        with np.errstate(divide="ignore"):
            times = held * p.internal_energy[warm] / np.abs(p.energy_rate[warm])
        if each is not None:
            each[warm] = np.minimum(each[warm], times)
        else:
            step = min(step, float(np.min(times, initial=np.inf)))
    return step


def _check_changes(changed: list[Change], config: Config, checkpoint: Checkpoint) -> None:
    """Raise ConfigError if a restart with the settings `config` is not possible."""
    wrong = restarts.refusals(changed)
    if config.time.end < checkpoint.time:
        wrong.append(
            f"time.end = {config.time.end}: expected a later time than the checkpoint's, "
            f"{checkpoint.time}"
        )
    if wrong:
        raise ConfigError("\n".join(wrong))


def _check_steps_left(
    source: Path, changed: list[Change], config: Config, time: float, is_closed: bool
) -> None:
    """Raise ConfigError for changed settings that no step would use, AtEnd for a completed run."""
    if any(output_times(config.time.end, config.output.interval, time)):
        return
    settings = [
        str(one) for one in changed if not one.key.startswith("run.") and not _is_source(one)
    ]
    if settings:
        raise ConfigError(
            f"{source} has reached its end, t = {time:g}: no step would be computed with "
            f"{', '.join(settings)}.\nTry: a later time.end, or an earlier checkpoint."
        )
    if is_closed:
        raise AtEnd(f"{source} has reached its end, t = {time:g}. Try: a later time.end.")


def _is_source(change: Change) -> bool:
    """Whether a change is one of the sources of a problem from outside, not of a setting."""
    table, _, key = change.key.partition(".")
    return table == "problem" and key in outside.SOURCES


def _note_sources(changed: list[Change], config: Config, progress) -> None:
    """Note that the file, or the package, of the problem has changed since the checkpoint."""
    for one in filter(_is_source, changed):
        what = getattr(config.problem, "file", "the package of the problem")
        progress.note(
            f"{what} has changed since the checkpoint was written: {one}. The run continues from "
            "the state in the checkpoint; exact solution, diagnostics and figures are those of the "
            "changed problem"
        )


def _is_last_without_summary(home: RunDirectory | None, path: Path, time: float) -> bool:
    """Return whether a run was killed after its last checkpoint, `path`, and before its summary."""
    if home is None or checkpoint_number(path) != checkpoint_number(home.checkpoints()[-1]):
        return False
    found = home.read_summary()
    return (found.get("status"), found.get("time")) != ("done", time)


def _note_other_settings(home: RunDirectory, before: Config, config: Config, progress) -> None:
    """Note where config.toml, which is not used, differs from the checkpoint and --set.

    A user has edited it, or a restart with other settings was killed before its first checkpoint.
    """
    if not home.config.is_file():  # reading a pipe would block
        return
    try:
        written = configuration.load(home.config)
    except SphError:
        return
    given = {one.key for one in restarts.changes(before, config)}
    differing = {one.key for one in restarts.changes(config, written)}
    for one in restarts.changes(before, written):
        if one.key not in differing or one.key.startswith("run."):
            continue
        instead = (
            "that of --set" if one.key in given else "that of the checkpoint; --set changes it"
        )
        progress.note(
            f"{home.config} has {str(one).replace('(was', '(the checkpoint:', 1)}, which is not "
            f"used: continuing with {instead}"
        )


def _note_damaged(home: RunDirectory, good: Path, progress) -> None:
    """Note which checkpoints after the last valid one are skipped."""
    for path in home.checkpoints():
        if checkpoint_number(path) > checkpoint_number(good):
            why = "energy has drifted" if home.has_failed else "it cannot be read"
            progress.note(f"{path} is skipped ({why}): continuing from {good.name}")


def _place_to_go_on(
    home: RunDirectory | None, path: Path, step: int, directory: Path | None
) -> tuple[RunDirectory, int]:
    """Return the run directory to continue in, filled if new, and the checkpoint number."""
    if directory is None and home is None:
        raise FileError(
            f"{path} is not in a run directory.\nTry: -o DIR, to continue in a new one."
        )
    if directory is None or (home is not None and is_same_path(directory, home.path)):
        return home, checkpoint_number(path)
    target = RunDirectory.create(directory)
    target.make_room()
    if home is None:
        copy_file(path, target.checkpoint_path(0))
        return target, 0
    number = checkpoint_number(path)
    for earlier in home.checkpoints():
        if checkpoint_number(earlier) <= number:
            copy_file(earlier, target.checkpoint_path(checkpoint_number(earlier)))
    for path in (home.history, home.problem, home.relaxation):
        if path.exists():
            copy_file(path, target.path / path.name)
    if frames := home.frames.up_to(step):
        with target.frames.held():
            for frame in frames:
                copy_file(frame, target.frames.path / frame.name)
    return target, number
