"""Vertical axes of profiles, for one picture or all frames of a movie."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from sph.analysis.figures.profile import Profile, has_small_signal, profile, without_exact
from sph.analysis.figures.sources import State

# Quantiles that stand for the values of a frame of a movie: its extremes and, closely enough for
# the choice of a scale, its median and shares.
QUANTILES = np.linspace(0.0, 1.0, 201)


class Axis(NamedTuple):
    """Limits of a vertical axis."""

    low: float
    high: float
    is_log: bool

    def apply(self, panel) -> None:
        """Set the limits of a panel."""
        if self.is_log:
            panel.set_yscale("log")
        panel.set_ylim(self.low, self.high)


class MovieAxes(NamedTuple):
    """What all frames of a movie share."""

    coordinate: tuple[float, float]
    fields: dict[str, Axis]
    less_mean: frozenset[str]  # fields drawn as deviations from their mean
    reason_lines: int  # most lines that say why a frame lacks the exact solution


def axis_of(values: np.ndarray, exact: np.ndarray) -> Axis:
    """Limits; logarithmic where a peak or a large step would press all the rest to the floor."""
    if values.min() > 0.0 and _spans_decades(values):
        # the exact blast is infinitely hot at its centre: the particles set the limits
        return Axis(values.min() / 3.0, values.max() * 3.0, True)
    values = np.concatenate([values, exact[np.isfinite(exact)]])
    low, high = values.min(), values.max()
    # what is uniform is shown as a line, not as its round-off
    margin = max(0.06 * (high - low), 1e-3 * max(abs(low), abs(high))) or 1.0
    return Axis(low - margin, high + margin, False)


def axis_of_profiles(profiles: Sequence[Profile], name: str) -> Axis:
    """The axis of a panel that shows one field of these profiles."""
    values = np.concatenate([one.fields[name] for one in profiles])
    return axis_of(values, np.concatenate([one.exact.get(name, values[:0]) for one in profiles]))


def of_movie(states: Iterable[State]) -> MovieAxes:
    """The axes of all frames, which are read one by one."""
    ends, plain, deviations, is_small, reason_lines = [], [], [], [], 0
    for state in states:
        one, names = profile(state), state.problem.profiles
        small = {name for name in names if has_small_signal([one], name)}
        ends += [one.coordinate.min(), one.coordinate.max()]
        plain.append({name: _extract(one, name) for name in names})
        deviations.append({name: _extract(one.less_means(name), name) for name in small})
        is_small.append(small)
        reason = without_exact([state.left_out if state.may_have_exact else None])
        reason_lines = max(reason_lines, reason.count("\n"))
    less_mean = frozenset.intersection(*map(frozenset, is_small))
    fields = {
        name: axis_of(*map(np.concatenate, zip(*chosen, strict=True)))
        for name in plain[0]
        for chosen in [[one[name] for one in (deviations if name in less_mean else plain)]]
    }
    margin = 0.02 * (max(ends) - min(ends))
    return MovieAxes((min(ends) - margin, max(ends) + margin), fields, less_mean, reason_lines)


def _extract(one: Profile, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Values of a field and of its exact solution that stand for all."""
    values, exact = one.fields[name], one.exact.get(name, np.zeros(0))
    exact = exact[np.isfinite(exact)]
    if values.size > QUANTILES.size:
        values = np.quantile(values, QUANTILES)
    return values, np.array([exact.min(), exact.max()]) if exact.size else exact


def _spans_decades(values: np.ndarray) -> bool:
    """Whether there is a peak far above the median, or a step of three decades in the middle."""
    largest = values.max()
    is_high, is_low = values > 0.5 * largest, values < 1e-3 * largest
    return largest > 100.0 * np.median(values) or min(is_high.mean(), is_low.mean()) > 0.4
