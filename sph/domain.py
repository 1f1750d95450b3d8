"""The box, its boundaries, and the images of particles that represent boundaries.

An image is an affine map per axis, x -> sign x + offset. A periodic boundary has an offset, a
reflecting wall a sign and an offset. Velocities are multiplied by the sign. Pair loops use only
these maps.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from sph.errors import NumericalError

# Most images of the box within a support radius: 4 copies in each direction along three axes, or
# 499 along one.
MOST_IMAGES = 1000

# Most neighbours within a support radius wider than the box, a hundred times as many as a kernel
# needs. With more, lists would exhaust memory.
MOST_NEIGHBOURS = 100_000

# Upper limit of the number of copies of the box, to avoid overflow.
FAR = 1e6


class Images(NamedTuple):
    """K maps of the domain; the first is the identity."""

    sign: np.ndarray  # (K, D)
    offset: np.ndarray  # (K, D)


@dataclass(frozen=True)
class Domain:
    """`box` (D, 2): lower and upper end of each axis; `boundaries`: one name per axis."""

    box: np.ndarray
    boundaries: tuple[str, ...]

    @property
    def _axes(self) -> Iterable[tuple[np.ndarray, str]]:
        return zip(self.box, self.boundaries, strict=True)

    @property
    def largest_side(self) -> float:
        return float((self.box[:, 1] - self.box[:, 0]).max())

    @cached_property
    def volume(self) -> float:
        return float(np.prod(self.box[:, 1] - self.box[:, 0]))

    @cached_property
    def images(self) -> Images:
        """The identity and the images in the copies of the box adjacent to it."""
        return self._images((1,) * len(self.boundaries))

    def images_within(self, reach: float) -> Images:
        """Return the identity and all images within the distance `reach` of the box.

        These are `images` if `reach` is at most the shortest closed axis, and more otherwise.
        """
        return self._images(self._cells_within(reach))

    def _cells_within(self, reach: float) -> tuple[int, ...]:
        """Return the copies of the box in each direction within `reach`, per axis; at least 1."""
        # as Python's numbers, whose overflow needs no np.errstate, which takes longer than all this
        lengths = [float(reach) / (hi - lo) for lo, hi in self.box.tolist()]
        return tuple(math.ceil(min(each, FAR)) if each > 1.0 else 1 for each in lengths)

    def _images(self, cells: tuple[int, ...]) -> Images:
        if cells not in self._kept:
            per_axis = [
                _axis_images(lo, hi, boundary, count)
                for ((lo, hi), boundary), count in zip(self._axes, cells, strict=True)
            ]
            combined = list(product(*per_axis))
            sign = np.array([[one[0] for one in image] for image in combined])
            offset = np.array([[one[1] for one in image] for image in combined])
            self._kept[cells] = Images(sign, offset)
        return self._kept[cells]

    @cached_property
    def _kept(self) -> dict[tuple[int, ...], Images]:
        """Images computed so far, by the copies of the box along each axis."""
        return {}

    def bring_inside(self, position: np.ndarray, others: Iterable[np.ndarray]) -> None:
        """Wrap positions at periodic boundaries and reflect them at walls, in place.

        position: (D, N); velocities: arrays (D, N) whose components change sign in a reflection.
        """
        for axis, ((lo, hi), boundary) in enumerate(self._axes):
            x = position[axis]
            outside = np.flatnonzero((x < lo) | (x >= hi))
            if boundary == "open" or outside.size == 0:
                continue
            if boundary == "periodic":
                length = hi - lo
                x[outside] -= length * np.floor((x[outside] - lo) / length)
                # a coordinate just below lo may round up to hi itself
                x[outside] = np.where(x[outside] >= hi, lo, x[outside])
            else:
                beyond = outside[x[outside] != hi]
                x[beyond], turned = _between_walls(x[beyond], lo, hi)
                for field in others:
                    field[axis, ..., beyond[turned]] *= -1
                    if field.ndim == 3:
                        field[:, axis, beyond[turned]] *= -1

    @cached_property
    def longest_reach(self) -> float:
        """Largest support radius for which `images` suffice; infinite if every axis is open."""
        closed = [hi - lo for (lo, hi), kind in self._axes if kind != "open"]
        return float(min(closed, default=np.inf))

    def check_reach(self, reach: float, number: int, particle: int) -> None:
        """Raise NumericalError if a support radius `reach` is too large for the box.

        That is, if it needs more than MOST_IMAGES images of the box, or if about MOST_NEIGHBOURS of
        the `number` particles and their images lie within it. particle: ID for the message.
        """
        if reach <= self.longest_reach:
            return
        closed = [kind != "open" for kind in self.boundaries]
        cells = np.array(self._cells_within(reach))[closed]
        with np.errstate(over="ignore"):
            copies = np.prod([min(2 * reach / (hi - lo), FAR) for lo, hi in self.box[closed]])
        if np.prod(2.0 * cells + 1.0) > MOST_IMAGES or number * copies > MOST_NEIGHBOURS:
            raise NumericalError(
                f"particle {particle} needs a support radius of {reach:.4g}, "
                f"{reach / self.longest_reach:.3g} times the shortest side of the box, with more "
                f"than {MOST_IMAGES} images of the box or {MOST_NEIGHBOURS} neighbours.\n"
                "Try: fewer neighbours (physics.eta or, in the formulation continuum, "
                "physics.spacing_ratio), more particles, or a domain wider along that side.",
                particle,
            )


def _between_walls(x: np.ndarray, lo: float, hi: float) -> tuple[np.ndarray, np.ndarray]:
    """Return reflected positions of points beyond the walls `lo` and `hi`, and if velocity flips.

    A fast particle may be reflected several times in a step; its velocity flips if the number of
    reflections is odd.
    """
    length = hi - lo
    inside = np.where(x < lo, 2 * lo, 2 * hi) - x
    turned = np.ones(x.size, dtype=bool)
    far = (inside < lo) | (inside > hi)  # still outside after one reflection
    rest = np.mod(x[far] - lo, 2 * length)
    back = rest > length
    inside[far] = lo + np.where(back, 2 * length - rest, rest)
    turned[far] = back
    return inside, turned


def _axis_images(lo: float, hi: float, boundary: str, count: int) -> list[tuple[float, float]]:
    """Return (sign, offset) of images in `count` copies of the box each way, identity first."""
    found, length = [(1.0, 0.0)], hi - lo
    if boundary == "open":
        return found
    for k in range(1, count + 1):
        if boundary == "periodic" or k % 2 == 0:  # two reflections are a translation
            found += [(1.0, k * length), (1.0, -k * length)]
        else:
            found += [(-1.0, 2 * lo - (k - 1) * length), (-1.0, 2 * hi + (k - 1) * length)]
    return found
