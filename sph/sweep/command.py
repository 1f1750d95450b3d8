"""A sweep, from the command line to its closing words."""

from collections.abc import Callable, Sequence
from pathlib import Path

from sph import progress, standard_streams
from sph.errors import ConfigError, NumericalError, Stopped
from sph.sweep import distributed, local, slurm
from sph.sweep.manifest import SweepDirectory
from sph.sweep.plan import Plan
from sph.sweep.task import Outcome, Task, tasks

ASKED_ABOVE = 1000  # points: more are probably a typing error
MARKS = {"done": "done", "failed": "FAILED", "stopped": "stopped"}


def run(
    config: Path,
    varies: Sequence[str],
    overrides: Sequence[str],
    directory: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
    slurm_options: Sequence[str] = (),
    is_sure: bool = False,
) -> str:
    """Run all points of a sweep that have not ended; returns the closing words.

    Raises ConfigError and FileError before any point runs, ConfigError also for more than
    ASKED_ABOVE points unless the user `is_sure`. After all points have run, raises NumericalError
    where a point failed, and Stopped where a point was stopped.
    """
    if scheduler and slurm_options:
        raise ConfigError("--scheduler and --slurm: give only one of the two")
    plan = Plan.of(varies, overrides)
    points = len(plan.points)
    if points > ASKED_ABOVE and not is_sure:
        raise ConfigError(
            f"--vary: the sweep has {points:,} points.\nTry: fewer values, or --yes to run them."
        )
    standard_streams.note(f"{points} {'point' if points == 1 else 'points'} to check and run")
    sweep = SweepDirectory(directory.absolute())
    sweep.prepare(config, plan)
    everything = tasks(sweep, plan)
    missing = [task for task in everything if task.status != "done"]
    told = _Told(len(everything), len(everything) - len(missing))
    try:
        _runner(jobs, scheduler, slurm_options)(missing, told)
    finally:
        told.shown.close()
    return told.closing()


def _runner(jobs, scheduler, options) -> Callable[[Sequence[Task], Callable], None]:
    if scheduler:
        return lambda missing, tell: distributed.run(missing, scheduler, tell)
    if options:
        return lambda missing, tell: slurm.run(missing, options, jobs, tell)
    return lambda missing, tell: local.run(missing, jobs, tell)


class _Told:
    """A line for each point that ends, and the closing words."""

    def __init__(self, points: int, before: int):
        self.points, self.before = points, before
        self.outcomes: list[Outcome] = []
        self.shown = progress.suited_to_runs("points", points, before)

    def __call__(self, outcome: Outcome) -> None:
        self.outcomes.append(outcome)
        how = ", restarted from its last checkpoint" if outcome.how == "restart" else ""
        reason = f": {outcome.reason}" if outcome.reason else ""
        status = MARKS[outcome.status]
        warned = f", with warnings: {', '.join(outcome.warnings)}" if outcome.warnings else ""
        self.shown.ended(f"{outcome.name} {status}{how}{warned}{reason}")

    def closing(self) -> str:
        """Raises NumericalError or Stopped where not all points are done."""
        lists = {status: [one for one in self.outcomes if one.status == status] for status in MARKS}
        done = f"{self.before + len(lists['done'])} of {self.points} points are done"
        if lists["failed"]:
            reasons = "".join(f"\n  {one.name}: {_first_line(one)}" for one in lists["failed"])
            raise NumericalError(f"{done}, {len(lists['failed'])} failed:{reasons}")
        if lists["stopped"]:
            raise Stopped(f"{done}; the same command continues with the rest.")
        return f"{done}{self._warned()}."

    def _warned(self) -> str:
        count = sum(bool(one.warnings) for one in self.outcomes)
        return f", {count} of them ended with warnings" if count else ""


def _first_line(outcome: Outcome) -> str:
    return outcome.reason.partition("\n")[0]
