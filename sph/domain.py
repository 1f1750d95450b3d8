"""The box, its boundaries, and the images of particles that stand for them.

An image is an affine map per axis, x -> sign x + offset: a periodic boundary is an offset, a
reflecting wall a sign and an offset. Velocities take the sign. The pair loops know nothing else.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from sph.errors import NumericalError

# Images of the box that a support may take: 4 copies either way along three axes, 499 along one.
MOST_IMAGES = 1000

# Neighbours in a support that is wider than the box, a hundred times as many as any kernel needs:
# beyond, lists would fill the memory.
MOST_NEIGHBOURS = 100_000

# Copies of the box that are too many to count.
FAR = 1e6


class Images(NamedTuple):
    """K maps of the domain; the first is the identity."""

    sign: np.ndarray  # (K, D)
    offset: np.ndarray  # (K, D)


@dataclass(frozen=True)
class Domain:
    """`box` (D, 2): lower and upper end of each axis; `boundaries`: one name for each of them."""

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
        """The identity and every image that can reach into the box from one box length away."""
        return self._images((1,) * len(self.boundaries))

    def images_within(self, reach: float) -> Images:
        """The identity and every image that can come within `reach` of the box.

        Those of `images` for a reach up to the shortest closed axis; a thin box has more.
        """
        return self._images(self._cells_within(reach))

    def _cells_within(self, reach: float) -> tuple[int, ...]:
        """How many copies of the box either way a reach covers, for each axis; at least 1."""
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
        """Images that have been asked for, by the copies of the box along each axis."""
        return {}

    def bring_inside(self, position: np.ndarray, others: Iterable[np.ndarray]) -> None:
        """Wrap periodic axes and reflect at walls, in place.

        position (D, N); others: vectors (D, N), whose component changes sign in a reflection, and
        tensors (D, D, N), whose mixed components do.
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
        """The widest support that `images` serves: infinite where every axis is open."""
        closed = [hi - lo for (lo, hi), kind in self._axes if kind != "open"]
        return float(min(closed, default=np.inf))

    def check_reach(self, reach: float, number: int, particle: int) -> None:
        """Raise NumericalError where a support of that radius is too wide for the box.

        That is where it takes more than MOST_IMAGES of the box or, of `number` particles in it and
        in these images, more than MOST_NEIGHBOURS.
        """
        if reach <= self.longest_reach:
            return
        closed = [kind != "open" for kind in self.boundaries]
        cells = np.array(self._cells_within(reach))[closed]
        with np.errstate(over="ignore"):
            copies = np.prod([min(2 * reach / (hi - lo), FAR) for lo, hi in self.box[closed]])
        if np.prod(2.0 * cells + 1.0) > MOST_IMAGES or number * copies > MOST_NEIGHBOURS:
            raise NumericalError(
                f"particle {particle} needs a kernel support of {reach:.4g}, "
                f"{reach / self.longest_reach:.3g} times the shortest side of the box, with more "
                f"than {MOST_IMAGES} images of the box or {MOST_NEIGHBOURS} neighbours in it.\n"
                "Try: a smaller physics.eta, more particles, or a domain wider along that side.",
                particle,
            )


def _between_walls(x: np.ndarray, lo: float, hi: float) -> tuple[np.ndarray, np.ndarray]:
    """Where points beyond walls at `lo` and `hi` come to rest, and whether they have turned.

    A fast particle may meet walls many times in a step; each second time it goes on as before.
    """
    length = hi - lo
    inside = np.where(x < lo, 2 * lo, 2 * hi) - x
    turned = np.ones(x.size, dtype=bool)
    far = (inside < lo) | (inside > hi)  # once is not enough
    rest = np.mod(x[far] - lo, 2 * length)
    back = rest > length
    inside[far] = lo + np.where(back, 2 * length - rest, rest)
    turned[far] = back
    return inside, turned


def _axis_images(lo: float, hi: float, boundary: str, count: int) -> list[tuple[float, float]]:
    """(sign, offset) of the images in `count` copies of the box either way, the identity first."""
    found, length = [(1.0, 0.0)], hi - lo
    if boundary == "open":
        return found
    for k in range(1, count + 1):
        if boundary == "periodic" or k % 2 == 0:  # reflected twice is moved
            found += [(1.0, k * length), (1.0, -k * length)]
        else:
            found += [(-1.0, 2 * lo - (k - 1) * length), (-1.0, 2 * hi + (k - 1) * length)]
    return found
