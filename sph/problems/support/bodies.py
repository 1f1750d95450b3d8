"""Solid and liquid bodies: shapes, lattices that fit them, and the search for overlaps.

A shape is a box along some axes times a ball or shell over the others: a box, a disc or sphere, a
ring, a cylinder or tube.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sph.problems.support.lattice import grid, unit_cell

LATTICES = {1: ("cubic",), 2: ("cubic", "hexagonal"), 3: ("cubic", "bcc", "fcc")}
UNIT_BALL = (2.0, np.pi, 4.0 / 3.0 * np.pi)  # volume, by dimension
STRETCH = 0.3  # largest change of a spacing that makes a lattice fit a round shape
TRIED = 4001  # spacings within STRETCH; neighbouring ones differ by 1.5e-4 of themselves
TINY = 1e-9  # of the domain: differences of positions below this are round-off
SAME = 9  # decimals, in spacings, to which sites of one shell have the same distance


class Shape(NamedTuple):
    """A box along some axes times a ball or shell over the axes `radial`."""

    extent: np.ndarray  # (D, 2) bounding box
    radial: tuple[int, ...] = ()
    inner: float = 0.0  # radius of the hole

    @property
    def centre(self) -> np.ndarray:
        """(D,)"""
        return self.extent.mean(axis=1)

    @property
    def outer(self) -> float:
        """Radius along the radial axes."""
        low, high = self.extent[self.radial[0]]
        return float(0.5 * (high - low))

    @property
    def flat(self) -> tuple[int, ...]:
        """The axes along which the shape is a box."""
        return tuple(axis for axis in range(len(self.extent)) if axis not in self.radial)

    @property
    def volume(self) -> float:
        """Volume; an area in 2-D."""
        sides = self.extent[:, 1] - self.extent[:, 0]
        found = float(np.prod(sides[list(self.flat)]))
        if self.radial:
            k = len(self.radial)
            found *= UNIT_BALL[k - 1] * (self.outer**k - self.inner**k)
        return found

    def contains(self, position: np.ndarray) -> np.ndarray:
        """Return a mask (N,) of the positions (D, N) inside; the surface is not inside."""
        low, high = self.extent[:, :1], self.extent[:, 1:]
        inside = np.all((low < position) & (position < high), axis=0)
        if self.radial:
            distance = _distance(position - self.centre[:, None], self.radial)
            inside &= (self.inner < distance) & (distance < self.outer)
        return inside


@dataclass(frozen=True, eq=False)  # configurations are compared, and arrays have no truth value
class Placed:
    """The lattice of one body."""

    shape: Shape
    position: np.ndarray  # (D, N)
    cell: float  # volume of one particle

    @property
    def spacing(self) -> float:
        """Particle spacing, cell^(1/D)."""
        return float(self.cell ** (1.0 / len(self.position)))


def box(low, high) -> Shape:
    """Return the box between two corners, each (D,)."""
    return Shape(np.array([low, high], dtype=float).T)


def ball(centre, radius: float, inner: float = 0.0) -> Shape:
    """Return a disc (2-D), a sphere (3-D), or a ring or shell with the radius `inner` of its hole.

    centre: (D,).
    """
    centre = np.asarray(centre, dtype=float)
    extent = np.stack([centre - radius, centre + radius], axis=1)
    return Shape(extent, tuple(range(centre.size)), inner)


def cylinder(centre, radius: float, length: float, axis: int, inner: float = 0.0) -> Shape:
    """Return a cylinder, or a tube with the inner radius `inner`, along one of the three axes."""
    extent = ball(centre, radius).extent
    extent[axis] = centre[axis] - 0.5 * length, centre[axis] + 0.5 * length
    return Shape(extent, tuple(other for other in range(3) if other != axis), inner)


def place(shape: Shape, kind: str, spacing: float) -> Placed:
    """Return a lattice that fills a shape, with a spacing near `spacing`, the (volume)^(1/D) of a
    particle.

    kind: "cubic", "hexagonal" (2-D), "bcc" or "fcc" (3-D). Along the axes of a box whole cells fill
    the length, so that the outer layers are half a layer from the faces. Over radial axes the
    lattice has a corner of cells in the centre, and its spacing is the nearest to the given one for
    which the particles inside have the volume of the shape (eq 455). Raises ValueError if the shape
    is thinner than the spacing.
    """
    dimension = len(shape.extent)
    cell = unit_cell(kind, dimension)
    sides = np.array(cell.sides)
    sides *= spacing * (len(cell.sites) / sides.prod()) ** (1.0 / dimension)
    lengths = shape.extent[:, 1] - shape.extent[:, 0]
    counts = np.floor(lengths / sides + 0.5).astype(int)
    thin = [axis for axis in shape.flat if counts[axis] < 1]
    if thin:
        raise ValueError(
            f"is {lengths[thin[0]]:.4g} long along {'xyz'[thin[0]]}, less than half a cell of its "
            f"lattice with spacing {spacing:.4g}, so it has no particle. Try: a smaller spacing"
        )
    if not shape.radial:
        position = grid(shape.extent, kind, tuple(counts))
        return Placed(shape, position, shape.volume / position.shape[1])
    return _round(shape, kind, spacing, sides, counts)


def _round(shape: Shape, kind: str, spacing: float, sides, counts) -> Placed:
    """Return the lattice of a shape with radial axes; along the others `counts` cells fill it."""
    radial, flat = list(shape.radial), list(shape.flat)
    reach = shape.outer / (1.0 - STRETCH)
    counts[radial] = 2 * np.ceil(reach / sides[radial]).astype(int)
    around = np.stack([-0.5 * counts * sides, 0.5 * counts * sides], axis=1)
    around[flat] = (shape.extent - shape.centre[:, None])[flat]
    offset = grid(around, kind, tuple(counts))
    cell = float(np.prod(around[:, 1] - around[:, 0]) / offset.shape[1])
    distance = np.round(_distance(offset, shape.radial) / spacing, SAME) * spacing
    shells = np.sort(distance)
    stretch = 1.0 + np.linspace(-STRETCH, STRETCH, TRIED)
    stretch = stretch[np.argsort(np.abs(stretch - 1.0), kind="stable")]
    inside = _count(shells, shape, stretch)
    # the stretch at which that many cells have the volume, if that many are still inside
    power = 1.0 / len(radial)
    fitted = (shape.volume / (np.maximum(inside, 1) * cell)) ** power
    fits = (inside > 0) & (_count(shells, shape, fitted) == inside)
    if not fits.any():
        raise ValueError(
            f"is too thin for a lattice with spacing {spacing:.4g}. Try: a smaller spacing"
        )
    found = fitted[fits][np.argmin(np.abs(fitted[fits] - 1.0))]
    kept = (distance * found > shape.inner) & (distance * found < shape.outer)
    position = offset[:, kept]
    position[radial] *= found
    position += shape.centre[:, None]
    return Placed(shape, position, shape.volume / position.shape[1])


def _count(shells, shape: Shape, stretch) -> np.ndarray:
    """Return how many sites of a stretched lattice, with sorted distances, are inside (M,)."""
    outer = np.searchsorted(shells, shape.outer / stretch, side="left")
    return outer - np.searchsorted(shells, shape.inner / stretch, side="right")


def _distance(offset: np.ndarray, radial: tuple[int, ...]) -> np.ndarray:
    return np.sqrt((offset[list(radial)] ** 2).sum(axis=0))


def outside(shape: Shape, box: np.ndarray, boundaries: tuple[str, ...]) -> str | None:
    """Return along which axis a shape leaves the domain, e.g. "x", or None.

    box: (D, 2). A round shape may have its centre on a mirror, which stands for its other half.
    """
    on_mirror = halved(shape, box, boundaries)
    for axis, ((lo, hi), (low, high)) in enumerate(zip(box, shape.extent, strict=True)):
        tiny = TINY * (hi - lo)
        is_low = on_mirror.get(axis) == lo
        is_high = on_mirror.get(axis) == hi
        if (low < lo - tiny and not is_low) or (high > hi + tiny and not is_high):
            return "xyz"[axis]
    return None


def halved(shape: Shape, box: np.ndarray, boundaries: tuple[str, ...]) -> dict[int, float]:
    """Return the mirrors on which a round shape has its centre: their positions by axis."""
    return {
        axis: float(face)
        for axis in shape.radial
        for face in box[axis]
        if boundaries[axis] == "mirror"
        and abs(shape.centre[axis] - face) <= TINY * (box[axis, 1] - box[axis, 0])
    }


def volume_within(shape: Shape, box: np.ndarray, boundaries: tuple[str, ...]) -> float:
    """Return the volume of a shape without the halves beyond mirrors on which it is centred."""
    return float(shape.volume * 0.5 ** len(halved(shape, box, boundaries)))


def within(placed: Placed, box: np.ndarray) -> Placed:
    """Return a body without the particles beyond the mirrors on which it is centred."""
    inside = ((box[:, :1] <= placed.position) & (placed.position <= box[:, 1:])).all(axis=0)
    return placed if inside.all() else replace(placed, position=placed.position[:, inside])


def overlap(first: Placed, second: Placed) -> bool:
    """Return whether two bodies overlap.

    They do if a particle of one is inside the other, or if two of their particles are closer than
    half of their mean spacing (eq 459).
    """
    from scipy.spatial import cKDTree  # costs 0.1 s to import, which only neighbouring bodies need

    reach = 0.25 * (first.spacing + second.spacing)
    one, other = _near(first, second, reach), _near(second, first, reach)
    if not one.size or not other.size:
        return False
    if first.shape.contains(other).any() or second.shape.contains(one).any():
        return True
    apart, _ = cKDTree(one.T).query(other.T, distance_upper_bound=reach)
    return bool(np.isfinite(apart).any())


def _near(body: Placed, other: Placed, reach: float) -> np.ndarray:
    """Return the particles (D, M) of a body within `reach` of the bounding box of another."""
    low, high = other.shape.extent[:, :1] - reach, other.shape.extent[:, 1:] + reach
    return body.position[:, ((low <= body.position) & (body.position <= high)).all(axis=0)]


def of_one_material(placed: tuple[Placed, ...], velocities, density: float) -> tuple:
    """Return position, velocity (D, N) and mass (N,) of bodies of one density; mass as in eq 455.

    velocities: one (D,) for each body.
    """
    counts = [one.position.shape[1] for one in placed]
    return (
        np.hstack([one.position for one in placed]),
        np.repeat(np.array(velocities, dtype=float).T, counts, axis=1),
        density * np.repeat([one.cell for one in placed], counts),
    )
