"""The box, its boundaries, and the images of particles that stand for them.

An image is an affine map per axis, x -> sign x + offset: a periodic boundary is an offset, a
reflecting wall a sign and an offset. Velocities take the sign. The pair loops know nothing else.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from sph.errors import NumericalError


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
    def _axes(self):
        return zip(self.box, self.boundaries, strict=True)

    @property
    def largest_side(self) -> float:
        return float((self.box[:, 1] - self.box[:, 0]).max())

    @property
    def volume(self) -> float:
        return float(np.prod(self.box[:, 1] - self.box[:, 0]))

    @cached_property
    def images(self) -> Images:
        """The identity and every image that can reach into the box from one box length away."""
        per_axis = [_axis_images(lo, hi, boundary) for (lo, hi), boundary in self._axes]
        combined = list(product(*per_axis))
        sign = np.array([[one[0] for one in image] for image in combined])
        offset = np.array([[one[1] for one in image] for image in combined])
        return Images(sign, offset)

    def bring_inside(self, position, velocities) -> None:
        """Wrap periodic axes and reflect at walls, in place.

        position (D, N); velocities: arrays (D, N) whose component changes sign in a reflection.
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
                for velocity in velocities:
                    velocity[axis, beyond[turned]] *= -1

    @cached_property
    def longest_reach(self) -> float:
        """The widest support that the images serve: infinite where every axis is open."""
        closed = [hi - lo for (lo, hi), kind in self._axes if kind != "open"]
        return float(min(closed, default=np.inf))

    def check_reach(self, reach: float, particle: int) -> None:
        """Raise NumericalError where a kernel's support is wider than the box.

        Each boundary has one image on either side, which serves supports up to one box length.
        """
        for axis, ((lo, hi), boundary) in enumerate(self._axes):
            if boundary != "open" and reach > hi - lo:
                raise NumericalError(
                    f"particle {particle} needs a kernel support of {reach:.4g}, wider than the "
                    f"{boundary} box along {'xyz'[axis]} ({hi - lo:.4g}).\n"
                    "Try: more particles, a smaller physics.eta, or a domain wider along it.",
                    particle,
                )


def _between_walls(x, lo: float, hi: float):
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


def _axis_images(lo: float, hi: float, boundary: str) -> list[tuple[float, float]]:
    """(sign, offset) of the images along one axis, the identity first."""
    if boundary == "periodic":
        return [(1.0, 0.0), (1.0, hi - lo), (1.0, lo - hi)]
    if boundary == "mirror":
        return [(1.0, 0.0), (-1.0, 2 * lo), (-1.0, 2 * hi)]
    return [(1.0, 0.0)]
