"""Profiles of the four fields that a problem names, along x or the radius."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from sph.analysis.figures import style
from sph.analysis.figures.profile import (
    SMALL_SIGNAL,
    Profile,
    has_small_signal,
    profile,
    without_exact,
)
from sph.analysis.figures.profile_axes import MovieAxes, axis_of_profiles
from sph.analysis.figures.sources import State

MOST_BINS = 100
# A vector file with more dots than this is slow to open, so they become pixels in it.
MOST_VECTOR_DOTS = 2000


def single(state: State) -> Figure:
    """One state: particles, exact solution, error of each field."""
    label = "SPH" if state.dimension == 1 else "SPH: median, 5 % to 95 %, and all particles in grey"
    title = f"{state.title}, {state.when}"
    return _of_runs([state], [label], title)


def compared(states: Sequence[State], labels: Sequence[str]) -> Figure:
    """Several runs over each other, told apart by colour."""
    labels = [style.plain(label) for label in labels]
    times = {state.when for state in states}
    title = sorted({state.name for state in states})
    if len(times) > 1:
        labels = [f"{label}, {state.when}" for label, state in zip(labels, states, strict=True)]
    else:
        title += times
    return _of_runs(states, labels, ", ".join(title))


def over_time(states: Iterable[State]) -> Figure:
    """One run at several times, from dark to light; read one by one, they need little memory."""
    profiles, labels, left_out = [], [], []
    for state in states:
        profiles.append(profile(state))
        labels.append(state.when)
        left_out.append(state.left_out if state.may_have_exact else None)
    return _figure(
        profiles, labels, style.sequence(len(labels)), state.title + without_exact(left_out),
        state, [{}] * len(labels),
    )  # fmt: skip


def frame(state: State, axes: MovieAxes) -> Figure:
    """One state of a movie, with the axes of all its frames."""
    reason = without_exact([state.left_out if state.may_have_exact else None])
    # empty lines keep the panels of all frames in one place
    filled = reason + "\n" * (axes.reason_lines - reason.count("\n"))
    title = f"{state.title}, {state.when}{filled}"
    return _figure(
        [profile(state)], ["SPH"], style.colours(1), title, state, [state.errors()], axes
    )


def _of_runs(states: Sequence[State], labels, title: str) -> Figure:
    left_out = [state.left_out if state.may_have_exact else None for state in states]
    return _figure(
        [profile(state) for state in states], labels, style.colours(len(states)),
        title + without_exact(left_out), states[0], [state.errors() for state in states],
    )  # fmt: skip


def _figure(
    profiles: Sequence[Profile], labels, colours, title: str, state, errors,
    axes: MovieAxes | None = None,
) -> Figure:  # fmt: skip
    """A panel for each of the problem's four fields; `errors` by field, one a profile.

    state: one of those drawn, which has the problem and the units; axes: those of a movie.
    """
    figure = style.new_figure(7.2, 5.8)
    panels = dict(zip(state.problem.profiles, figure.subplots(2, 2, sharex=True).flat, strict=True))
    alone, exact = len(profiles) == 1, []
    in_order = style.sequence(len(profiles)) == colours
    for name, panel in panels.items():
        shown, label = list(profiles), style.label(name)
        is_small = name in axes.less_mean if axes else has_small_signal(profiles, name)
        if is_small:
            shown, label = (
                [one.less_means(name) for one in profiles],
                f"{style.SYMBOLS[name]} less its mean",
            )
        panel.set_ylabel(style.in_two_lines(state.labelled(label, name)))
        panel.margins(x=0.02)
        (axes.fields[name] if axes else axis_of_profiles(shown, name)).apply(panel)
        drawn = [
            _particles(panel, one, name, colour, alone)
            for one, colour in zip(shown, colours, strict=True)
        ]
        exact += [
            _exact(panel, one, name, alone, _darker(colour) if in_order else style.EXACT)
            for one, colour in zip(shown, colours, strict=True)
            if name in one.exact
        ]
        notes = _notes(name, drawn, errors, profiles if is_small else [])
        if axes:  # above the panel, where a note cannot move from frame to frame
            panel.set_xlim(axes.coordinate)
            panel.set_title(notes[0][1].replace("\n", ", ") if notes else " ", loc="right")
        elif notes:
            panel.legend(*zip(*notes, strict=True), loc="best", markerscale=2.0, handletextpad=0.4)
    for panel in list(panels.values())[2:]:
        symbol = profiles[0].symbol
        panel.set_xlabel(state.labelled(style.AXES[symbol], symbol))
    figure.suptitle(title)
    truth = state.problem.truth[1]
    entries = [*zip(drawn, labels, strict=True), *((line, truth) for line in exact[:1])]
    figure.legend(
        *zip(*entries, strict=True), loc="outside lower center", markerscale=2.0,
        ncols=7 if max(map(style.letters, labels)) < 15 else 2, columnspacing=1.4,
        handletextpad=0.4,
    )  # fmt: skip
    return figure


def _darker(colour) -> tuple[float, ...]:
    """For a line over dots of that colour."""
    return tuple(0.6 * part for part in to_rgb(colour))


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


def _exact(panel, one: Profile, name: str, alone: bool, colour):
    # over one run's particles, but under those of several, which would vanish behind the lines
    width, order = (0.9, 2.5) if alone else (0.6, 1.0)
    (line,) = panel.plot(
        one.exact_coordinate, one.exact[name], "-", lw=width, color=colour, zorder=order
    )
    return line


def _notes(name: str, drawn, errors, off_mean: Sequence[Profile]) -> list[tuple]:
    """Mark and error of each state that has one; for `off_mean` the error of the mean too."""
    noted = [
        (mark, rf"$L_1$ = {style.number(error[name])}")
        for mark, error in zip(drawn, errors, strict=True)
        if name in error
    ]
    for k, one in enumerate(off_mean[: len(noted)]):
        mean, exact = one.means(name)
        if abs(off := mean / exact - 1.0) > SMALL_SIGNAL[0]:
            noted[k] = noted[k][0], f"{noted[k][1]}\nmean {100.0 * off:+.2g} %"
    return noted


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
