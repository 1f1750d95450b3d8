"""Runs of one configuration at values of one key, in the directory of a sweep.

Each run has a run directory, named after the value. A run that has ended, done or failed, is never
repeated; a run that was killed continues from its last checkpoint.
"""

from collections.abc import Sequence
from pathlib import Path

from sph import config as configuration
from sph import progress
from sph.errors import ConfigError, FileError, NumericalError, Stopped, first_line
from sph.stability.criterion import NONE, Criterion, Judge, Trial
from sph.sweep import local
from sph.sweep.manifest import SweepDirectory
from sph.sweep.plan import Plan, Point
from sph.sweep.task import Outcome, Task, tasks

COURANT = "physics.C"
DEFAULT = "default"  # name of the run of the configuration as it is


class Trials:
    """Runs and judges trials of `key`; `done` holds the trials so far, by value."""

    def __init__(
        self, config: Path, key: str, overrides: Sequence[str], directory: Path,
        criterion: Criterion, jobs: int,
    ):  # fmt: skip
        """Runs the reference. Raises as `run`, and as `Judge`."""
        self.path, self.key, self.overrides, self.jobs = config, key, tuple(overrides), jobs
        self.config = configuration.load(config, overrides)
        self.sweep = SweepDirectory(directory.absolute())
        self.done: dict[float, Trial] = {}
        self.shown = progress.suited_to_runs("trials", None)  # bisection decides how many
        courant = float(f"{self.config.physics.C * criterion.reference:.6g}")
        (task,) = self._run([self._point(COURANT, courant)])
        if task.status is None:
            raise NumericalError(f"the reference run fails: {self._refused[task.point.name]}")
        # a mode of few particles grows otherwise at another eta, which is no instability
        self.judge = Judge(task.run.path, criterion, holds_report=key == COURANT)
        if key == COURANT:
            self.done[courant] = self.judge.trial(courant, task.run.path)

    @property
    def default(self) -> float:
        """The configuration's own value of the key."""
        return getattr(self.config.physics, self.key.partition(".")[2])

    @property
    def whole_end(self) -> float:
        """time.end of the configuration file; an override may have shortened the runs."""
        others = [one for one in self.overrides if not one.startswith("time.end")]
        try:
            return configuration.load(self.path, others).time.end
        except ConfigError:  # the file has none of its own
            return self.config.time.end

    def are_stable(self, values: Sequence[float]) -> list[bool]:
        """Whether runs at these values are stable; runs that are missing are made.

        Raises ConfigError where the directory holds runs of another configuration, FileError, and
        Stopped where a run was stopped.
        """
        missing = [value for value in values if value not in self.done]
        found = self._run([self._point(self.key, value) for value in missing])
        for value, task in zip(missing, found, strict=True):
            self.done[value] = self._trial(value, task)
            self._told(self.done[value])
        return [self.done[value].is_stable for value in values]

    def _point(self, key: str, value: float) -> Point:
        own = getattr(self.config.physics, key.partition(".")[2])
        if value == own:
            return Point(DEFAULT, ())
        return Point(f"{key}={value!r}", (f"{key}={value!r}",))

    def _run(self, points: Sequence[Point]) -> list[Task]:
        if not points:
            return []
        plan = Plan(self.overrides, {}, tuple(points))
        self.sweep.prepare(self.path, plan)
        found = tasks(self.sweep, plan)
        missing = [task for task in found if task.status not in ("done", "failed")]
        outcomes: list[Outcome] = []
        local.run(missing, self.jobs, outcomes.append)
        self._refused = {}
        for outcome in outcomes:
            if outcome.status == "stopped":
                raise Stopped(f"{outcome.name}: {outcome.reason}; the same command continues.")
            if outcome.status == "failed" and outcome.code != NumericalError.exit_code:
                raise FileError(f"{outcome.name} in {self.sweep.path}: {outcome.reason}")
            self._refused[outcome.name] = outcome.reason
        return found

    def _trial(self, value: float, task: Task) -> Trial:
        if task.status is None:  # it failed before its first step
            name = task.point.name
            reason = first_line(self._refused[name])
            return Trial(value, name, "failed", reason, NONE, "", NONE, 0.0, 0, 0.0)
        return self.judge.trial(value, task.run.path)

    def _told(self, trial: Trial) -> None:
        reason = f": {trial.reason}" if trial.reason else ""
        self.shown.ended(f"{self.key} = {trial.value:g}: {trial.verdict}{reason}")
