"""The findings of a report, in sentences."""

from pathlib import Path

import numpy as np

from sph.analysis.report.compare import COSTS, DRIFT, Report, Series
from sph.analysis.report.runs import Row

# CPU times of equal runs differ by a few per cent, more on a shared machine.
LEVEL = 1.1


def sentences(report: Report) -> list[str]:
    """Orders of convergence, the Pareto front, the distance of other lines from it, and caveats."""
    said = [_costs(report)]
    if report.rows:
        said += [_order(line) for line in report.series if line.order is not None]
        said.append(_front(report))
        said += [
            _standing(report, line) for line in report.series if not _is_all_front(report, line)
        ]
        said += _relaxation(report)
    said += [f"Without an error: {row.name} ({_reason(report, row)})." for row in report.without]
    return said + _warnings(report)


def _costs(report: Report) -> str:
    question = report.question
    truths = {row.truth for row in report.rows}
    named = truths.pop() if len(truths) == 1 and "." not in question.field else None
    against = f" against the run {Path(named).name}" if named is not None else ""
    text = f"Compared: {question.error_name}{against}, plotted against {COSTS[question.cost][0]}"
    if question.cost in ("cpu", "wall"):
        text += " without compilation and the start of Numba"
    if question.field == DRIFT and not any(row.errors for row in report.rows):
        text += ". No run has errors: --reference DIR takes them against a finer run"
    return text + "."


def _order(line: Series) -> str:
    fall = f", so error ∝ cost^{line.exponent:.2f}" if line.exponent is not None else ""
    if line.has_fixed_costs:
        fall = "; fixed costs dominate these short runs, so no power of the cost is given"
    return f"{_name(line)}: order {line.order:.2f} in the particle spacing{fall}."


def _front(report: Report) -> str:
    parts = []
    for line in report.series:
        members = [i for i in line.members if report.on_front[i]]
        if members:
            parts.append(f"{_name(line)} at {_resolutions(report, members)}")
    return f"On the front: {'; '.join(parts)}." if parts else ""


def _standing(report: Report, line: Series) -> str:
    """The cost of a line over the cost of the front, where the line is not on it."""
    off = [i for i in line.members if not report.on_front[i]]
    factors = report.excess[off]
    never = len(off) == len(line.members)
    where = "is never on the front" if never else f"is off the front at {_resolutions(report, off)}"
    what = COSTS[report.question.cost][0]
    if factors.max() < LEVEL:
        return f"{_name(line)} {where}, but within {LEVEL - 1:.0%} of it."
    low, high = (f"{value:.2g}" for value in (factors.min(), factors.max()))
    times = f"{low} times" if low == high else f"{low} to {high} times"
    times = f"up to {high} times" if low == "1" and low != high else times
    front_error = report.error[report.on_front]
    bound = "at least " if np.all(report.error[off] > front_error.max()) else ""
    return f"{_name(line)} {where}: {bound}{times} the {what} of the front at equal error."


def _relaxation(report: Report) -> list[str]:
    """How much of the cost relaxation to a glass is."""
    relaxed = [(row.cost["cpu"], row.relaxation) for row in report.rows if row.relaxation]
    if not relaxed:
        return []
    if report.question.cost in ("updates", "n"):
        what = COSTS[report.question.cost][0]
        return [f"Relaxation to a glass has a cost besides the {what}: see --x cpu."]
    seconds = [ended["cpu_seconds"] for _, ended in relaxed]
    shares = [ended["cpu_seconds"] / whole for whole, ended in relaxed]
    errors = [ended["density_error"] for _, ended in relaxed]
    return [
        f"Times include relaxation to a glass: {_range(seconds, '.2g')} CPU s, "
        f"{_range(shares, '.2g')} of the CPU time of these runs. The density error after "
        f"relaxation is {_range(errors, '.1e')}."
    ]


def _range(values: list[float], form: str) -> str:
    low, high = format(min(values), form), format(max(values), form)
    return low if low == high else f"{low} to {high}"


def _warnings(report: Report) -> list[str]:
    said = []
    warned = [f"{row.name} ({', '.join(row.warnings)})" for row in report.rows if row.warnings]
    if warned:
        said.append(f"Ended with warnings (hollow in the pictures): {'; '.join(warned)}.")
    restarted = [row.name for row in report.rows if row.is_restarted]
    if restarted and report.question.cost == "wall":
        said.append(
            "Restarted, so the time contains compilation and the start of Numba in earlier "
            f"sessions: {', '.join(restarted)}."
        )
    for row in (*report.rows, *report.without):
        if row.summary and (changed := row.summary["settings_changed"]):
            said.append(f"{row.name} changed its settings in restarts: {'; '.join(changed)}.")
    truths = dict.fromkeys(row.truth for row in report.rows)
    if len(truths) > 1 and "." not in report.question.field:
        told = (f"the run {Path(one).name}" if one else "the exact solution" for one in truths)
        said.append(f"Errors differ in what they are against: {', '.join(told)}.")
    different = [key for key in ("problem.name", "problem.dimension", "time.end")
                 if key in report.keys]  # fmt: skip
    if different:
        said.append(f"The runs differ in {', '.join(different)}: compare their costs with "
                    "care.")  # fmt: skip
    return said


def _name(line: Series) -> str:
    """The label of a line, with its sweep unless the label says it."""
    sweep = "" if line.label.startswith(f"{line.sweep} = ") else line.sweep
    return ": ".join(filter(None, [sweep, line.label])) or "the series"


def _resolutions(report: Report, members: list[int]) -> str:
    numbers = [str(report.rows[i].n) for i in members]
    return f"N = {', '.join(numbers)}"


def _is_all_front(report: Report, line: Series) -> bool:
    return all(report.on_front[i] for i in line.members)


def _reason(report: Report, row: Row) -> str:
    if row.status == "done":
        left_out = row.summary and row.summary["errors_left_out"]
        why = f": {left_out}" if left_out and "." not in report.question.field else ""
        return f"it has no {report.question.error_name}{why}"
    return ": ".join(filter(None, [row.status, row.reason.partition("\n")[0]]))
