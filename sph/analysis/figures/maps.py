"""Maps of 2-D runs, slices and projections of 3-D runs, interpolated with the kernel."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from sph.analysis.figures import outlines, style
from sph.analysis.figures.outlines import AT_SURFACE
from sph.analysis.figures.sources import State
from sph.analysis.interpolate import Plane, with_cover
from sph.analysis.projection import along_sight

PIXELS = 512  # on the longer side
PIXELS_OF_MANY = 320
LONGEST_SIDE = 3.6  # inches, of a map that stands with one other
WIDEST_RATIO = 8.0  # of sides drawn to scale; thinner domains are stretched
LONGEST_TITLE = 40  # letters in a line above a map that stands with others
WIDEST = 9.0  # inches, of a picture of many maps


def single(state: State) -> Figure:
    """Density and a second field at one time; for solids, plastic strain and stress."""
    names = (main_field(state), second_field(state))
    plane = plane_of(state, PIXELS)
    images, opacity = _images(state, names, plane)
    bodies = outlines.shares(state, plane)
    columns, width, height = _arrangement(plane, 2, 2 * LONGEST_SIDE)
    figure = style.new_figure(columns * (width + 1.0), 2 // columns * height + 1.0, "compressed")
    panels = figure.subplots(2 // columns, columns, squeeze=False)
    for panel, name, values in zip(panels.flat, names, images, strict=True):
        image = _show(panel, values, opacity, plane, name, style.scale(values))
        figure.colorbar(image, ax=panel, pad=0.02, extend=_extends([values], image.norm))
        outlines.draw(panel, plane, bodies)
        panel.set_title(state.labelled(style.label(name), name))
    _label_axes(panels, 2, _axes(state, plane))
    figure.suptitle(f"{state.title}, {state.when}{_where(plane, state)}")
    return figure


def over_time(states: Iterable[State], field: str) -> Figure:
    """A field of one run at several times, in one scale of colours and one frame.

    `states` is iterated twice, so that few are in memory: the frame holds the gas of all times.
    """
    plane = common_plane(states, PIXELS_OF_MANY)
    return side_by_side([drawn(state, plane, state.when, state.title, field) for state in states])


def compared(states: Sequence[State], labels: Sequence[str]) -> Figure:
    """The main field of several runs, in one scale of colours."""
    field = main_field(*states)
    images = [
        drawn(
            state, plane_of(state, PIXELS_OF_MANY), f"{style.plain(label)}, {state.when}",
            state.name, field,
        )
        for state, label in zip(states, labels, strict=True)
    ]  # fmt: skip
    return side_by_side(images)


def main_field(*states: State) -> str:
    """The field of maps of these states: density; of solids, whose density changes little, others.

    Plastic strain if all solids may yield and one has yielded, otherwise von Mises stress.
    """
    if not all(state.is_solid for state in states):
        return "density"
    strains = [state.particles.get("plastic_strain") for state in states]
    has_yielded = any(strain is not None and strain.any() for strain in strains)
    may_yield = all(strain is not None for strain in strains)
    return "plastic_strain" if may_yield and has_yielded else "von_mises"


def second_field(state: State) -> str:
    """Pressure where it varies by more than a factor 2; nearer to balance, speed tells more.

    Of a solid that has yielded von Mises stress, otherwise pressure.
    """
    if state.is_solid:
        return "pressure" if main_field(state) == "von_mises" else "von_mises"
    low, high = np.percentile(state.scalar("pressure"), [1, 99])
    return "pressure" if high > 2.0 * low else "speed"


def plane_of(state: State, pixels: int) -> Plane:
    """The domain, or the middle of a 3-D one; along open axes as far as nearly all gas reaches."""
    return _plane(_frame(state), state, pixels)


def common_plane(states: Iterable[State], pixels: int) -> Plane:
    """The plane that holds `plane_of` of all states, which are read one by one."""
    return _plane(*common_frame(states), pixels)


def common_frame(states: Iterable[State], has_all: bool = False) -> tuple[np.ndarray, State]:
    """(D, 2) the part of space that holds the gas of all states, and the last state.

    has_all: along open axes as far as any kernel reaches, not only nearly all gas.
    """
    frames = []
    for state in states:
        frames.append(_filled(state) if has_all else _frame(state))
    low, high = np.array(frames)[..., 0].min(axis=0), np.array(frames)[..., 1].max(axis=0)
    return np.stack([low, high], axis=1), state


def _frame(state: State) -> np.ndarray:
    """(D, 2) the domain; along open axes the range of nearly all gas with half a support radius."""
    box = state.problem.box.copy()
    margin = 0.5 * np.median(state.particles.support)
    for axis, boundary in enumerate(state.problem.boundaries):
        if boundary == "open":
            low, high = np.percentile(state.particles.position[axis], [0.1, 99.9])
            box[axis] = low - margin, high + margin
    return box


def _filled(state: State) -> np.ndarray:
    """(D, 2) the domain; along open axes the range that the kernels of all particles reach."""
    box, particles = state.problem.box.copy(), state.particles
    for axis, boundary in enumerate(state.problem.boundaries):
        if boundary == "open":
            x = particles.position[axis]
            box[axis] = (x - particles.support).min(), (x + particles.support).max()
    return box


def _plane(frame: np.ndarray, state: State, pixels: int) -> Plane:
    plane = Plane.through_centre(frame, pixels)
    return plane if plane.height is None else plane._replace(height=float(state.problem.centre[2]))


class _Map(NamedTuple):
    """A map of one field, which takes less memory than the state it is of."""

    values: np.ndarray  # (ny, nx)
    opacity: np.ndarray | None  # (ny, nx)
    field: str
    plane: Plane
    label: str
    what: str  # for the title
    quantity: str  # name, symbol and unit of the field
    axes: list[str]  # their labels
    bodies: np.ndarray  # (B, ny, nx) of `outlines.shares`


def drawn(state: State, plane: Plane, label: str, what: str, field: str | None = None) -> _Map:
    """The map of `field`, by default the main field, on `plane`."""
    field = field or main_field(state)
    if state.dimension == 3 and plane.height is None:
        field, values, quantity = _projected(state, field, plane)
        opacity, bodies = None, np.zeros((0, *values.shape))
    else:
        bodies = outlines.shares(state, plane)
        (values,), opacity = _images(state, [field], plane)
        quantity = state.labelled(style.label(field), field)
    what += _where(plane, state)
    return _Map(values, opacity, field, plane, label, what, quantity, _axes(state, plane), bodies)


def _projected(state: State, field: str, plane: Plane) -> tuple[str, np.ndarray, str]:
    """Name, (ny, nx) values and label of a field along the line of sight."""
    if field == "density":
        _, column = along_sight(
            np.zeros((0, state.particles.number)),
            state.particles,
            state.domain,
            state.kernel,
            plane,
        )
        label = state.labelled(style.label("column_density"), "column_density")
        return "column_density", np.where(column > 0.0, column, np.nan), label
    values = state.scalar(field)[None]
    (means,), _ = along_sight(values, state.particles, state.domain, state.kernel, plane)
    return field, means, state.labelled(f"{style.label(field)}, mean weighted by mass", field)


def side_by_side(maps: Sequence[_Map], scale=None) -> Figure:
    """Maps in rows, in one scale of colours, by default one that suits all values."""
    scale = scale or style.scale(np.concatenate([one.values.ravel() for one in maps]))
    columns, width, height = _arrangement(maps[0].plane, len(maps), WIDEST)
    rows = -(-len(maps) // columns)
    figure = style.new_figure(columns * width + 1.2, rows * (height + 0.35) + 0.8, "compressed")
    panels = figure.subplots(rows, columns, squeeze=False)
    for panel, one in zip(panels.flat, maps, strict=False):
        image = _show(panel, one.values, one.opacity, one.plane, one.field, scale)
        outlines.draw(panel, one.plane, one.bodies)
        panel.set_title(textwrap.fill(one.label, LONGEST_TITLE))
    shown, empty = np.split(panels.ravel(), [len(maps)])
    for panel in empty:
        panel.remove()
    differ = len({one.plane.extent for one in maps}) > 1
    _label_axes(panels, len(maps), maps[0].axes, differ)
    extends = _extends([one.values for one in maps], scale)
    bar = figure.colorbar(image, ax=list(shown), pad=0.015, aspect=30, extend=extends)
    bar.set_label(", ".join(sorted({one.quantity for one in maps})))
    figure.suptitle("; ".join(sorted({one.what for one in maps})))
    return figure


def _images(state: State, names, plane: Plane) -> tuple[np.ndarray, np.ndarray | None]:
    """Maps of fields (F, ny, nx), and how opaque each pixel (ny, nx) is, None for fully.

    Kernels of gas reach far into vacuum: there, colours fade from the sum of V W at a surface to
    half of it. Solids and liquids end at their surface.
    """
    values = np.stack([state.scalar(name) for name in names])
    means, cover = with_cover(values, state.particles, state.domain, state.kernel, plane)
    if state.has_surface:
        return np.where(cover > AT_SURFACE, means, np.nan), None
    if "open" not in state.problem.boundaries:
        return means, None
    # from the last particles outwards, until they would be seen no more
    opacity = np.clip(2.0 * cover / AT_SURFACE - 1.0, 0.0, 1.0)
    return np.where(opacity > 0.0, means, np.nan), opacity


def _show(panel, values, opacity, plane: Plane, name: str, scale):
    panel.set_facecolor(style.VACUUM)
    is_thin = _ratio(plane) != _drawn_ratio(plane)
    return panel.imshow(
        values, origin="lower", extent=plane.extent, cmap=style.MAPS[name], norm=scale,
        alpha=opacity, aspect=_ratio(plane) / _drawn_ratio(plane) if is_thin else "equal",
    )  # fmt: skip


def _ratio(plane: Plane) -> float:
    """Of the sides, width over height."""
    sides = plane.high - plane.low
    return float(sides[0] / sides[1])


def _drawn_ratio(plane: Plane) -> float:
    """Of the sides on paper: labels of a longer, thinner map would collide."""
    return float(np.clip(_ratio(plane), 1.0 / WIDEST_RATIO, WIDEST_RATIO))


def _extends(maps: Sequence[np.ndarray], scale) -> str:
    """Which ends of the scale cut values off: --range, or the lower one of many decades."""
    below = any((values < scale.vmin).any() for values in maps)
    above = any((values > scale.vmax).any() for values in maps)
    return {(True, True): "both", (True, False): "min", (False, True): "max"}.get(
        (below, above), "neither"
    )


def _arrangement(plane: Plane, count: int, widest: float) -> tuple[int, float, float]:
    """Columns, and inches of a map: wide maps above each other, others in rows of up to three."""
    sides = np.array([_drawn_ratio(plane), 1.0])
    columns = 1 if sides[0] > 2.0 * sides[1] else min(count, 3 if count not in (2, 4) else 2)
    longest = min(LONGEST_SIDE, widest / columns) if columns > 1 else 1.6 * LONGEST_SIDE
    width, height = longest * sides / sides.max()
    return columns, width, height


def _axes(state: State, plane: Plane) -> list[str]:
    return [state.labelled(f"${'xyz'[axis]}$", "x") for axis in plane.axes]


def _label_axes(panels, count: int, labels: Sequence[str], differ: bool = False) -> None:
    """Numbers and names on the outer axes of the first `count` panels, on all where they differ."""
    columns = panels.shape[1]
    for i, panel in enumerate(panels.flat[:count]):
        is_lowest = i + columns >= count
        is_first = i % columns == 0
        panel.tick_params(labelbottom=is_lowest or differ, labelleft=is_first or differ)
        if is_lowest:
            panel.set_xlabel(labels[0])
        if is_first:
            panel.set_ylabel(labels[1])


def _where(plane: Plane, state: State) -> str:
    where, name = "", f"${'xyz'[plane.third]}$"
    if plane.height is not None:
        where = (
            f", at {name} = {style.shortest(plane.height)} {state.units.symbol(1, 0, 0)}".rstrip()
        )
    elif state.dimension == 3:
        where = f", projected along {name}"
    return where + (", not to scale" if _ratio(plane) != _drawn_ratio(plane) else "")
