"""Waves from the ends of a domain into uniform gas, from exact Riemann solutions."""

import math
from typing import NamedTuple

from sph.eos import is_gamma_law
from sph.exact import riemann


class Ends(NamedTuple):
    """Velocities of the waves from the ends of an axis; -inf (low) and inf (high) if none."""

    low: float = -math.inf
    high: float = math.inf

    def between(self, box, time: float) -> tuple[float, float]:
        """Return the range of the axis that waves from the ends of `box` (2,) have not reached."""
        if time == 0.0:
            return -math.inf, math.inf
        return box[0] + self.low * time, box[1] + self.high * time


def of(boundary: str, low: riemann.State, high: riemann.State, eos) -> Ends:
    """Return the waves of an axis with gas in the states `low` and `high` at its ends.

    The states have the velocity along the axis. At an open end gas expands into vacuum, behind a
    wave at the speed of sound. At periodic ends the gases of both ends meet. At a wall the gas
    meets its mirror image.
    """
    if boundary == "open":
        return Ends(
            low.velocity + eos.sound_speed(low.density, low.pressure),
            high.velocity - eos.sound_speed(high.density, high.pressure),
        )
    at_rest = low.velocity == high.velocity == 0.0
    if low == high if boundary == "periodic" else at_rest:
        return Ends()
    if not is_gamma_law(eos):
        return Ends(math.inf, -math.inf)  # unknown: all of the axis may be disturbed
    if boundary == "periodic":
        first, last = riemann.reach(high, low, eos)
        return Ends(last, first)
    return Ends(
        riemann.reach(_mirrored(low), low, eos)[1] if low.velocity else -math.inf,
        riemann.reach(high, _mirrored(high), eos)[0] if high.velocity else math.inf,
    )


def opens_vacuum(boundary: str, low: riemann.State, high: riemann.State, eos) -> bool:
    """Return whether gas leaves the ends of an axis faster than it can expand (see `of`)."""
    if boundary == "open":
        return False
    if not is_gamma_law(eos):
        return low.velocity > 0.0 or high.velocity < 0.0  # unknown: a vacuum may open
    pairs = [(high, low)]
    if boundary == "mirror":
        pairs = [(_mirrored(low), low), (high, _mirrored(high))]
    try:
        return any(riemann.star_state(*pair, eos).vacuum for pair in pairs)
    except ValueError:  # the pressure is too low to be computed, practically a vacuum
        return True


def _mirrored(state: riemann.State) -> riemann.State:
    return state._replace(velocity=-state.velocity)
