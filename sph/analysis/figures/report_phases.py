"""Where the CPU time of the runs of a report goes."""

import numpy as np
from matplotlib.figure import Figure

from sph.analysis.figures import style
from sph.analysis.figures.report_labels import short
from sph.analysis.report.compare import Report, Series
from sph.clock import STARTING

MOST_BARS = 24

# Tol's muted scheme, for things that lie next to each other, and two more of his for the switches.
PHASES = ("#332288", "#88CCEE", "#44AA99", "#117733", "#999933", "#DDCC77", "#CC6677", "#882255",
          "#AA4499", "#6699CC", "#661100")  # fmt: skip
OTHER = "0.87"


def phases(report: Report) -> Figure:
    """Shares of the CPU time by phase; of each line's largest run where there are many."""
    labels = {i: label for line in report.series for i, label in _bar_labels(report, line)}
    shown = list(labels)
    if len(shown) > MOST_BARS:
        shown = [line.members[-1] for line in report.series][:MOST_BARS]
    seconds = [_seconds(report.rows[i]) for i in shown]
    names = list(dict.fromkeys(name for one in seconds for name in one if name != "other"))
    colours = {name: PHASES[k % len(PHASES)] for k, name in enumerate(names)} | {"other": OTHER}
    picture = style.new_figure(7.2, 1.4 + 0.27 * len(shown))
    panel = picture.subplots()
    whole, left = np.array([sum(one.values()) for one in seconds]), np.zeros(len(shown))
    for name, colour in colours.items():
        share = 100.0 * np.array([one.get(name, 0.0) for one in seconds]) / whole
        panel.barh(range(len(shown)), share, 0.75, left, color=colour, label=name)
        left += share
    for k, total in enumerate(whole):
        panel.text(101.0, k, f"{total:.3g} s", va="center", fontsize=9)
    panel.set_yticks(range(len(shown)), [labels[i] for i in shown], fontsize=9)
    panel.tick_params(axis="y", length=0)
    panel.set_ylim(len(shown) - 0.4, -0.6)
    panel.set_xlim(0.0, 100.0)
    panel.set_xlabel("share of the CPU time [%]")
    picture.legend(loc="outside lower center", ncols=5, columnspacing=1.2)
    return picture


def _bar_labels(report: Report, line: Series):
    says_it = line.label.startswith(f"{line.sweep} = ")  # the sweep is called as what it varies
    sweep = "" if says_it else line.sweep.replace("_", " ")
    for i in line.members:
        yield i, ", ".join(filter(None, [sweep, short(line.label), f"$N$ = {report.rows[i].n}"]))


def _seconds(row) -> dict[str, float]:
    """CPU seconds of the last session by phase."""
    session = row.ended["cost"]["session"]
    found = {name: s for name, s in session["phases_cpu_seconds"].items() if name != STARTING}
    return found | {"other": max(0.0, session["cpu_seconds"] - sum(found.values()))}
