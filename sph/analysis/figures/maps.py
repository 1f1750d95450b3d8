"""Maps of 2-D runs and slices through the middle of 3-D runs, interpolated with the kernel."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from sph.analysis.figures import style
from sph.analysis.figures.sources import State
from sph.analysis.interpolate import Plane, onto_plane

PIXELS = 512  # on the longer side
PIXELS_OF_MANY = 320
LONGEST_SIDE = 3.6  # inches, of a map that stands with one other
AT_SURFACE = 0.5  # sum of V W at a plane surface of matter that ends at its particles
MOST_OUTLINES = 12  # bodies of which outlines are drawn
LONGEST_TITLE = 40  # letters in a line above a map that stands with others
WIDEST = 9.0  # inches, of a picture of many maps


def single(state: State) -> Figure:
    """Density and a second field at one time; for solids, plastic strain and stress."""
    names = (main_field(state), second_field(state))
    plane = plane_of(state, PIXELS)
    images = _images(state, names, plane)
    columns, width, height = _arrangement(plane, 2, 2 * LONGEST_SIDE)
    figure = style.new_figure(columns * (width + 1.0), 2 // columns * height + 1.0, "compressed")
    panels = figure.subplots(2 // columns, columns, squeeze=False)
    for panel, name, values in zip(panels.flat, names, images, strict=True):
        image = _show(panel, values, plane, name, style.scale(values))
        figure.colorbar(image, ax=panel, pad=0.02, extend=_extends(image))
        _outline(panel, state, plane)
        symbol = state.labelled(style.SYMBOLS[name], name)
        panel.set_title(f"{style.TITLES.get(name, name)} {symbol}")
    _label_axes(panels, 2, _axes(state))
    figure.suptitle(f"{state.title}, {state.when}{_where(plane)}")
    return figure


def over_time(states: Iterable[State]) -> Figure:
    """The main field of one run at several times, in one scale of colours."""
    drawn = [_drawn(state, state.when, state.title) for state in states]
    return _side_by_side(drawn)


def compared(states: Iterable[State], labels: Sequence[str]) -> Figure:
    """The main field of several runs, in one scale of colours."""
    pairs = zip(states, labels, strict=True)
    drawn = [
        _drawn(state, f"{style.plain(label)}, {state.when}", state.name) for state, label in pairs
    ]
    return _side_by_side(drawn)


def main_field(state: State) -> str:
    """Density; plastic strain of a solid or, if nothing has yielded, its von Mises stress.

    The density of a solid changes little.
    """
    if not state.is_solid:
        return "density"
    strain = state.particles.get("plastic_strain")
    return "von_mises" if strain is None or not strain.any() else "plastic_strain"


def second_field(state: State) -> str:
    """Pressure where it varies by more than a factor 2; nearer to balance, speed tells more.

    Of a solid that yields von Mises stress, otherwise pressure.
    """
    if state.is_solid:
        return "pressure" if main_field(state) == "von_mises" else "von_mises"
    low, high = np.percentile(state.scalar("pressure"), [1, 99])
    return "pressure" if high > 2.0 * low else "speed"


def plane_of(state: State, pixels: int) -> Plane:
    """The domain, or the middle of a 3-D one; along open axes as far as nearly all gas has gone."""
    box = state.problem.box.copy()
    for axis, boundary in enumerate(state.problem.boundaries):
        if boundary == "open":
            low, high = np.percentile(state.particles.position[axis], [0.1, 99.9])
            box[axis] = min(box[axis, 0], low), max(box[axis, 1], high)
    plane = Plane.through_centre(box, pixels)
    return plane if plane.height is None else plane._replace(height=float(state.problem.centre[2]))


class _Map(NamedTuple):
    """A map of one field, which takes less memory than the state it is of."""

    values: np.ndarray  # (ny, nx)
    field: str
    plane: Plane
    label: str
    what: str  # for the title
    symbol: str  # of the field, with its unit
    axes: list[str]  # their labels


def _drawn(state: State, label: str, what: str) -> tuple[_Map, ...]:
    """The map of the main field; before that of stress, which `_chosen` takes without yielding."""
    plane, fields = plane_of(state, PIXELS_OF_MANY), [main_field(state)]
    if state.is_solid and state.particles.get("plastic_strain") is not None:
        fields = ["plastic_strain", "von_mises"]
    return tuple(
        _Map(
            values, field, plane, label, what + _where(plane),
            state.labelled(style.SYMBOLS[field], field), _axes(state),
        )
        for field, values in zip(fields, _images(state, fields, plane), strict=True)
    )  # fmt: skip


def _chosen(drawn: Sequence[tuple[_Map, ...]]) -> list[_Map]:
    """The first map of each, or the last if the first shows nothing above 0 in any."""
    place = 0 if any(np.any(one[0].values > 0.0) for one in drawn) else -1
    return [one[place] for one in drawn]


def _side_by_side(states: Sequence[tuple[_Map, ...]]) -> Figure:
    drawn = _chosen(states)
    scale = style.scale(np.concatenate([one.values.ravel() for one in drawn]))
    columns, width, height = _arrangement(drawn[0].plane, len(drawn), WIDEST)
    rows = -(-len(drawn) // columns)
    figure = style.new_figure(columns * width + 1.2, rows * (height + 0.35) + 0.8, "compressed")
    panels = figure.subplots(rows, columns, squeeze=False)
    for panel, one in zip(panels.flat, drawn, strict=False):
        image = _show(panel, one.values, one.plane, one.field, scale)
        panel.set_title(textwrap.fill(one.label, LONGEST_TITLE))
    shown, empty = np.split(panels.ravel(), [len(drawn)])
    for panel in empty:
        panel.remove()
    _label_axes(panels, len(drawn), drawn[0].axes)
    bar = figure.colorbar(image, ax=list(shown), pad=0.015, aspect=30, extend=_extends(image))
    bar.ax.set_title(", ".join(dict.fromkeys(one.symbol for one in drawn)))
    figure.suptitle("; ".join(sorted({one.what for one in drawn})))
    return figure


def _images(state: State, names: Sequence[str], plane: Plane) -> np.ndarray:
    values = np.stack([state.scalar(name) for name in names])
    return _interpolated(state, values, plane)


def _interpolated(state: State, values: np.ndarray, plane: Plane) -> np.ndarray:
    least = AT_SURFACE if state.has_surface else 0.0
    return onto_plane(values, state.particles, state.domain, state.kernel, plane, least)


def _outline(panel, state: State, plane: Plane) -> None:
    """Draw the outlines of several solid bodies, which may touch each other."""
    body = state.particles.get("body")
    numbers = np.unique(body) if body is not None else np.zeros(0)
    if not 2 <= numbers.size <= MOST_OUTLINES:
        return
    shares = _interpolated(state, np.stack([body == one for one in numbers]), plane)
    step = (plane.high - plane.low) / np.array(plane.shape)
    x, y = (plane.low[d] + step[d] * (np.arange(plane.shape[d]) + 0.5) for d in range(2))
    for share in np.nan_to_num(shares):
        panel.contour(x, y, share, levels=[0.5], colors="white", linewidths=0.7)


def _show(panel, values, plane: Plane, name: str, scale):
    panel.set_facecolor(style.VACUUM)
    return panel.imshow(
        values, origin="lower", extent=plane.extent, cmap=style.MAPS[name], norm=scale,
        aspect="equal",
    )  # fmt: skip


def _extends(image) -> str:
    """Which end of the scale cuts values off: the lower one of a map of many decades."""
    return "min" if np.nanmin(image.get_array()) < image.norm.vmin else "neither"


def _arrangement(plane: Plane, count: int, widest: float) -> tuple[int, float, float]:
    """Columns, and inches of a map: wide maps above each other, others in rows of up to three."""
    sides = plane.high - plane.low
    columns = 1 if sides[0] > 2.0 * sides[1] else min(count, 3 if count not in (2, 4) else 2)
    longest = min(LONGEST_SIDE, widest / columns) if columns > 1 else 1.6 * LONGEST_SIDE
    width, height = longest * sides / sides.max()
    return columns, width, height


def _axes(state: State) -> list[str]:
    return [state.labelled(label, "x") for label in ("$x$", "$y$")]


def _label_axes(panels, count: int, labels: Sequence[str]) -> None:
    """Numbers and names on the outer axes of the first `count` panels of a grid."""
    columns = panels.shape[1]
    for i, panel in enumerate(panels.flat[:count]):
        is_lowest = i + columns >= count
        panel.tick_params(labelbottom=is_lowest, labelleft=i % columns == 0)
        if is_lowest:
            panel.set_xlabel(labels[0])
        if i % columns == 0:
            panel.set_ylabel(labels[1])


def _where(plane: Plane) -> str:
    return "" if plane.height is None else f", at $z$ = {plane.height:.4g}"
