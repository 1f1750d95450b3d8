"""Table, picture and closing words of peers.py, from the rows of its runs."""

import json
import os
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

FIELDS = ("density", "velocity", "pressure")
OWN = "sph"
RATIOS = "| problem | code | particles | at equal L1 of density | of velocity | of pressure |"
AIM = 10.0  # times less CPU time at the same error
HEAD = (
    "| problem | code | particles | steps | CPU s | whole process "
    "| L1 density | velocity | pressure | energy |"
)
# One look for a scheme in all panels.
LOOKS = {
    OWN: ("#c0392b", "o"),
    "PySPH adke": ("#1f4e79", "s"),
    "PySPH mpm": ("#2e8b57", "D"),
    "PySPH gsph": ("#8e6bbf", "^"),
    "PySPH tsph": ("#b8860b", "v"),
    "PySPH crksph": ("#17869e", "P"),
}
OTHER = ("#555555", "X")


def write(rows: list[dict], directory: Path):
    """peers.json, peers.md and peers.png in the directory."""
    (directory / "peers.json").write_text(json.dumps(rows, indent=1))
    table = "\n".join([HEAD, "|---" * 10 + "|", *map(line, rows)])
    (directory / "peers.md").write_text(f"{table}\n\n{verdict(rows)}\n")
    picture(rows, directory / "peers.png")


def line(row: dict) -> str:
    """One line of the table; energy is that of the last state over that of the first, minus 1."""
    start = f"| {row['case']} | {row['code']} | {row['n']} |"
    if row["failure"]:
        energy = row.get("energy_ratio")
        times = f"; energy × {energy:.3g}" if energy and np.isfinite(energy) else ""
        return f"{start} **{row['failure']}**{times} | | | | | | |"
    figures = " | ".join(f"{row['L1'][field]:.3g}" for field in FIELDS)
    cost = f"{row['steps']} | {row['cpu_seconds']:.2f} | {row['process_seconds']:.1f}"
    return f"{start} {cost} | {figures} | {row['energy_ratio'] - 1.0:+.1e} |"


def verdict(rows: list[dict]) -> str:
    """How many times our CPU time every run of PySPH takes at the same L1 of each field; the aim.

    As a table and a sentence a field. A bound where our coarsest run is more accurate already.
    """
    lines, short = [], {field: [] for field in FIELDS}
    for row in rows:
        own = [one for one in _ended(rows, row["case"]) if one["code"] == OWN]
        if row["code"] == OWN or row["failure"] or not own:
            continue
        found = [ratio_to(row, own, field) for field in FIELDS]
        cells = " | ".join(_times(*one) for one in found)
        lines.append(f"| {row['case']} | {row['code']} | {row['n']} | {cells} |")
        for field, (ratio, _) in zip(FIELDS, found, strict=True):
            if ratio < AIM:
                short[field].append(f"{row['case']}, {row['code']}, {row['n']}")
    if not lines:
        return ""
    return "\n".join([RATIOS, "|---" * 6 + "|", *lines, "", *_aim(short, len(lines))])


def _aim(short: dict[str, list[str]], runs: int) -> list[str]:
    said = []
    for field, names in short.items():
        missing = f", not by {'; '.join(names)}" if names else ""
        text = f"- {AIM:g} times less CPU time at the same L1 of {field}: met by"
        said.append(f"{text} {runs - len(names)} of {runs} runs of PySPH{missing}.")
    return said


def ratio_to(row: dict, own: list[dict], field: str) -> tuple[float, str]:
    """CPU seconds of a run over ours at its error, 0 where it is never reached; as `cost_at`."""
    ours, known = cost_at(own, row["L1"][field], field)
    return (row["cpu_seconds"] / ours if ours else 0.0), known


def _times(ratio: float, known: str) -> str:
    if known == "more":
        return "not reached"
    return f"{'≥ ' if known == 'less' else ''}{ratio:.2g}"


def cost_at(own: list[dict], error: float, field: str) -> tuple[float, str]:
    """CPU seconds at which our runs reach that error, between two runs along a power law.

    With "equal", or "less" where even the coarsest run has a smaller error and its cost is given,
    or "more" where none has.
    """
    runs = sorted(own, key=lambda row: row["cpu_seconds"])
    errors = np.array([row["L1"][field] for row in runs])
    costs = np.array([row["cpu_seconds"] for row in runs])
    if errors[0] <= error:
        return costs[0], "less"
    reached = np.flatnonzero(errors <= error)
    if not reached.size:
        return 0.0, "more"
    last = int(reached[0])
    pair = slice(last - 1, last + 1)
    along = np.log(errors[last - 1] / error) / np.log(errors[last - 1] / errors[last])
    return float(costs[last - 1] * (costs[pair][1] / costs[pair][0]) ** along), "equal"


def picture(rows: list[dict], path: Path, field: str = "density"):
    """L1 of `field` against CPU seconds, a panel a problem."""
    cases = [case for case in dict.fromkeys(row["case"] for row in rows) if _ended(rows, case)]
    if not cases:
        return
    across = min(2, len(cases))
    down = -(-len(cases) // across)
    figure, axes = plt.subplots(
        down, across, figsize=(4.6 * across, 3.7 * down), squeeze=False, layout="constrained"
    )
    for axis in axes.flat[len(cases) :]:
        axis.remove()
    for axis, case in zip(axes.flat, cases, strict=False):
        _panel(axis, case, [row for row in rows if row["case"] == case], field)
    figure.suptitle(
        "Error against CPU time: this program (sph) and PySPH from the same particles,\n"
        f"one thread each, on a shared machine ({os.cpu_count()} cores); compilation not counted",
        fontsize=10,
    )
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _panel(axis, case, rows, field):
    failures = []
    for code in dict.fromkeys(row["code"] for row in rows):
        runs = [row for row in _ended(rows, case) if row["code"] == code]
        if not runs:
            failures.append(f"\n{code}: {rows_failure(rows, code)}")
            continue
        colour, marker = LOOKS.get(code, OTHER)
        cost = [row["cpu_seconds"] for row in runs]
        error = [row["L1"][field] for row in runs]
        axis.loglog(cost, error, marker=marker, color=colour, label=code, lw=1.6, ms=6)
        for row in runs if code == OWN else runs[-1:]:
            place = (row["cpu_seconds"], row["L1"][field])
            offset = (-4, -12) if code == OWN else (5, 5)
            axis.annotate(
                f"{row['n']}",
                place,
                offset,
                textcoords="offset points",
                fontsize=7,
                color=colour,
                ha="right" if code == OWN else "left",
            )
    axis.set_title(case, fontsize=11)
    axis.set_xlabel("CPU seconds" + "".join(failures))
    axis.set_ylabel(f"L1 error of {field}")
    axis.margins(0.15)
    axis.yaxis.set_major_formatter(matplotlib.ticker.LogFormatter(minor_thresholds=(2, 1)))
    axis.yaxis.set_minor_formatter(matplotlib.ticker.LogFormatter(minor_thresholds=(2, 1)))
    axis.tick_params(which="both", labelsize=8)
    axis.grid(which="both", alpha=0.2)
    axis.legend(fontsize=8, frameon=False)


def rows_failure(rows: list[dict], code: str) -> str:
    return next(row["failure"] for row in rows if row["code"] == code)


def _ended(rows: list[dict], case: str) -> list[dict]:
    return [row for row in rows if row["case"] == case and not row["failure"]]
