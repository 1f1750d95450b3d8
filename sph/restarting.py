"""Go on from a checkpoint: what may change, where it goes on, and that it does bit for bit."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sph.analysis import reference
from sph.clock import Clock
from sph.config import Config
from sph.errors import ConfigError, FileError
from sph.neighbours.search import Origin
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import Checkpoint
from sph.output.files import copy_file
from sph.output.history import History
from sph.output.offenders import PART
from sph.output.run_directory import RunDirectory, checkpoint_number, find
from sph.runner import Runner, new_history, session, threads_of
from sph.scene import Scene
from sph.simulation import Simulation


def restart(
    source: Path, overrides: Sequence[str], directory: Path | None, progress
) -> tuple[dict, RunDirectory]:
    """Go on from `source`, a checkpoint or a run directory, whose last good one is then taken.

    Later checkpoints are replaced. overrides: `a.b=VALUE`; directory: a new run directory, or None
    for the one that the checkpoint is in. Returns the summary and the run directory. Raises as
    `run`, and FileError and ConfigError before anything is changed.
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
    _check_changes(config, checkpoint)
    reference.check(config, directory or (home and home.path))
    if source.is_dir():
        _note_damaged(home, path, progress)
    target, number = _place_to_go_on(home, path, directory)
    with session(target) as (stopped_by, clock):
        target.write_config(config.to_toml())
        simulation = _resumed(config, checkpoint, clock)
        target.drop_checkpoints_after(number)
        for old in (target.summary, target.offenders):  # a run that is killed must not keep them
            old.unlink(missing_ok=True)
        if target.history.exists():
            history = History.resume(target.history, checkpoint.step)
        else:
            history = new_history(config, simulation, target)
        lineage = f"restarted at step {checkpoint.step}, t = {checkpoint.time!r}"
        runner = Runner(config, target, simulation, history, progress, stopped_by)
        runner.number, runner.saved_step = number + 1, checkpoint.step
        runner.lineage = (*checkpoint.lineage, lineage)
        return runner.from_checkpoint(), target


def _resumed(config: Config, checkpoint: Checkpoint, clock: Clock) -> Simulation:
    origin = Origin(checkpoint.list_position, checkpoint.list_support, checkpoint.list_skin)
    return Simulation.resume(
        Scene(config), checkpoint.particles, checkpoint.time, checkpoint.step,
        _coming_step(config, checkpoint), origin, threads_of(config), clock,
    )  # fmt: skip


def _coming_step(config: Config, checkpoint: Checkpoint) -> float:
    """The checkpoint's next step, or what becomes of it under other limits (eq 32)."""
    now, before, p = config.physics, checkpoint.config.physics, checkpoint.particles
    step = checkpoint.next_step * (now.C / before.C)  # unchanged where C is: bit for bit
    if now.energy_limit and not before.energy_limit:
        warm = p.internal_energy > 0.0  # as for every step: what has no energy sets none
        with np.errstate(divide="ignore"):
            times = p.internal_energy[warm] / np.abs(p.energy_rate[warm])
        step = min(step, float(now.C * np.min(times, initial=np.inf)))
    return step


def _check_changes(config: Config, checkpoint: Checkpoint) -> None:
    """Raise ConfigError where `config` wants what the particles of a checkpoint cannot give."""
    before, after = checkpoint.config.problem.model_dump(), config.problem.model_dump()
    wrong = [
        f"problem.{key} cannot be changed in a restart: the particles are there already"
        for key in after
        if key not in before or after[key] != before[key]
    ]
    now, then = config.physics, checkpoint.config.physics
    for key, changed in (
        ("external", now.external != then.external),
        ("heating", (now.heating is None) != (then.heating is None)),
    ):
        if changed:
            wrong.append(
                f"physics.{key}: expected as in the checkpoint, for the run's energy is measured "
                "by what it began with"
            )
    if Scene(config).evolves_alpha != (checkpoint.particles.alpha is not None):
        kind = "one number" if checkpoint.particles.alpha is None else "a range"
        wrong.append(f"physics.alpha: expected {kind}, as in the checkpoint")
    if config.time.end < checkpoint.time:
        wrong.append(
            f"time.end = {config.time.end}: expected a later time than the checkpoint's, "
            f"{checkpoint.time}"
        )
    if wrong:
        raise ConfigError("\n".join(wrong))


def _note_damaged(home: RunDirectory, good: Path, progress) -> None:
    """Say which checkpoints after the last good one were passed over."""
    for path in home.checkpoints():
        if checkpoint_number(path) > checkpoint_number(good):
            progress.note(f"{path} cannot be read: going on from {good.name}")


def _place_to_go_on(
    home: RunDirectory | None, path: Path, directory: Path | None
) -> tuple[RunDirectory, int]:
    """The run directory to go on in, filled where it is a new one; the checkpoint's number."""
    if directory is None and home is None:
        raise FileError(f"{path} is not in a run directory.\nTry: -o DIR, to go on in a new one.")
    if directory is None or (home is not None and directory.resolve() == home.path.resolve()):
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
