"""Pictures of a report: error against cost, error against N, and where the time goes."""

import math
import re
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from sph.analysis.figures import style
from sph.analysis.report.compare import COSTS, Report, Series
from sph.analysis.report.runs import STARTING
from sph.output.files import replacing

MARKERS = "osD^vP*X"
FRONT = "0.75"
GUIDE = "0.55"
ORDERS = (1, 2)  # of the guide lines
MOST_BARS = 24
MANY = 12  # lines of a legend beyond which its letters shrink

# Tol's muted scheme, for things that lie next to each other.
PHASES = ("#332288", "#88CCEE", "#44AA99", "#117733", "#999933", "#DDCC77", "#CC6677", "#882255",
          "#AA4499")  # fmt: skip
OTHER = "0.87"

SHORT = {"alpha": r"$\alpha$", "eta": r"$\eta$", "gamma": r"$\gamma$", "C": "$C$", "n": "$N$"}


def draw(report: Report, directory: Path) -> list[Path]:
    """Write the pictures; returns the files. Raises FileError."""
    with style.paper():
        return [_save(picture, directory / f"{name}.png") for name, picture in _pictures(report)]


def _pictures(report: Report):
    if report.rows:
        if report.question.cost != "n":
            yield f"error_against_{report.question.cost}", error_against_cost(report)
        yield "error_against_n", error_against_number(report)
        yield "phases", phases(report)


def error_against_cost(report: Report) -> Figure:
    """A line for each setting, the front beneath, and slopes that orders of convergence would have.

    With one step for all, cost ~ N^(1 + 1/D), so error ~ spacing^p ~ cost^(-p/(D + 1)).
    """
    picture, panel = _panel(report)
    what, _, unit = COSTS[report.question.cost]
    _front(panel, report)
    _lines(panel, report, report.cost, lambda line: _power(line.exponent))
    dimension = _dimension(report)
    if dimension and report.question.cost in ("cpu", "updates"):
        _guides(panel, report.cost, {p: -p / (dimension + 1) for p in ORDERS})
    panel.set_xlabel(f"{what} [{unit}]" if unit else what)
    _finish(picture, panel)
    return picture


def error_against_number(report: Report) -> Figure:
    """The same against the number of particles, with the order that each line has."""
    picture, panel = _panel(report)
    number = np.array([row.n for row in report.rows], dtype=float)
    _lines(panel, report, number, _order)
    if dimension := _dimension(report):
        _guides(panel, number, {p: -p / dimension for p in ORDERS})
    panel.set_xlabel("$N$")
    _finish(picture, panel)
    return picture


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


def _panel(report: Report):
    picture = style.new_figure(7.2, 4.4)
    panel = picture.subplots()
    panel.set_xscale("log")
    panel.set_yscale("log")
    question = report.question
    symbol = style.SYMBOLS.get(question.field)
    norm = {"L1": "L_1", "L2": "L_2", "Linf": r"L_\infty"}[question.norm]
    name = question.field.partition(".")[2].replace("_", " ")
    panel.set_ylabel(f"${norm}$ error of {symbol}" if symbol else f"|{style.plain(name)}|")
    problems = sorted({row.summary["problem"].replace("_", " ") for row in report.rows})
    dimension = _dimension(report)
    panel.set_title(", ".join(problems) + (f", {dimension}-D" if dimension else ""))
    return picture, panel


def _lines(panel, report: Report, x: np.ndarray, note) -> None:
    groups = list(dict.fromkeys(line.group for line in report.series))
    colours = dict(zip(groups, style.colours(len(groups)), strict=True))
    of_group = dict.fromkeys(groups, 0)
    for line in report.series:
        which = list(line.members)
        marker = MARKERS[of_group[line.group] % len(MARKERS)]
        of_group[line.group] += 1
        label = ": ".join(filter(None, [_short(line.label), note(line)]))
        panel.plot(
            x[which], report.error[which], marker + "-", ms=5, mew=0, color=colours[line.group],
            label=label or "all runs", zorder=3,
        )  # fmt: skip


def _front(panel, report: Report) -> None:
    which = np.flatnonzero(report.on_front)
    which = which[np.argsort(report.cost[which])]
    panel.plot(
        report.cost[which], report.error[which], "o-", ms=13, mew=0, lw=7, color=FRONT, alpha=0.6,
        label="Pareto front", zorder=1, solid_joinstyle="round",
    )  # fmt: skip


def _guides(panel, x: np.ndarray, slopes: dict[int, float]) -> None:
    """Dotted lines of those slopes down from the upper left corner, within what is drawn."""
    if np.unique(x).size < 2:
        return
    (left, right), (bottom, top) = panel.get_xlim(), panel.get_ylim()
    panel.set_xlim(left, right)
    panel.set_ylim(bottom, top)
    for order, slope in slopes.items():
        end = min(right, left * (bottom / top) ** (1.0 / slope))
        panel.plot(
            [left, end], [top, top * (end / left) ** slope], ":", color=GUIDE, lw=1, zorder=0
        )
        # in the middle of its visible part, on the line
        at = np.sqrt(left * end)
        panel.annotate(
            f"order {order}", (at, top * (at / left) ** slope), color=GUIDE, fontsize=9,
            xytext=(3, 2), textcoords="offset points", zorder=2,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.3},
        )  # fmt: skip


def _finish(picture: Figure, panel) -> None:
    """Ticks that can be read also within a decade, and the legend below."""
    for axis, (low, high) in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
        axis.set_minor_locator(LogLocator(subs=(2.0, 5.0) if high < 200.0 * low else "auto"))
        axis.set_minor_formatter(_tick if high < 200.0 * low else NullFormatter())
        axis.set_major_formatter(_tick)
    handles, labels = panel.get_legend_handles_labels()
    # letters that are seen, roughly: a command of mathematics shows as one
    widest = max(len(re.sub(r"\\\w+", "x", re.sub(r"[${}^]", "", one))) for one in labels)
    columns = 2 if widest < 55 and len(labels) > 2 else 1
    picture.set_figheight(4.4 + 0.22 * math.ceil(len(labels) / columns))
    picture.legend(
        handles, labels, loc="outside lower center", ncols=columns, markerscale=0.7,
        fontsize=10 if len(labels) <= MANY else 8,
    )  # fmt: skip


def _tick(value: float, _position=None) -> str:
    if 1e-3 <= value < 1e4:
        return f"{value:g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    power = f"10^{{{int(exponent)}}}"
    return f"${power}$" if mantissa == "1" else rf"${mantissa}\times {power}$"


def _power(exponent: float | None) -> str:
    return "" if exponent is None else rf"error $\propto$ cost$^{{{exponent:.2f}}}$"


def _order(line: Series) -> str:
    return "" if line.order is None else f"order {line.order:.2f}"


def _short(label: str) -> str:
    """A label with symbols for keys that have one: alpha = 1.0 is α = 1.0."""
    found = re.sub(r"(^|, )(\w+)(?= = )", lambda key: key[1] + SHORT.get(key[2], key[2]), label)
    return found.replace("_", " ")


def _bar_labels(report: Report, line: Series):
    for i in line.members:
        yield i, ", ".join(filter(None, [_short(line.label), f"$N$ = {report.rows[i].n}"]))


def _seconds(row) -> dict[str, float]:
    """CPU seconds of the last session by phase, without compiling and starting."""
    session = row.summary["cost"]["session"]
    found = {name: s for name, s in session["phases_cpu_seconds"].items() if name != STARTING}
    apart = session["compile_cpu_seconds"] + session["phases_cpu_seconds"].get(STARTING, 0.0)
    return found | {"other": max(0.0, session["cpu_seconds"] - apart - sum(found.values()))}


def _dimension(report: Report) -> int | None:
    """That of all runs, or None where they differ."""
    found = {row.summary["dimension"] for row in report.rows}
    return found.pop() if len(found) == 1 else None


def _save(figure: Figure, path: Path) -> Path:
    with replacing(path) as unfinished:
        figure.savefig(unfinished, format="png", bbox_inches="tight")
    return path
