"""The table of a report: for the terminal, as CSV, JSON and Markdown."""

import csv
import io
from collections.abc import Sequence
from typing import Any

from sph.analysis.report.compare import COSTS, RESOLUTION, Report
from sph.analysis.report.runs import Row
from sph.output.json_text import json_text, null
from sph.summary import lookup

NORMS = ("L1", "L2", "Linf")
RELAXATION = "relaxation CPU s"  # header of a column


def as_text(report: Report) -> str:
    """The table with aligned columns, for a terminal."""
    header, *lines = cells(report)
    widths = [max(map(len, column)) for column in zip(header, *lines, strict=True)]
    return "\n".join(
        "  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True))
        for line in (header, *lines)
    )


def as_markdown(report: Report, sentences: Sequence[str], pictures: Sequence[str]) -> str:
    """The table, the sentences, and links to the figures in the same directory."""
    header, *lines = cells(report)
    rule = ["---:"] * len(header)
    rows = ["| " + " | ".join(line) + " |" for line in (header, rule, *lines)]
    said = [f"- {sentence}" for sentence in sentences]
    shown = [f"![{name.removesuffix('.png').replace('_', ' ')}]({name})" for name in pictures]
    title = f"# {report.question.error_name} against {COSTS[report.question.cost][0]}"
    return "\n\n".join([title, "\n".join(rows), "\n".join(said), *shown]) + "\n"


def as_csv(report: Report) -> str:
    """One line for each run: all norms of all fields, and all figures of its summary."""
    records = _records(report)
    columns = dict.fromkeys(name for record in records for name in record)
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()


def as_json(report: Report, sentences: Sequence[str]) -> str:
    """The question, the runs, the series with their fits, and the sentences."""
    runs = [row.name for row in report.rows]
    reference = report.question.reference
    series = [
        {
            "sweep": line.sweep,
            "label": line.label,
            "runs": [runs[i] for i in line.members],
            "order": line.order,
            "exponent": line.exponent,
        }
        for line in report.series
    ]
    content = {
        "question": report.question._asdict() | {"reference": reference and str(reference)},
        "varied": report.keys,
        "runs": _records(report),
        "series": series,
        "words": list(sentences),
    }
    return json_text(content, endless=null)


def cells(report: Report) -> list[list[str]]:
    """The header and the lines of the table."""
    shown = [key for key in report.keys if key != RESOLUTION]
    question = report.question
    several = len({line.sweep for line in report.series}) > 1
    header = [*(["sweep"] if several else []), *shown, "N", "steps"]
    header += [] if question.cost == "n" else [COSTS[question.cost][1]]
    shows_relaxation = any(row.relaxation for row in report.rows) and question.cost != "n"
    header += [RELAXATION] if shows_relaxation else []
    header += [question.error_name, "energy drift", "against the front"]
    warned = any(row.warnings for row in report.rows)
    header += ["warnings"] if warned else []
    lines = []
    for i, row in enumerate(report.rows):
        line = [row.sweep] if several else []
        line += [*(row.value(key) for key in shown), str(row.n), str(row.steps)]
        line += [] if question.cost == "n" else [f"{report.cost[i]:.3g}"]
        line += [_relaxation_seconds(row)] if shows_relaxation else []
        drift = row.ended["conservation"]["energy_drift_max"]
        against = "front" if report.on_front[i] else f"× {report.excess[i]:.2f}"
        line += [f"{report.error[i]:.3g}", f"{drift:.1e}", against]
        lines.append([*line, ", ".join(row.warnings) or "–"] if warned else line)
    return [header, *lines]


def _relaxation_seconds(row: Row) -> str:
    return f"{row.relaxation['cpu_seconds']:.3g}" if row.relaxation else "–"


def _records(report: Report) -> list[dict]:
    """All figures of every run, also of runs without an error, by column."""
    found = zip(
        report.error.tolist(), report.excess.tolist(), report.on_front.tolist(), strict=True
    )
    compared = [
        _record(report, row) | dict(zip(("error", "excess", "on_front"), one, strict=True))
        for row, one in zip(report.rows, found, strict=True)
    ]
    return [*compared, *(_record(report, row) for row in report.without)]


def _record(report: Report, row: Row) -> dict:
    record: dict[str, Any] = {"sweep": row.sweep} if row.sweep else {}
    record |= {"run": row.name, "status": row.status, "reason": row.reason}
    record |= {key: row.value(key) for key in report.keys}
    if not row.summary:
        return record
    cost = row.summary["cost"]
    record |= {
        "particles": row.n,
        "steps": row.steps,
        "updates": row.cost["updates"],
        "cpu_seconds": row.cost["cpu"],
        "wall_seconds": row.cost["wall"],
        "compile_cpu_seconds": cost["session"]["compile_cpu_seconds"],
        "threads": cost["threads"],
        "warnings": " ".join(row.warnings),
    }
    for name in row.figures():
        if "." in name:
            record[name] = lookup(row.summary, name)
        else:
            record |= {f"{name}_error.{norm}": row.error(name, norm) for norm in NORMS}
    return record
