"""The times of outputs: checkpoints, at which steps end, and frames, which change no step."""

import itertools
import math
from collections.abc import Iterator

# Times closer than this, relative to the output interval or the end, count as equal.
SAME_TIME = 1e-9


def output_times(end: float, interval: float, after: float = 0.0) -> Iterator[float]:
    """Yield the times of checkpoints after `after`: multiples of `interval`, and `end`."""
    same = SAME_TIME * min(interval, end)
    for k in itertools.count(max(1, math.floor(after / interval))):
        # rounded to 15 digits, so that 3 x 0.1 equals 0.3, the end of a run to 0.3
        time = float(f"{k * interval:.15g}")
        if time >= end - same:
            break
        if time > after + same:
            yield time
    if end > after + same:
        yield end


def next_frame(time: float, end: float, number: int | None) -> float:
    """Return the time from which on the first frame after `time` is due, inf without frames.

    number: of frames from t = 0 to `end`.
    """
    if number is None:
        return math.inf
    spacing = end / (number - 1)
    return (math.floor(time / spacing + SAME_TIME) + 1 - SAME_TIME) * spacing
