"""Waves that the ends of a domain send into uniform gas, by exact Riemann problems."""

import math
from typing import NamedTuple

from sph.eos import is_gamma_law
from sph.exact import riemann


class Ends(NamedTuple):
    """Speeds along one axis of the waves from its ends; infinite, outward, where there is none."""

    low: float = -math.inf
    high: float = math.inf

    def between(self, box, time: float) -> tuple[float, float]:
        """Where along the axis no wave has come from either end of `box` (2,)."""
        if time == 0.0:
            return -math.inf, math.inf
        return box[0] + self.low * time, box[1] + self.high * time


def of(boundary: str, low: riemann.State, high: riemann.State, eos) -> Ends:
    """The waves of an axis whose gas is in those states beside its ends, velocities along it.

    Gas at an open end expands into vacuum, behind a wave at the speed of sound. At periodic ends
    the gases of both meet, and at a wall gas meets its own mirror image.
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
        return Ends(math.inf, -math.inf)  # unknown, so that no place is sure to be undisturbed
    if boundary == "periodic":
        first, last = riemann.reach(high, low, eos)
        return Ends(last, first)
    return Ends(
        riemann.reach(_mirrored(low), low, eos)[1] if low.velocity else -math.inf,
        riemann.reach(high, _mirrored(high), eos)[0] if high.velocity else math.inf,
    )


def opens_vacuum(boundary: str, low: riemann.State, high: riemann.State, eos) -> bool:
    """Whether gas leaves the ends of that axis faster than it can expand, arguments as of `of`."""
    if boundary == "open":
        return False
    if not is_gamma_law(eos):
        return low.velocity > 0.0 or high.velocity < 0.0  # not known to stay together
    pairs = [(high, low)]
    if boundary == "mirror":
        pairs = [(_mirrored(low), low), (high, _mirrored(high))]
    try:
        return any(riemann.star_state(*pair, eos).vacuum for pair in pairs)
    except ValueError:  # a pressure too low to compute with holds gas together no better
        return True


def _mirrored(state: riemann.State) -> riemann.State:
    return state._replace(velocity=-state.velocity)
