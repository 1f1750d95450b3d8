"""Pictures of a report: error against cost, error against N, and where the time goes."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from sph.analysis.figures import style
from sph.analysis.figures.report_labels import order, power, short, tick, value_alone
from sph.analysis.figures.report_phases import phases
from sph.analysis.report.compare import COSTS, Report, Series

MARKERS = "osD^vP*X"
FRONT = "0.75"
GUIDE = "0.55"
ORDERS = (1, 2)  # of the guide lines
ABOVE = 1.3  # the guide lines above the nearest point, as a ratio of errors
MOST_ROOM = 4.0  # the same of the frame above the largest error
AROUND = 0.06  # of the height of the frame, between its ends and what is drawn
MANY = 12  # lines of a legend beyond which its letters shrink
MOST_COLUMNS = 3  # of panels
WIDEST_WITHIN = 46  # letters of size 8 that a panel has room for
LEGEND_SHARE = 0.055  # of a panel's height for a line of the legend within it


def draw(report: Report, directory: Path) -> list[Path]:
    """Write the pictures; returns the files. Raises FileError."""
    with style.paper():
        return [
            style.save_png(picture, directory / f"{name}.png", bbox_inches="tight")
            for name, picture in _pictures(report)
        ]


def _pictures(report: Report):
    if report.rows:
        if report.question.cost != "n":
            yield f"error_against_{report.question.cost}", error_against_cost(report)
        yield "error_against_n", error_against_number(report)
        yield "phases", phases(report)


def error_against_cost(report: Report) -> Figure:
    """A line for each setting, the front beneath, and slopes that orders of convergence would have.

    With one step for all, cost ~ N^(1 + 1/D), so error ~ spacing^p ~ cost^(-p/(D + 1)). Several
    sweeps have a panel each, with the front of all.
    """
    what, _, unit = COSTS[report.question.cost]
    dimension = _dimension(report)
    slopes = {}
    if dimension and report.question.cost in ("cpu", "updates"):
        slopes = {p: -p / (dimension + 1) for p in ORDERS}
    label = f"{what} [{unit}]" if unit else what
    return _figure(report, report.cost, label, power, slopes, _front)


def error_against_number(report: Report) -> Figure:
    """The same against the number of particles, with the order that each line has."""
    number = np.array([row.n for row in report.rows], dtype=float)
    dimension = _dimension(report)
    slopes = {p: -p / dimension for p in ORDERS} if dimension else {}
    return _figure(report, number, "$N$", order, slopes)


def _figure(report: Report, x, label: str, note: Callable[[Series], str], slopes, under=None):
    """One panel with its legend below, or a panel for each sweep with legends within."""
    sweeps: dict[str, list[Series]] = {line.sweep: [] for line in report.series}
    for line in report.series:
        sweeps[line.sweep].append(line)
    several = len(sweeps) > 1
    shared = several and _have_same_lines(sweeps.values())
    if shared or (several and note is power):  # no room for power, which says the same as the order
        note = _nothing
    picture, panels = _panels(len(sweeps))
    for panel, lines in zip(panels, sweeps.values(), strict=True):
        if under:
            under(panel, report)
        _lines(panel, report, lines, x, note)
    if several and not shared:
        _room_for_legends(panels, max(map(len, sweeps.values())))
    for panel in panels:
        _guides(panel, x, report.error, slopes)
        _ticks(panel)
        last_row = panel.get_subplotspec().is_last_row()
        first_column = panel.get_subplotspec().is_first_col()
        if not several or last_row or panel in panels[-MOST_COLUMNS:]:
            panel.set_xlabel(label)
            panel.tick_params(labelbottom=True)
        if first_column:
            panel.set_ylabel(_error_label(report))
    if several:
        for panel, name in zip(panels, sweeps, strict=True):
            panel.set_title(name.replace("_", " "))
            if not shared:
                _legend_within(panel)
        picture.suptitle(_title(report))
    else:
        panels[0].set_title(_title(report))
    if shared or not several:
        _legend_below(picture, panels)
    return picture


def _have_same_lines(sweeps: Iterable[list[Series]]) -> bool:
    """Whether the panels can share one legend: their lines have the same labels and colours."""
    return len({tuple((line.label, line.group) for line in lines) for lines in sweeps}) == 1


def _nothing(_line: Series) -> str:
    return ""


def _panels(count: int):
    """A figure and its panels, whose axes are shared: the sweeps are of one problem."""
    columns = 2 if count == 4 else min(count, MOST_COLUMNS)
    rows = -(-count // columns)
    size = (7.2, 4.4) if count == 1 else (3.3 * columns + 0.5, 3.0 * rows + 0.5)
    picture = style.new_figure(*size)
    panels = picture.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for empty in panels[count:]:
        empty.remove()
    panels[0].set_xscale("log")
    panels[0].set_yscale("log")
    return picture, list(panels[:count])


def _error_label(report: Report) -> str:
    question = report.question
    symbol = style.SYMBOLS.get(question.field)
    norm = {"L1": "L_1", "L2": "L_2", "Linf": r"L_\infty"}[question.norm]
    name = question.field.partition(".")[2].replace("_", " ")
    return f"${norm}$ error of {symbol}" if symbol else f"|{style.plain(name)}|"


def _title(report: Report) -> str:
    problems = sorted({row.ended["problem"].replace("_", " ") for row in report.rows})
    dimension = _dimension(report)
    return ", ".join(problems) + (f", {dimension}-D" if dimension else "")


def _lines(panel, report: Report, lines: Sequence[Series], x: np.ndarray, note) -> None:
    groups = list(dict.fromkeys(line.group for line in lines))
    colours = dict(zip(groups, style.colours(len(groups)), strict=True))
    of_group = dict.fromkeys(groups, 0)
    for line in lines:
        which = list(line.members)
        marker = MARKERS[of_group[line.group] % len(MARKERS)]
        of_group[line.group] += 1
        says_it = line.label.startswith(f"{line.sweep} = ")  # the panel is called as what varies
        name = value_alone(line.label) if says_it else line.label
        label = ": ".join(filter(None, [short(name), note(line)]))
        panel.plot(
            x[which], report.error[which], marker + "-", ms=5, mew=0, color=colours[line.group],
            label=label or "all runs", zorder=3,
        )  # fmt: skip
        warned = [i for i in which if report.rows[i].warnings]
        panel.plot(
            x[warned], report.error[warned], marker, ms=5, mew=1.2, mfc="white",
            color=colours[line.group], zorder=4,
        )  # fmt: skip
    if any(row.warnings for row in report.rows):
        panel.plot([], [], "o", ms=5, mew=1.2, mfc="white", color=GUIDE, label="with warnings")


def _front(panel, report: Report) -> None:
    which = np.flatnonzero(report.on_front)
    which = which[np.argsort(report.cost[which])]
    panel.plot(
        report.cost[which], report.error[which], "o-", ms=13, mew=0, lw=7, color=FRONT, alpha=0.6,
        label="Pareto front", zorder=1, solid_joinstyle="round",
    )  # fmt: skip


def _guides(panel, x: np.ndarray, error: np.ndarray, slopes: dict[int, float]) -> None:
    """Dotted lines of those slopes above all that is drawn, so that they cross no curve.

    The steeper line ends at or above the end of the other, so that they do not cross each other.
    """
    if np.unique(x).size < 2 or not slopes:
        return
    levels, reached = {}, 0.0
    for p in sorted(slopes):
        at_end = x.max() ** slopes[p]
        levels[p] = max(ABOVE * (error / x ** slopes[p]).max(), reached / at_end)
        reached = levels[p] * at_end
    highest = max(level * x.min() ** slopes[p] for p, level in levels.items())
    (left, right), (bottom, top) = panel.get_xlim(), panel.get_ylim()
    top = max(top, min(highest, MOST_ROOM * error.max()))
    around = (top / bottom) ** AROUND
    bottom, top = bottom / around, top * around
    panel.set_xlim(left, right)
    panel.set_ylim(bottom, top)
    for p, slope in slopes.items():
        level = levels[p]
        start, end = max(x.min(), (top / level) ** (1.0 / slope)), x.max()
        if start >= end:
            continue
        panel.plot([start, end], level * np.array([start, end]) ** slope, ":", color=GUIDE, lw=1)
        # at the end where the lines are farthest from each other
        panel.annotate(
            f"order {p}", (start, level * start**slope), color=GUIDE, fontsize=9, xytext=(4, 1),
            textcoords="offset points",
        )  # fmt: skip


def _room_for_legends(panels, most_lines: int) -> None:
    """Space below the lines: errors fall from left to right, so the lower left is nearly free."""
    bottom, top = panels[0].get_ylim()
    share = LEGEND_SHARE * (most_lines + 1)
    panels[0].set_ylim(bottom * (bottom / top) ** (0.6 * share / (1.0 - share)), top)


def _ticks(panel) -> None:
    """Ticks that can be read also within a decade."""
    for axis, (low, high) in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
        within = (1.5, 2.0, 3.0, 5.0, 7.0) if high < 10.0 * low else (2.0, 5.0)
        axis.set_minor_locator(LogLocator(subs=within if high < 200.0 * low else "auto"))
        axis.set_minor_formatter(tick if high < 200.0 * low else NullFormatter())
        axis.set_major_formatter(tick)


def _legend_within(panel) -> None:
    widest = max(map(_letters, panel.get_legend_handles_labels()[1]))
    fontsize = 8 * min(1.0, WIDEST_WITHIN / widest)
    panel.legend(loc="lower left", fontsize=fontsize, markerscale=0.8, borderaxespad=0.3)


def _letters(label: str) -> int:
    """Letters that are seen, roughly: a command of mathematics shows as one."""
    return len(re.sub(r"\\\w+", "x", re.sub(r"[${}^]", "", label)))


def _legend_below(picture: Figure, panels) -> None:
    """One legend for all panels."""
    shown: dict[str, Any] = {}
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        shown |= {label: handle for handle, label in zip(handles, labels, strict=True)}
    columns = 2 if max(map(_letters, shown)) < 55 and len(shown) > 2 else 1
    picture.set_figheight(picture.get_figheight() + 0.22 * math.ceil(len(shown) / columns))
    picture.legend(
        list(shown.values()), list(shown), loc="outside lower center", ncols=columns,
        markerscale=0.7,
        fontsize=10 if len(shown) <= MANY else 8,
    )  # fmt: skip


def _dimension(report: Report) -> int | None:
    """That of all runs, or None where they differ."""
    found = {row.ended["dimension"] for row in report.rows}
    return found.pop() if len(found) == 1 else None
