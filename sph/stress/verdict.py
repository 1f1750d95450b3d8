"""Judge the runs of a case: passes, failures, and the failures that its file expects."""

from dataclasses import dataclass
from typing import Any

from sph.analysis.report.runs import Row
from sph.analysis.report.runs import read as read_runs
from sph.errors import first_line
from sph.stress.case import ALWAYS, Bound, Case, Failing
from sph.stress.figures import NONE, Figures
from sph.sweep.task import Task, standing

PASS = "pass"
SHORT = "falls short"
EXPECTED_FAILURE = "expected failure"
UNEXPECTED_FAILURE = "unexpected failure"  # not in the way that the case file expects
UNEXPECTED_PASS = "unexpected pass"


@dataclass(frozen=True)
class Check:
    """A figure and the bound that it must keep."""

    figure: str
    value: float
    bound: Bound

    @property
    def holds(self) -> bool:
        return self.bound.holds(self.value)

    def __str__(self) -> str:
        value = "is missing" if self.value != self.value else f"is {self.value:.3g}"
        return f"{self.figure} {value}, expected {self.bound}"


@dataclass(frozen=True)
class Result:
    """How a setting of a case ended."""

    case: str
    setting: str
    verdict: str
    reason: str  # in words; empty for a pass
    checks: tuple[Check, ...]
    reaches: dict[str, float]
    numbers: dict[str, Any]

    @property
    def name(self) -> str:
        return f"{self.case}.{self.setting}"

    @property
    def is_expected(self) -> bool:
        return self.verdict in (PASS, EXPECTED_FAILURE)

    @property
    def worst(self) -> Check | None:
        """The check that fails, or comes nearest to failing.

        Checks of every case are left out: the table has columns for them. An error that must stay
        below a bound goes before a figure that must exceed one.
        """
        own = [check for check in self.checks if check.figure not in ALWAYS]
        return max(own, key=_badness, default=None)


def _badness(check: Check) -> tuple[bool, bool, float]:
    is_error = check.bound.at_most is not None
    return not check.holds, is_error, check.bound.closeness(check.value)


def judge(case: Case, setting: str, task: Task) -> Result:
    """The result of a run that has ended, from its files. Raises FileError."""
    (row,) = read_runs([task.run.path]) if task.status else (None,)
    figures = Figures(task.run.path, row.summary if row else None)
    checks = tuple(
        Check(name, figures.value(name) if row else NONE, bound)
        for name, bound in case.bounds(setting).items()
    )
    ended = "" if task.status == "done" else (row.reason if row else standing(task).reason)
    verdict, reason = _verdict(case.settings[setting].fails, checks, ended)
    reaches = {name: figures.value(name) for name in case.reaches} if row else {}
    return Result(case.name, setting, verdict, reason, checks, reaches, _numbers(row, figures))


def _verdict(fails: Failing | None, checks: tuple[Check, ...], ended: str) -> tuple[str, str]:
    """The verdict and its reason. ended: why the run ended early; empty where it did not."""
    found = first_line(ended) or "; ".join(str(check) for check in checks if not check.holds)
    if fails is None:
        return (SHORT, found) if found else (PASS, "")
    if not found:
        return UNEXPECTED_PASS, f"expected to fail, because {fails.because}"
    broken = {check.figure for check in checks if not check.holds}
    by_exit = fails.exit is not None and fails.exit in ended
    by_limit = fails.limit in broken and not ended
    if by_exit or by_limit:
        return EXPECTED_FAILURE, f"{fails.because} ({found})"
    return UNEXPECTED_FAILURE, f"{found}; expected to fail because {fails.because}"


def _scheme_key(row: Row) -> str:
    """The key that names the equations: a formulation need not have several schemes."""
    return "physics.scheme" if "physics.scheme" in row.settings else "physics.formulation"


def _numbers(row: Row | None, figures: Figures) -> dict:
    """The columns that every case has."""
    if row is None:
        return {}
    return {
        "scheme": row.value(_scheme_key(row)),
        "particles": row.n,
        "energy_drift": figures.value("conservation.energy_drift_max"),
        "lowest_internal_energy": figures.value("history.min_internal_energy.min"),
        "lowest_density": figures.value("history.min_density.min"),
        "steps": row.steps,
        "smallest_step": figures.value("history.dt.min"),
        "cpu_seconds": row.cost["cpu"],
    }
