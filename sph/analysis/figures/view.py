"""Maps as the options of `sph plot` and `sph movie` ask for them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from sph.analysis.figures import maps, style
from sph.analysis.figures.sources import Source, State
from sph.analysis.interpolate import Plane
from sph.errors import ConfigError

OF_SOLIDS = {"plastic_strain": "plastic_strain", "von_mises": "deviatoric_stress"}


class View(NamedTuple):
    """What to draw on a map, and how; None leaves the choice to the program."""

    field: str | None = None
    limits: tuple[float, float] | None = None  # of the scale of colours
    is_log: bool = False
    zoom: tuple[float, float, float, float] | None = None  # x from, to, y from, to

    def check(self, state: State) -> None:
        """Raise ConfigError if this view cannot be drawn of `state`."""
        if state.dimension == 1:
            raise ConfigError("this run is 1-D: maps and movies need a 2-D or 3-D run.")
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

    def plane(self, states, pixels: int) -> Plane:
        """The pixels that all of `states` are drawn on."""
        plane = maps.common_plane(states, pixels)
        if self.zoom is None:
            return plane
        zoomed = Plane.through_centre(np.reshape(self.zoom, (2, 2)), pixels)
        return zoomed._replace(height=plane.height)

    def scale(self, low: float, high: float) -> Normalize:
        """The scale of colours of values from `low` to `high`. Raises ConfigError."""
        low, high = self.limits or (low, high)
        if not self.is_log:
            return Normalize(low, high)
        if low <= 0.0:
            raise ConfigError(
                f"--log: the lowest value is {low:.3g}, but a logarithm needs values above 0.\n"
                "Try: --range LO HI with LO above 0."
            )
        return LogNorm(low, high)


def figure(states, view: View) -> Figure:
    """Maps of one field at the times of `states`, which are iterated twice. Raises ConfigError."""
    for state in states:
        view.check(state)
    plane = view.plane(states, maps.PIXELS if len(states) == 1 else maps.PIXELS_OF_MANY)
    field = view.field or maps.main_field(*states)
    drawn = [maps.drawn(state, plane, state.when, state.title, field) for state in states]
    values = np.concatenate([one.values.ravel() for one in drawn])
    if view.limits or view.is_log:
        scale = view.scale(float(np.nanmin(values)), float(np.nanmax(values)))
    else:
        scale = style.scale(values)
    return maps.side_by_side(drawn, scale)


def states_at(source: Source, times: Sequence[float]) -> list[State]:
    """The state nearest to each of `times`, in order and once each; the last without times."""
    if not times:
        return [source.last()]
    found = {source.nearest(time) for time in times}
    return [source.state(k) for k in sorted(found)]
