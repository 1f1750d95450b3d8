"""The stress suite from its command line to its closing words.

Each case is a sweep in a directory of its own; its points are the settings of the case. All points
share one pool of processes. Runs that have ended are not repeated.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from sph import progress
from sph.errors import FileError, Stopped
from sph.output.files import explained, write_text
from sph.stress import table
from sph.stress.case import Case, load
from sph.stress.verdict import Result, judge
from sph.sweep import local
from sph.sweep.manifest import SweepDirectory
from sph.sweep.plan import Plan, Point
from sph.sweep.task import Outcome, Task, tasks


class Suite:
    """Cases in a directory, and a task for each setting of each case."""

    def __init__(self, cases: Sequence[Case], directory: Path, overrides: Sequence[str] = ()):
        self.cases = list(cases)
        self.directory = directory
        self.runs: dict[str, tuple[Case, str, Task]] = {}
        for case in self.cases:
            plan = Plan(tuple(overrides), {}, tuple(_point(case, name) for name in case.settings))
            sweep = SweepDirectory(directory.absolute() / case.name)
            _prepare(sweep, case, plan)
            for name, task in zip(case.settings, tasks(sweep, plan), strict=True):
                self.runs[task.point.name] = case, name, task

    def result(self, name: str) -> Result:
        """The result of a run that has ended."""
        return judge(*self.runs[name])

    def results(self) -> list[Result]:
        return [self.result(name) for name in self.runs]


def run(
    only: Sequence[str], directory: Path, jobs: int | None = None, overrides: Sequence[str] = ()
) -> tuple[Suite, list[Result]]:
    """Run the cases of these names and judge them; writes stress.json and stress.md.

    overrides: `a.b=VALUE` for all cases; the settings of a case take precedence. Raises ConfigError
    before any run starts, FileError also where a run could not write a file, and Stopped where a
    run was stopped.
    """
    suite = Suite(load(only), directory, overrides)
    missing = [task for _, _, task in suite.runs.values() if not _has_ended(task)]
    told = _Told(suite, len(missing))
    try:
        local.run(missing, jobs, told)
    finally:
        told.shown.close()
    if told.unwritten:
        raise FileError(told.unwritten)
    if told.stopped:
        raise Stopped(
            f"{told.stopped} of {len(suite.runs)} runs have not ended; the same command continues "
            "them."
        )
    results = suite.results()
    with explained(f"cannot write to {directory}"):
        write_text(directory / "stress.json", table.as_json(suite.cases, results))
        write_text(directory / "stress.md", table.as_markdown(suite.cases, results))
    return suite, results


class _Told:
    """A line for each run that ends, with its verdict."""

    def __init__(self, suite: Suite, missing: int):
        self.suite = suite
        self.shown = progress.suited_to_runs("runs", len(suite.runs), len(suite.runs) - missing)
        self.stopped = 0
        self.unwritten = ""  # which run could not write, and why: that says nothing of its method

    def __call__(self, outcome: Outcome) -> None:
        if outcome.status == "stopped":
            self.stopped += 1
            self.shown.note(f"{outcome.name} stopped: {outcome.reason}")
            return
        if outcome.code == FileError.exit_code:
            self.unwritten = f"{outcome.name}: {outcome.reason}"
        self.shown.ended(f"{outcome.name}: {self.suite.result(outcome.name).verdict}")


def _point(case: Case, setting: str) -> Point:
    return Point(f"{case.name}.{setting}", tuple(case.settings[setting].set))


def _prepare(sweep: SweepDirectory, case: Case, plan: Plan) -> None:
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder) / f"{case.name}.toml"
        base.write_text(case.to_toml(), encoding="utf-8")
        sweep.prepare(base, plan)


def _has_ended(task: Task) -> bool:
    """Whether a run is done, or failed: a numerical failure is a result too."""
    return task.status in ("done", "failed")
