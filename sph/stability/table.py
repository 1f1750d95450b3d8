"""The result of a search, as text, JSON and CSV."""

import csv
import io
import math
from dataclasses import asdict
from pathlib import Path

from sph.output.files import explained, write_text
from sph.output.json_text import json_text, null
from sph.stability.command import Found

# Steps of a run at the limit, below which a slow instability would not show.
FEW_STEPS = 30

COLUMNS = ("value", "verdict", "error_over_limit", "field", "energy_drift", "time", "steps",
           "cpu_seconds", "name", "reason")  # fmt: skip


def in_words(found: Found) -> str:
    """The ends of the stable range, the margin of the configuration, and what happens beyond."""
    lines = [
        f"{found.config}, {found.scheme}, {found.particles} particles, runs to t = {found.end:g}"
        f"{_what_was_not_run(found)}. A run is stable if {found.judge.in_words()}."
    ]
    for end in found.edges:
        lines.append(_of_an_end(found, end))
        inside = found.edges[end].inside
        if inside is not None:
            lines.append(_length(found, inside))
        if islands := found.islands(end):
            lines.append(
                f"  The range has gaps: stable again at {', '.join(f'{x:g}' for x in islands)}."
            )
    return "\n".join(lines)


def _what_was_not_run(found: Found) -> str:
    if found.end >= found.whole_end:
        return ""
    return f" of time.end = {found.whole_end:g}: later times were not tested"


def _length(found: Found, value: float) -> str:
    """The number of steps of the last stable run, and whether it suffices."""
    steps = found.at(value).steps
    said = f"  The run at {value:g} took {steps} steps"
    if steps >= FEW_STEPS:
        return f"{said}."
    return (
        f"{said}, fewer than the {FEW_STEPS} in which an instability shows. Try: a larger time.end."
    )


def margin(found: Found, end: str) -> float:
    """The last stable value over the configured one; NaN where no value is stable."""
    inside = found.edges[end].inside
    return math.nan if inside is None else inside / found.default


def as_json(found: Found) -> str:
    """All of the result. NaN is null."""
    content = {
        "config": found.config,
        "problem": found.problem,
        "scheme": found.scheme,
        "particles": found.particles,
        "end": found.end,
        "whole_end": found.whole_end,
        "key": found.key,
        "default": found.default,
        "criterion": found.judge.criterion._asdict(),
        "stable": found.judge.in_words(),
        "reference": {
            "name": found.judge.directory.name,
            "largest_errors": found.judge.errors,
            "largest_drift": found.judge.drift,
            "largest_figures": found.judge.figures,
            "figures": found.judge.report,
            "against_exact": found.judge.has_exact,
        },
        "ends": {
            end: {
                "stable": edge.inside,
                "unstable": edge.outside,
                "over_default": margin(found, end),
                "reason": "" if edge.outside is None else found.at(edge.outside).reason,
                "verdict": "" if edge.outside is None else found.at(edge.outside).verdict,
                "stable_again_at": found.islands(end),
            }
            for end, edge in found.edges.items()
        },
        "words": in_words(found),
        "trials": [asdict(trial) for trial in found.trials],
    }
    return json_text(content, endless=null)


def as_csv(found: Found) -> str:
    """A line for each trial, by value."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in found.trials:
        writer.writerow(
            (one.value, one.verdict, one.error, one.field, one.drift, one.time, one.steps, one.cpu,
             one.name, one.reason)
        )  # fmt: skip
    return text.getvalue()


def write(found: Found, directory: Path) -> list[Path]:
    """Write both, named after the key; returns the files. Raises FileError."""
    texts = {"json": as_json(found), "csv": as_csv(found)}
    with explained(f"cannot write to {directory}"):
        for ending, text in texts.items():
            write_text(directory / f"{found.key}.{ending}", text)
    return [directory / f"{found.key}.{ending}" for ending in texts]


def _of_an_end(found: Found, end: str) -> str:
    edge, key = found.edges[end], found.key
    side = "up" if end == "largest" else "down"
    if edge.inside is None:
        reason = found.at(found.default).reason
        return f"{key}: no tried value is stable; at {found.default:g} {reason}."
    if edge.outside is None:
        reached = f"{key}: stable {side} to {edge.inside:g}, {_ratio(found, end)}"
        return f"{reached}; the search ended there."
    trial = found.at(edge.outside)
    return (
        f"{key}: stable {side} to {edge.inside:g}, {_ratio(found, end)}; at {edge.outside:g} "
        f"{'the run fails: ' if trial.verdict == 'failed' else ''}{trial.reason}."
    )


def _ratio(found: Found, end: str) -> str:
    ratio = margin(found, end)
    is_inside = ratio >= 1.0 if end == "largest" else ratio <= 1.0
    said = f"{ratio:.2g} times the configuration's {found.default:g}"
    return said if is_inside else f"{said}: THE CONFIGURATION IS UNSTABLE"
