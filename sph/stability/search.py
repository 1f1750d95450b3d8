"""The end of a range of positive numbers in which a property holds: strides, then bisection.

Both work in the logarithm: C and eta are scales. A function tells whether the property holds, for
several values at a time where they can run in parallel.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

# Digits of a value that is tried: the directory of its run is named after it.
DIGITS = 4

Holds = Callable[[Sequence[float]], Sequence[bool]]


class Stride(NamedTuple):
    """How to search for an end: `factor` from value to value (below 1: downward), `most` times."""

    factor: float
    most: int


class Edge(NamedTuple):
    """The last value for which the property holds, and the next one for which it does not."""

    inside: float | None  # None: it holds for no tried value
    outside: float | None  # None: it holds for all tried values


def find(holds: Holds, start: float, stride: Stride, resolution: float, at_once: int = 1) -> Edge:
    """The first end of the range on the way from `start`.

    Where the property does not hold at `start`, the search goes the other way. inside and outside
    are at most a factor of `resolution` apart, but for rounding. Where the property is not
    monotonic, this is one end of several: it may hold again beyond.
    """
    (is_inside,) = holds([start])
    factor = stride.factor if is_inside else 1.0 / stride.factor
    last, other = _walk(holds, is_inside, start, Stride(factor, stride.most), at_once)
    if other is None:
        return Edge(last, None) if is_inside else Edge(None, start)
    inside, outside = (last, other) if is_inside else (other, last)
    while between := _between(inside, outside, resolution, at_once):
        inside, outside = _narrowed(holds, inside, outside, between)
    return Edge(inside, outside)


def rounded(value: float) -> float:
    """`value`, rounded to DIGITS."""
    return float(f"{value:.{DIGITS}g}")


def _walk(holds, verdict, start, stride, at_once) -> tuple[float, float | None]:
    """The last value with `verdict` on the way from `start`, and the first with the other."""
    values = [rounded(start * stride.factor**k) for k in range(1, stride.most + 1)]
    last = start
    for first in range(0, len(values), at_once):
        some = values[first : first + at_once]
        for value, found in zip(some, holds(some), strict=True):
            if found != verdict:
                return last, value
            last = value
    return last, None


def _between(inside: float, outside: float, resolution: float, count: int) -> list[float]:
    """`count` values between inside and outside; none where they are close enough."""
    if max(inside / outside, outside / inside) <= resolution:
        return []
    part = math.log(outside / inside) / (count + 1)
    values = [rounded(inside * math.exp(part * k)) for k in range(1, count + 1)]
    return [value for value in dict.fromkeys(values) if value not in (inside, outside)]


def _narrowed(holds, inside, outside, between) -> tuple[float, float]:
    for value, found in zip(between, holds(between), strict=True):
        if not found:
            return inside, value
        inside = value
    return inside, outside
