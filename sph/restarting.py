"""Go on from a checkpoint: what may change, where it goes on, and that it does bit for bit."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sph import config as configuration
from sph import fingerprint
from sph.analysis import reference, summary
from sph.clock import Clock
from sph.config import Config, restarts
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
from sph.runner import Runner, new_history, output_times, session, threads_of
from sph.scene import Scene
from sph.simulation import Simulation
from sph.totals import Budget


def restart(
    source: Path, overrides: Sequence[str], directory: Path | None, progress
) -> tuple[dict, RunDirectory]:
    """Go on from `source`, a checkpoint or a run directory, whose last good one is then taken.

    Later checkpoints are replaced. overrides: `a.b=VALUE`; directory: a new run directory, or None
    for the one that the checkpoint is in. Returns the summary and the run directory. Raises as
    `run`, and FileError, ConfigError and AtEnd before anything is changed.
    """
    home, path = find(source)
    checkpoint = checkpoints.read(path)
    if home is not None:
        home.check_belongs(path, checkpoint, directory)
    if PART in checkpoint.lineage:
        raise FileError(
            f"{path} holds {PART}: there is no going on from it.\n"
            "Try: the run's last good checkpoint, with other settings."
        )
    config = checkpoint.config.override(overrides)
    changed = restarts.changes(checkpoint.config, config)
    _check_changes(changed, config, checkpoint)
    in_place = directory is None or (home is not None and is_same_path(directory, home.path))
    is_closed = not (in_place and _is_last_without_summary(home, path, checkpoint.time))
    _check_steps_left(source, changed, config, checkpoint.time, is_closed)
    reference.check(config, directory or (home and home.path))
    if source.is_dir():
        _note_damaged(home, path, progress)
        _note_other_settings(home, checkpoint.config, config, progress)
    target, number = _place_to_go_on(home, path, directory)
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
        _begin_anew(target, number, begun, any(not one.key.startswith("run.") for one in changed))
        simulation = _resumed(begun, clock)
        if target.history.exists():
            history = History.resume(target.history, checkpoint.step)
        else:
            history = new_history(config, simulation, target)
        runner = Runner(config, target, simulation, history, progress, stopped_by)
        runner.number, runner.saved_step = number + 1, checkpoint.step
        runner.lineage = lineage
        return runner.from_checkpoint(), target


def _begin_anew(target: RunDirectory, number: int, begun: Checkpoint, is_changed: bool) -> None:
    """Make the directory say what goes on from checkpoint `number`, at every moment one truth.

    What a later state left goes first. Then the settings go into the checkpoint itself, from which
    every restart takes them: one that is stopped before its first step would lose them else.
    config.toml, which nobody goes on from, is last.
    """
    for old in (target.summary, target.offenders):
        old.unlink(missing_ok=True)
    target.drop_checkpoints_after(number)
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
    """The checkpoint's next step, or what becomes of it under other limits (eq 32)."""
    now, before, p = config.physics, checkpoint.config.physics, checkpoint.particles
    scene = Scene(config)
    held, held_before = (s.step_bounds.courant for s in (scene, Scene(checkpoint.config)))
    step = checkpoint.next_step * (held / held_before)  # unchanged where both are: bit for bit
    if step > checkpoint.next_step:
        limit = step_size.StepLimit(step, 0, "checkpoint")
        step = step_size.before_contact(limit, scene.step_bounds, p, scene.domain).dt
    if now.energy_limit and not before.energy_limit:
        warm = p.internal_energy > 0.0  # as for every step: what has no energy sets none
        with np.errstate(divide="ignore"):
            times = p.internal_energy[warm] / np.abs(p.energy_rate[warm])
        step = min(step, float(held * np.min(times, initial=np.inf)))
    return step


def _check_changes(changed: list[Change], config: Config, checkpoint: Checkpoint) -> None:
    """Raise ConfigError where `config` wants what the particles of a checkpoint cannot give."""
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
    """Raise ConfigError for settings that no step would be made with, AtEnd for a closed run."""
    if any(output_times(config.time.end, config.output.interval, time)):
        return
    settings = [str(one) for one in changed if not one.key.startswith("run.")]
    if settings:
        raise ConfigError(
            f"{source} is at its end, t = {time:g}: no step would be computed with "
            f"{', '.join(settings)}.\nTry: a later time.end, or an earlier checkpoint."
        )
    if is_closed:
        raise AtEnd(f"{source} is at its end, t = {time:g}: set a later time.end to go on.")


def _is_last_without_summary(home: RunDirectory | None, path: Path, time: float) -> bool:
    """Whether a run was killed after its last checkpoint, `path`, and before its summary."""
    if home is None or checkpoint_number(path) != checkpoint_number(home.checkpoints()[-1]):
        return False
    found = home.read_summary()
    return (found.get("status"), found.get("time")) != ("done", time)


def _note_other_settings(home: RunDirectory, before: Config, config: Config, progress) -> None:
    """Say where config.toml differs from the checkpoint and --set: nothing of it is used.

    A user has edited it, or a restart with other settings was killed before its first checkpoint.
    """
    if not home.config.is_file():  # a pipe would be waited for
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
            f"used: going on with {instead}"
        )


def _note_damaged(home: RunDirectory, good: Path, progress) -> None:
    """Say which checkpoints after the last good one were passed over."""
    for path in home.checkpoints():
        if checkpoint_number(path) > checkpoint_number(good):
            why = "energy had drifted by then" if home.has_failed else "cannot be read"
            progress.note(f"{path} is passed over ({why}): going on from {good.name}")


def _place_to_go_on(
    home: RunDirectory | None, path: Path, directory: Path | None
) -> tuple[RunDirectory, int]:
    """The run directory to go on in, filled where it is a new one; the checkpoint's number."""
    if directory is None and home is None:
        raise FileError(f"{path} is not in a run directory.\nTry: -o DIR, to go on in a new one.")
    if directory is None or (home is not None and is_same_path(directory, home.path)):
        return home, checkpoint_number(path)
    target = RunDirectory.create(directory)
    if home is None:
        copy_file(path, target.checkpoint_path(0))
        return target, 0
    number = checkpoint_number(path)
    for earlier in home.checkpoints():
        if checkpoint_number(earlier) <= number:
            copy_file(earlier, target.checkpoint_path(checkpoint_number(earlier)))
    if home.history.exists():
        copy_file(home.history, target.history)
    return target, number
