"""Profiles of density, velocity, pressure or stress, and energy, along x or the radius."""

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from sph.analysis import truth
from sph.analysis.figures import style
from sph.analysis.figures.sources import State

EXACT_POINTS = 2000
LONGEST_TITLE = 90  # letters in a line
MOST_BINS = 100
# A vector file with more dots than this is slow to open, so they become pixels in it.
MOST_VECTOR_DOTS = 2000


class Profile(NamedTuple):
    """One state as a function of one coordinate; velocities are the component along it."""

    symbol: str  # of the coordinate: x or r
    coordinate: np.ndarray  # (M,) of the particles in the region over which errors are taken
    fields: dict[str, np.ndarray]  # (M,) each
    exact_coordinate: np.ndarray
    exact: dict[str, np.ndarray]  # empty where there is none
    is_scattered: bool  # in 2 and 3-D, where many particles share a coordinate


def profile(state: State) -> Profile:
    """The particles of the problem's error region, and the exact solution there."""
    particles, problem = state.particles, state.problem
    inside, _ = problem.error_region(state.eos, state.time, particles.position)
    if not inside.any():
        inside[:] = True
    position, velocity = particles.position[:, inside], particles.velocity[:, inside]
    if state.is_radial:
        offset = position - problem.centre[:, None]
        coordinate = np.linalg.norm(offset, axis=0)
        along = (velocity * offset).sum(axis=0) / np.where(coordinate > 0.0, coordinate, 1.0)
    else:
        coordinate, along = position[0], velocity[0]
    scalars = {name: state.scalar(name)[inside] for name in problem.profiles if name != "velocity"}
    end = coordinate.max()
    # not at r = 0 itself, where an exact blast has no gas
    start = end / EXACT_POINTS if state.is_radial else coordinate.min()
    at = np.linspace(start, end, EXACT_POINTS)
    return Profile(
        "r" if state.is_radial else "x",
        coordinate,
        scalars | {"velocity": along},
        at,
        _exact_along(state, at),
        is_scattered=state.dimension > 1,
    )


def _exact_along(state: State, at: np.ndarray) -> dict[str, np.ndarray]:
    """On a line along x through the centre of the box, where `at` is x or the radius.

    NaN where waves from the ends of the domain have come, and the solution does not hold.
    """
    if state.left_out:
        return {}
    position = np.repeat(state.problem.centre[:, None], at.size, axis=1)
    position[0] = position[0] + at if state.is_radial else at
    exact = state.exact(position) or {}
    holds = truth.within(state.problem, state.eos, state.time, position)
    fields = exact | {"velocity": exact["velocity"][0]}
    return {name: np.where(holds, values, np.nan) for name, values in fields.items()}


def _without_exact(states: Sequence[State]) -> str:
    """Lines for a title that say why an exact solution that the problem has is not drawn."""
    reasons = {state.left_out for state in states if state.may_have_exact and state.left_out}
    which = "" if len(states) == 1 else "in part "
    return "".join(
        "\n" + textwrap.fill(f"{which}without the exact solution: {reason}", LONGEST_TITLE)
        for reason in sorted(reasons)[:1]
    )


def single(state: State) -> Figure:
    """One state: particles, exact solution, error of each field."""
    label = "SPH" if state.dimension == 1 else "SPH: median, 5 % to 95 %, and all particles in grey"
    title = f"{state.title}, {state.when}"
    return _figure([state], [label], style.colours(1), title, note_errors=True)


def compared(states: Sequence[State], labels: Sequence[str]) -> Figure:
    """Several runs over each other, told apart by colour."""
    labels = [style.plain(label) for label in labels]
    times = {state.when for state in states}
    title = sorted({state.name for state in states})
    if len(times) > 1:
        labels = [f"{label}, {state.when}" for label, state in zip(labels, states, strict=True)]
    else:
        title += times
    return _figure(states, labels, style.colours(len(states)), ", ".join(title), note_errors=True)


def over_time(states: Sequence[State]) -> Figure:
    """One run at several times, from dark to light."""
    labels = [state.when for state in states]
    colours = style.sequence(len(states))
    return _figure(states, labels, colours, states[-1].title, note_errors=False)


def _figure(states, labels, colours, title, note_errors: bool) -> Figure:
    figure = style.new_figure(7.2, 5.8)
    names = states[0].problem.profiles
    panels = dict(zip(names, figure.subplots(2, 2, sharex=True).flat, strict=True))
    profiles, alone = [profile(state) for state in states], len(states) == 1
    errors = [state.errors() if note_errors else {} for state in states]
    for name, panel in panels.items():
        _set_scale(panel, profiles, name)
        panel.set_ylabel(states[0].labelled(style.SYMBOLS[name], name))
        drawn = [
            _particles(panel, one, name, colour, alone)
            for one, colour in zip(profiles, colours, strict=True)
        ]
        exact = [_exact(panel, one, name, alone) for one in profiles if name in one.exact]
        _note(panel, name, drawn, errors)
    for panel in list(panels.values())[2:]:
        symbol = profiles[0].symbol
        panel.set_xlabel(states[0].labelled(f"${symbol}$", symbol))
    figure.suptitle(title + _without_exact(states))
    entries = [
        *zip(drawn, labels, strict=True),
        *((line, states[0].problem.truth[1]) for line in exact[:1]),
    ]
    figure.legend(
        *zip(*entries, strict=True), loc="outside lower center", markerscale=2.0,
        ncols=7 if max(map(len, labels)) < 15 else 2, columnspacing=1.4, handletextpad=0.4,
    )  # fmt: skip
    return figure


def _set_scale(panel, profiles: Sequence[Profile], name: str) -> None:
    """Limits; logarithmic where a peak would press all the rest to the floor."""
    values = np.concatenate([one.fields[name] for one in profiles])
    exact = np.concatenate([one.exact.get(name, values[:0]) for one in profiles])
    panel.margins(x=0.02)
    if values.min() > 0.0 and values.max() > 100.0 * np.median(values):
        # the exact blast is infinitely hot at its centre: the particles set the limits
        panel.set_yscale("log")
        panel.set_ylim(values.min() / 3.0, values.max() * 3.0)
        return
    values = np.concatenate([values, exact[np.isfinite(exact)]])
    low, high = values.min(), values.max()
    # what is uniform is shown as a line, not as its round-off
    margin = max(0.06 * (high - low), 1e-3 * max(abs(low), abs(high))) or 1.0
    panel.set_ylim(low - margin, high + margin)


def _particles(panel, one: Profile, name: str, colour, alone: bool):
    """Draw the particles' `name`; returns what stands for them in a legend."""
    values = one.fields[name]
    if not one.is_scattered:
        (dots,) = panel.plot(
            one.coordinate, values, ".", ms=3.5, mew=0, color=colour,
            rasterized=values.size > MOST_VECTOR_DOTS,
        )  # fmt: skip
        return dots
    if alone:
        _cloud(panel, one.coordinate, values)
    middle, (low, median, high) = binned(one.coordinate, values)
    panel.fill_between(middle, low, high, color=colour, alpha=0.3, lw=0)
    (line,) = panel.plot(middle, median, ".-", ms=3.5, mew=0, lw=0.8, color=colour)
    return line


def _cloud(panel, coordinate, values) -> None:
    """All particles as grey cells by their number: readable for a million."""
    low, high = panel.get_ylim()
    is_log = panel.get_yscale() == "log"
    if is_log:
        low, high = np.log10([low, high])
    panel.hexbin(
        coordinate, values, gridsize=(120, 60), mincnt=1, bins="log", cmap="Greys", vmin=0.2,
        extent=(coordinate.min(), coordinate.max(), low, high),
        yscale="log" if is_log else "linear", linewidths=0.1, alpha=0.6, zorder=0, rasterized=True,
    )  # fmt: skip


def _exact(panel, one: Profile, name: str, alone: bool):
    # over one run's particles, but under those of several, which would vanish behind the lines
    width, order = (0.9, 2.5) if alone else (0.6, 1.0)
    (line,) = panel.plot(
        one.exact_coordinate, one.exact[name], "-", lw=width, color=style.EXACT, zorder=order
    )
    return line


def _note(panel, name: str, drawn, errors) -> None:
    """The error beside the mark of each state that has one."""
    noted = [
        (mark, rf"$L_1$ = {style.number(error[name])}")
        for mark, error in zip(drawn, errors, strict=True)
        if name in error
    ]
    if noted:
        panel.legend(*zip(*noted, strict=True), loc="best", markerscale=2.0, handletextpad=0.4)


def binned(coordinate: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean coordinate (B,) and 5th, 50th and 95th percentile (3, B) in bins of equal width.

    Bins without particles are left out.
    """
    count = int(np.clip(np.sqrt(coordinate.size), 1, MOST_BINS))
    edges = np.linspace(coordinate.min(), coordinate.max(), count + 1)
    bins = np.clip(np.searchsorted(edges, coordinate, side="right") - 1, 0, count - 1)
    order = np.argsort(bins, kind="stable")
    members = np.split(order, np.searchsorted(bins[order], np.arange(1, count)))
    members = [which for which in members if which.size]
    middle = np.array([coordinate[which].mean() for which in members])
    return middle, np.array([np.percentile(values[which], [5, 50, 95]) for which in members]).T
