"""The results of the suite: a table and sentences, as plain text, Markdown and JSON."""

import math
from collections.abc import Sequence

from sph.output.json_text import json_text, null
from sph.stress.case import Case
from sph.stress.verdict import PASS, Result

HEADER = (
    "case", "setting", "scheme", "verdict", "worst error", "energy drift", "lowest u",
    "lowest rho", "steps", "smallest dt", "CPU s",
)  # fmt: skip
WORDS = 5  # the first columns hold words and are aligned left


def as_text(results: Sequence[Result]) -> str:
    """The table with aligned columns, for a terminal."""
    lines = [HEADER, *map(_cells, results)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if place < WORDS else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def as_markdown(cases: Sequence[Case], results: Sequence[Result]) -> str:
    """The table and the sentences."""
    rule = [":---"] * WORDS + ["---:"] * (len(HEADER) - WORDS)
    rows = ["| " + " | ".join(line) + " |" for line in (HEADER, rule, *map(_cells, results))]
    said = [f"- {sentence}" for sentence in sentences(cases, results)]
    return "\n\n".join(["\n".join(rows), "\n".join(said), closing(results)]) + "\n"


def as_json(cases: Sequence[Case], results: Sequence[Result]) -> str:
    """The cases with the reasons of their limits, and the results. NaN is null."""
    content = {
        "words": closing(results),
        "cases": [
            {
                "case": case.name,
                "title": case.title,
                "hard": case.hard,
                "passes": _passes(_of(case.name, results)),
                "settings": [_record(case, result) for result in _of(case.name, results)],
            }
            for case in cases
        ],
    }
    return json_text(content, endless=null)


def sentences(cases: Sequence[Case], results: Sequence[Result]) -> list[str]:
    """Why settings fail, and how close SPH comes where it cannot reach the exact answer."""
    said = [
        f"{result.name}, {result.verdict}: {result.reason}."
        for result in results
        if result.verdict != PASS
    ]
    for case in cases:
        for name, reach in case.reaches.items():
            values = [
                f"{result.reaches[name]:.3g} ({result.setting})"
                for result in _of(case.name, results)
                if result.verdict == PASS and not math.isnan(result.reaches[name])
            ]
            if values:
                said.append(
                    f"{case.name} reaches {name} = {', '.join(values)}; exact: {reach.ideal:g}. "
                    f"Reason: {reach.why}."
                )
    return said


def closing(results: Sequence[Result]) -> str:
    """The number of cases that pass, and the names of the others."""
    names = list(dict.fromkeys(result.case for result in results))
    short = [name for name in names if not _passes(_of(name, results))]
    seconds = sum(result.numbers.get("cpu_seconds", 0.0) for result in results)
    caught = sum(result.verdict != PASS and result.is_expected for result in results)
    said = (
        f"{len(names) - len(short)} of {len(names)} cases pass; {caught} expected failures; "
        f"{seconds:.0f} CPU seconds."
    )
    if short:
        said += f" Not passed: {', '.join(_why_short(name, results) for name in short)}."
    return said


def is_passed(results: Sequence[Result]) -> bool:
    """Whether every case passes."""
    return all(_passes(_of(name, results)) for name in {result.case for result in results})


def _passes(results: Sequence[Result]) -> bool:
    """Whether a case passes: all of its settings end as expected, and one or more pass."""
    passing = any(result.verdict == PASS for result in results)
    return passing and all(result.is_expected for result in results)


def _why_short(case: str, results: Sequence[Result]) -> str:
    wrong = [one for one in _of(case, results) if not one.is_expected]
    return f"{case} ({'; '.join(f'{one.setting} {one.verdict}' for one in wrong)})"


def _of(case: str, results: Sequence[Result]) -> list[Result]:
    return [result for result in results if result.case == case]


def _cells(result: Result) -> tuple[str, ...]:
    numbers, worst = result.numbers, result.worst
    error = "–" if worst is None else f"{worst.figure} {_short(worst.value)} ({worst.bound})"
    columns = (
        "energy_drift", "lowest_internal_energy", "lowest_density", "steps", "smallest_step",
    )  # fmt: skip
    return (
        result.case, result.setting, numbers.get("scheme", "–"), result.verdict, error,
        *(_short(numbers.get(name)) for name in columns),
        f"{numbers['cpu_seconds']:.1f}" if numbers else "–",
    )  # fmt: skip


def _short(value: float | int | None) -> str:
    if value is None or value != value:
        return "–"
    return str(value) if isinstance(value, int) else f"{value:.3g}"


def _record(case: Case, result: Result) -> dict:
    return {
        "setting": result.setting,
        "about": case.settings[result.setting].about,
        "set": case.settings[result.setting].set,
        "verdict": result.verdict,
        "reason": result.reason,
        **result.numbers,
        "checks": [
            {
                "figure": check.figure,
                "value": check.value,
                "at_least": check.bound.at_least,
                "at_most": check.bound.at_most,
                "holds": check.holds,
                "why": check.bound.why,
            }
            for check in result.checks
        ],
        "reaches": {
            name: {"value": value, **case.reaches[name].model_dump()}
            for name, value in result.reaches.items()
        },
    }
