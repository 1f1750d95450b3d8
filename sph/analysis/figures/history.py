"""What a run kept and what its steps were, from its history."""

import itertools
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sph import meanings
from sph.analysis.figures import style
from sph.columns import shared as shared_columns
from sph.config import Config
from sph.integrators.step_size import CRITERIA
from sph.quantity import TIME

ENERGIES = (
    ("total_energy", "total", "black", "-"),
    ("internal_energy", "internal", style.PALETTE[1], "--"),
    ("kinetic_energy", "kinetic", style.PALETTE[0], "-."),
    ("gravitational_energy", "gravitational", style.PALETTE[2], ":"),
)
LABELS = {"volume_ratio": r"$\sum m/\rho$ over the volume"}
DECADE = 10.0  # a column that spans more is drawn on a logarithmic axis
STYLES = ("-", "--", "-.")
# Momentum that changes by less, in units of the momentum at which all energy would be kinetic, is
# conserved to round-off of sums of many particles, and its panel would show noise.
ROUND_OFF = 1e-12
SMALL_CHANGE = 1e-3  # of a diagnostic, as a part of its first value: only the change is drawn
COLOURS = (*style.PALETTE, "black", "#999999", "#882255", "#44aa99", "#ddcc77")


def figure(
    history: dict[str, np.ndarray],
    title: str,
    theory: dict[str, np.ndarray] | None = None,
    config: Config | None = None,
    mass: float = 0.0,
) -> Figure:
    """Energies, their drift, momentum, steps by what limited them, and the problem's diagnostics.

    `history` is that of `sph.output.history.read`; `theory` has what is said of its columns;
    `config`, that of the run, has its units. Left out are diagnostics that are constant, and
    momentum that `mass`, the total, tells to be conserved to round-off: the title says so, but for
    zeros.
    """
    theory = theory or {}
    momentum = [name for name in history if name.startswith("momentum_")]
    shared = {*shared_columns(len(momentum)), *(name for name, *_ in ENERGIES)}
    further = [name for name in history if name not in shared and np.any(history[name] != 0.0)]
    constant = [name for name in further if name not in theory and _is_constant(history[name])]
    further = [name for name in further if name not in constant]
    change = max(float(np.ptp(history[name])) for name in momentum)
    is_conserved = change < ROUND_OFF * _momentum_scale(history, mass)
    if is_conserved:
        size = f"{style.number(change)} {_unit('momentum_x', config)}".rstrip()
        title += f"\nmomentum is conserved to round-off, within {size}"
    for name in constant:
        value = f"{style.number(history[name][-1])} {_unit(name, config)}".rstrip()
        title += f"\n{_words(name)} is {value} throughout"
    picture, panels = _panels(4 - is_conserved + len(further), title.count("\n"))
    free = iter(panels)
    _energies(next(free), history, theory)
    _drift(next(free), history)
    if not is_conserved:
        _momentum(next(free), history, momentum)
    _steps(next(free), history)
    for panel, name in zip(free, further, strict=True):
        _diagnostic(panel, history, name, theory.get(name))
    if config is not None and config.units.are_given:
        moved = [] if is_conserved else ["momentum_x"]
        _add_units(panels, ["total_energy", "energy_drift", *moved, "dt", *further], config)
    for panel in panels:
        if panel.get_subplotspec().is_last_row():
            panel.set_xlabel(
                style.labelled("time $t$", TIME, config.units) if config else "time $t$"
            )
        panel.margins(x=0.02)
    picture.suptitle(title)
    return picture


def _is_constant(values: np.ndarray) -> bool:
    """Whether values change by round-off at most."""
    return bool(np.ptp(values) <= ROUND_OFF * np.abs(values).max())


def _words(name: str) -> str:
    """What the column of a diagnostic is called."""
    return LABELS.get(name, name.replace("_", " "))


def _unit(name: str, config: Config | None) -> str:
    known = meanings.of_column(config, name) if config else None
    return style.unit_symbol(known.unit, config.units) if known and config else ""


def _add_units(panels, columns: Sequence[str], config: Config) -> None:
    """Add its unit to the vertical axis of each panel. columns: one shown by each."""
    for panel, name in zip(panels, columns, strict=True):
        known = meanings.of_column(config, name)
        if known is not None:
            label = style.labelled(panel.get_ylabel(), known.unit, config.units)
            panel.set_ylabel(style.in_two_lines(label))


def _momentum_scale(history, mass: float) -> float:
    """(2 M E)^1/2 with the largest kinetic and internal energy."""
    energy = np.max(history["kinetic_energy"] + np.maximum(history["internal_energy"], 0.0))
    return float(np.sqrt(2.0 * mass * max(energy, 0.0)))


def _legend_above(panel, **settings) -> None:
    """Where it covers neither data nor, on the left, the power of ten of an axis."""
    panel.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1,
        columnspacing=0.9, handletextpad=0.3, fontsize=9, **settings,
    )  # fmt: skip


def _panels(count: int, lines: int):
    """A figure and `count` panels in rows of two; an odd one at the end is twice as wide.

    lines: of the title, after the first.
    """
    rows = (count + 1) // 2
    picture = style.new_figure(7.2, 2.6 * rows + 0.4 + 0.25 * lines)
    grid = picture.add_gridspec(rows, 2)
    cells = [grid[i // 2, i % 2] for i in range(count)]
    if count % 2:
        cells[-1] = grid[-1, :]
    return picture, [picture.add_subplot(cell) for cell in cells]


def _energies(panel, history, theory) -> None:
    for name, label, colour, dashes in ENERGIES:
        if name in history:
            panel.plot(history["t"], history[name], dashes, color=colour, label=label)
    beside = [theory[name] for name, *_ in ENERGIES if name in theory]
    for values, label in itertools.zip_longest(beside, ["theory"][: len(beside)]):
        panel.plot(history["t"], values, "-", lw=0.6, color="black", label=label)
    panel.set_ylabel("energy $E$")
    _legend_above(panel)


def _drift(panel, history) -> None:
    panel.plot(history["t"], history["energy_drift"], color=style.PALETTE[0])
    panel.set_ylabel("energy drift")


def _momentum(panel, history, names) -> None:
    for name, colour, dashes in zip(names, style.PALETTE, STYLES, strict=False):
        change = history[name] - history[name][0]
        panel.plot(history["t"], change, dashes, color=colour, label=f"${name[-1]}$")
    change = r"$\mathbf{p} - \mathbf{p}_0$" if len(names) > 1 else "$p - p_0$"
    panel.set_ylabel(f"change of momentum {change}")
    if len(names) > 1:
        _legend_above(panel)


def _steps(panel, history) -> None:
    there = set(history["limiter"])
    limiters = (*CRITERIA, *sorted(there.difference(CRITERIA)))  # those of parts after the others
    for limiter, colour in zip(limiters, itertools.cycle(COLOURS), strict=False):
        if limiter not in there:
            continue
        by = history["limiter"] == limiter
        panel.plot(
            history["t"][by], history["dt"][by], ".", ms=3, mew=0, color=colour,
            label=f"by {limiter.replace('_', ' ')}", rasterized=True,
        )  # fmt: skip
    if history["dt"].max() > 10.0 * history["dt"].min():
        panel.set_yscale("log")
    panel.set_ylabel(r"time step $\Delta t$")
    _legend_above(panel, markerscale=3.0)


def _diagnostic(panel, history, name: str, theory: np.ndarray | None) -> None:
    values = history[name]
    panel.set_ylabel(_words(name))
    if np.ptp(values) < SMALL_CHANGE * abs(values[0]):  # the ticks would all begin with its digits
        panel.set_ylabel(f"{_words(name)}\nless {values[0]:.6g}")
        theory = None if theory is None else theory - values[0]
        values = values - values[0]
    panel.plot(history["t"], values, color=style.PALETTE[0], label="this run")
    if theory is not None:
        panel.plot(history["t"], theory, "--", color="black", label="theory")
        _legend_above(panel)
    if np.all(values > 0.0) and values.max() > DECADE * values.min():
        panel.set_yscale("log")
