"""Maps as the options of `sph plot` and `sph movie` ask for them."""

from typing import NamedTuple

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from sph.analysis.figures import maps, style
from sph.analysis.figures.sources import State
from sph.analysis.interpolate import Plane
from sph.errors import ConfigError

OF_SOLIDS = {"plastic_strain": "plastic_strain", "von_mises": "deviatoric_stress"}


class View(NamedTuple):
    """What to draw on a map, and how; None leaves the choice to the program."""

    field: str | None = None
    limits: tuple[float, float] | None = None  # of the scale of colours
    is_log: bool = False
    zoom: tuple[float, float, float, float] | None = None  # x from, to, y from, to
    slice: tuple[int, float] | None = None  # axis across it, and where
    projection: int | None = None  # axis along the line of sight
    is_linear: bool = False

    def check(self, state: State) -> None:
        """Raise ConfigError if this view cannot be drawn of `state`."""
        if state.dimension == 1:
            raise ConfigError(
                "this run is 1-D, and has no maps.\n"
                "Try: without --field, --range, --log, --linear, --zoom, --slice and "
                "--projection, for profiles."
            )
        self._check_axes(state)
        needed = OF_SOLIDS.get(self.field or "")
        if needed and state.particles.get(needed) is None:
            raise ConfigError(
                f"--field {self.field}: this run has no such field.\n"
                "Try: density, pressure, internal_energy or speed."
            )
        if self.limits and not self.limits[0] < self.limits[1]:
            raise ConfigError(
                f"--range {self.limits[0]:g} {self.limits[1]:g}: expected the smaller number first."
            )
        if self.is_log and self.is_linear:
            raise ConfigError(
                "--log and --linear exclude each other.\nTry: one of the two options."
            )
        if self.is_log and self.limits and self.limits[0] <= 0.0:
            raise ConfigError(
                f"--range {self.limits[0]:g} {self.limits[1]:g}: expected numbers above 0, "
                "because --log asks for a logarithmic scale."
            )
        if self.zoom and not (self.zoom[0] < self.zoom[1] and self.zoom[2] < self.zoom[3]):
            raise ConfigError(
                f"--zoom {' '.join(f'{end:g}' for end in self.zoom)}: expected x from, x to, y "
                "from, y to, the smaller number of each pair first."
            )

    def _check_axes(self, state: State) -> None:
        if self.slice is None and self.projection is None:
            return
        if state.dimension == 2:
            raise ConfigError(
                "this run is 2-D: --slice and --projection need a 3-D run.\n"
                "Try: without them; the map shows the whole run."
            )
        if self.slice is not None and self.projection is not None:
            raise ConfigError(
                "--slice and --projection are different pictures.\nTry: one of the two options."
            )

    @property
    def third(self) -> int:
        """The axis across the plane of a 3-D run."""
        return self.slice[0] if self.slice else 2 if self.projection is None else self.projection

    def name_of(self, main_field: str) -> str:
        """The name of a picture, without suffix; main_field: what it shows without `field`."""
        what = "map"
        if self.slice is not None:
            what = f"slice_{'xyz'[self.slice[0]]}"
        elif self.projection is not None:
            what = f"projection_{'xyz'[self.projection]}"
        return f"{what}_of_{self.field or main_field}"

    def plane(self, states, pixels: int) -> Plane:
        """The pixels that all of `states` are drawn on. Raises ConfigError."""
        frame, state = maps.common_frame(states)
        if self.zoom or self.slice:
            filled, _ = maps.common_frame(states, has_all=True)
        axes = tuple(axis for axis in (0, 1, 2) if axis != self.third)
        part = _zoomed(self.zoom, filled, axes, state) if self.zoom else frame[axes, :]
        plane = Plane.through_centre(part, pixels)._replace(axes=(axes[0], axes[1]))
        if state.dimension == 2 or self.projection is not None:
            return plane
        height = self.slice[1] if self.slice else float(state.problem.centre[2])
        if self.slice and not filled[self.third, 0] <= height <= filled[self.third, 1]:
            raise ConfigError(
                f"--slice {'xyz'[self.third]}={height:g}: expected a value in "
                f"{_range(filled, self.third, state)}."
            )
        return plane._replace(height=height)

    def scale(self, low: float, high: float) -> Normalize:
        """The scale of colours of values from `low` to `high`. Raises ConfigError."""
        low, high = self.limits or (low, high)
        if not self.is_log:
            return Normalize(low, high) if self.limits else style.linear(low, high)
        if low <= 0.0:
            raise ConfigError(
                f"--log: the lowest value is {low:.3g}, but a logarithm needs values above 0.\n"
                "Try: --range LO HI with LO above 0."
            )
        # the tails of kernels at the edge of gas span any number of decades
        return LogNorm(low if self.limits else style.lowest_of_log(low, high), high)


def _zoomed(zoom, filled: np.ndarray, axes, state: State) -> np.ndarray:
    """(2, 2) the ends of --zoom, without what is beyond closed ends of the domain.

    filled: (D, 2) the domain, along open axes the extent of the particles. Beyond closed ends
    a map would show images of the particles. Raises ConfigError if nothing is left.
    """
    part = np.reshape(np.array(zoom), (2, 2))
    for row, axis in zip(part, axes, strict=False):
        low, high = filled[axis]
        if row[1] <= low or row[0] >= high:
            raise ConfigError(
                f"--zoom {' '.join(f'{end:g}' for end in zoom)}: there is "
                f"nothing from {row[0]:g} to {row[1]:g} along {'xyz'[axis]}; expected a part "
                f"of {_range(filled, axis, state)}."
            )
        if state.problem.boundaries[axis] != "open":
            row[:] = np.clip(row, low, high)
    return part


def _range(filled: np.ndarray, axis: int, state: State) -> str:
    """What is there along an axis of the domain or, where it is open, of the particles."""
    low, high = filled[axis]
    is_open = state.problem.boundaries[axis] == "open"
    what = "the range that particles reach in the open domain" if is_open else "the domain"
    return f"{what}, from {low:.6g} to {high:.6g}"


def figure(states, view: View) -> Figure:
    """Maps of one field at the times of `states`, which are iterated twice. Raises ConfigError."""
    for state in states:
        view.check(state)
    plane = view.plane(states, maps.PIXELS if len(states) == 1 else maps.PIXELS_OF_MANY)
    field = view.field or maps.main_field(*states)
    drawn = [maps.drawn(state, plane, state.when, state.title, field) for state in states]
    values = np.concatenate([one.values.ravel() for one in drawn])
    shown = values[np.isfinite(values)]
    if view.limits:
        scale = view.scale(*view.limits)
    elif (view.is_log or view.is_linear) and shown.size:
        scale = view.scale(float(shown.min()), float(shown.max()))
    else:
        scale = style.scale(values)
    return maps.side_by_side(drawn, scale)
