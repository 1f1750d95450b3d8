"""Particle placement: lattices of cells of equal volume, noise, and a disordered glass.

Every lattice is a stack of layers along x. A layer holds the sites of a rectangular grid in y and
z. Layers of two-site cells (hexagonal, BCC, FCC) alternate between two offsets. Sites lie inside
the cells, so no particle lies on a face of the box, and periodic images continue the lattice.
"""

from typing import NamedTuple

import numpy as np


class Cell(NamedTuple):
    """Unit cell of a lattice. Sites are equidistant along x, one per layer."""

    sides: tuple[float, ...]  # (D,) relative lengths
    sites: tuple[tuple[float, ...], ...]  # each (D,), as fractions of the sides


# Volume of a cube of side 2 over that of the ball in it, by dimension
CUBE_OVER_BALL = (1.0, 4.0 / np.pi, 6.0 / np.pi)

_STAGGERED = (0.25, 0.75)


def unit_cell(kind: str, dimension: int) -> Cell:
    """Return the cell of "cubic" (any dimension), "hexagonal" (2-D), "bcc" or "fcc" (3-D).

    FCC, the closest packing of spheres, is BCC whose cell is longer along x by the root of 2.
    Raises ValueError for another name or dimension.
    """
    if kind == "cubic":
        return Cell((1.0,) * dimension, ((0.5,) * dimension,))
    own_dimension = {"hexagonal": 2, "bcc": 3, "fcc": 3}.get(kind)
    if own_dimension is None:
        raise ValueError(
            f'lattice "{kind}": expected "cubic", "hexagonal" (2-D), "bcc" or "fcc" (3-D)'
        )
    if dimension != own_dimension:
        instead = {2: '"cubic" or "hexagonal"', 3: '"cubic" or "bcc"'}.get(dimension, '"cubic"')
        raise ValueError(
            f'lattice "{kind}" exists only in {own_dimension}-D; expected {instead} in '
            f"{dimension}-D"
        )
    sides = {"hexagonal": (1.0, np.sqrt(3.0)), "fcc": (np.sqrt(2.0), 1.0, 1.0)}
    return Cell(sides.get(kind, (1.0,) * 3), tuple((offset,) * dimension for offset in _STAGGERED))


def checked(kind: str, dimension: int | None) -> str:
    """Return `kind`. Raises ValueError if that lattice does not exist in `dimension`."""
    if dimension is not None and kind not in ("relaxed", "random"):
        unit_cell(kind, dimension)
    return kind


def whole_cells(box: np.ndarray, cells: float, sides, multiple: int = 1) -> tuple[int, ...]:
    """Return the numbers of cells along each axis of `box` (D, 2), with a product near `cells`.

    Cells have nearly the shape `sides` (D,): the number along one axis is a whole number, those
    along the others are rounded, so axes of equal length get equal numbers. Each number is a
    multiple of `multiple`.
    """
    lengths = (box[:, 1] - box[:, 0]) / np.asarray(sides)
    scale = (lengths.prod() / cells) ** (1.0 / lengths.size)
    ideal = lengths / (scale * multiple)
    candidates = []
    for axis_ideal in ideal:
        for whole in {max(1, int(axis_ideal)), int(axis_ideal) + 1}:
            counts = np.maximum(1, np.floor(ideal * (whole / axis_ideal) + 0.5)).astype(int)
            candidates.append(tuple(int(count) * multiple for count in counts))
    return min(candidates, key=lambda counts: (abs(int(np.prod(counts)) - cells), counts))


def stack(cell: Cell, layers: range, origin: float, thickness: float, across, counts) -> np.ndarray:
    """Return positions (D, N) of layers; layer i is centred at x = origin + (i + 1/2) thickness.

    `across` (D - 1, 2) and `counts` (D - 1) are the box and the number of cells along y and z.
    Indices may be negative: stacks on both sides of `origin` form one lattice.
    """
    index = np.arange(layers.start, layers.stop)
    per_layer = int(np.prod(counts))  # 1 in 1-D
    corner = np.indices(counts).reshape(len(counts), per_layer)
    across = np.asarray(across, dtype=float).reshape(len(counts), 2)
    step = (across[:, 1] - across[:, 0]) / np.asarray(counts, dtype=float)
    sites = np.array([site[1:] for site in cell.sites])[:, :, None]  # (sites, D - 1, 1)
    in_layer = across[:, :1] + step[:, None] * (corner + sites)  # (sites, D - 1, per layer)
    x = np.repeat(origin + (index + 0.5) * thickness, per_layer)
    yz = in_layer[index % len(cell.sites)].transpose(1, 0, 2).reshape(len(counts), x.size)
    return np.vstack([x[None], yz])


def grid(box: np.ndarray, kind: str, counts) -> np.ndarray:
    """Return positions (D, N) of a lattice of `counts` (D) cells stretched to fill `box` (D, 2)."""
    cell = unit_cell(kind, len(box))
    layers = counts[0] * len(cell.sites)
    thickness = (box[0, 1] - box[0, 0]) / layers
    return stack(cell, range(layers), box[0, 0], thickness, box[1:], tuple(counts[1:]))


def fill(box: np.ndarray, n: int, kind: str, seed: int = 0, even: bool = False) -> np.ndarray:
    """Return positions (D, N) that fill `box` (D, 2), with equal volumes and N close to n.

    kind: a lattice of `unit_cell`; "relaxed", a periodic glass; or "random", uniformly distributed
    positions. The last two use random numbers with `seed`. even: use an even number of cells along
    each axis, so that the centre of the box is a corner of cells. Raises ValueError for a lattice
    that does not exist in D dimensions.
    """
    box = np.asarray(box, dtype=float)
    if kind == "random":
        return np.random.default_rng(seed).uniform(box[:, :1], box[:, 1:], (len(box), n))
    multiple = 2 if even else 1
    cell = unit_cell("cubic" if kind == "relaxed" else kind, len(box))
    counts = whole_cells(box, n / len(cell.sites), cell.sides, multiple)
    if kind == "relaxed":
        return _relaxed(box, grid(box, "cubic", counts), seed)
    return grid(box, kind, counts)


def ball(n: int, kind: str, dimension: int, seed: int = 0) -> np.ndarray:
    """Return positions (D, N) in a ball of radius 1 around the origin, with N close to n.

    kind: a lattice of `unit_cell`, or "relaxed". The ball ends between two shells of the lattice
    where the number of sites inside equals volume over that of a cell, so the share of the
    particles within r is r^D except for the granularity of the lattice.
    """
    margin = 1.1  # of the cube, so that there is such an end on either side of n
    cube = margin * np.array([[-1.0, 1.0]] * dimension)
    sites = max(4**dimension, round(n * margin**dimension * CUBE_OVER_BALL[dimension - 1]))
    position = fill(cube, sites, kind, seed, even=True)
    cell = CUBE_OVER_BALL[dimension - 1] * margin**dimension / position.shape[1]  # of the ball
    distance = np.sqrt((position**2).sum(axis=0))
    order = np.argsort(distance, kind="stable")
    shells, count = distance[order], np.arange(1, distance.size)
    end = (count * cell) ** (1.0 / dimension)
    fits = (shells[:-1] <= end) & (end < shells[1:]) & (end < margin)
    if not fits.any():
        raise ValueError(f"n = {n}: expected more particles for a ball of a lattice")
    chosen = int(np.argmin(np.where(fits, np.abs(count - n), n + distance.size)))
    return position[:, np.sort(order[: chosen + 1])] / end[chosen]


def spacing(box: np.ndarray, n: int) -> float:
    """Return the particle spacing of n particles in `box` (D, 2): (volume/n)^(1/D)."""
    return float((np.prod(box[:, 1] - box[:, 0]) / n) ** (1.0 / len(box)))


def with_noise(position: np.ndarray, box: np.ndarray, fraction: float, seed: int) -> np.ndarray:
    """Return positions (D, N) with uniform random shifts of up to `fraction` spacings per axis.

    Particles that leave `box` (D, 2) are wrapped to the other side.
    """
    reach = fraction * spacing(box, position.shape[1])
    moved = position + np.random.default_rng(seed).uniform(-reach, reach, position.shape)
    return _wrapped(moved, box)


def _wrapped(position: np.ndarray, box: np.ndarray) -> np.ndarray:
    low, length = box[:, :1], box[:, 1:] - box[:, :1]
    inside = low + np.mod(position - low, length)
    return np.where(inside >= box[:, 1:], low, inside)  # mod of a tiny negative number is `length`


# Repulsion of the glass: range and strength in spacings, and number of sweeps. With Wendland C2 at
# eta = 1.6, the density then scatters by 0.5 % in 2-D and 0.2 % in 3-D (10 % and 7 % before), and
# particles are at least 0.85 spacings apart. A range of 1.6 gives 0.9 % and 0.6 %; 100 sweeps take
# 1.7 times as long and give 0.4 % and 0.2 %.
_REACH, _STRENGTH, _SWEEPS = 2.0, 0.5, 60


def _relaxed(box: np.ndarray, position: np.ndarray, seed: int) -> np.ndarray:
    """Return a periodic glass: a random position in each cell, relaxed by repulsion in sweeps.

    The initial positions have no density waves longer than a few cells, which short-range repulsion
    could not remove.
    """
    from scipy.spatial import cKDTree  # costs 0.1 s to import, which only a glass needs

    low, length = box[:, :1], box[:, 1:] - box[:, :1]
    position = with_noise(position, box, 0.5, seed)
    side = spacing(box, position.shape[1])
    reach = min(_REACH * side, 0.49 * length.min())
    for _ in range(_SWEEPS):
        inside = _wrapped(position, box) - low
        tree = cKDTree(inside.T, boxsize=length[:, 0])
        first, second = tree.query_pairs(reach, output_type="ndarray").T
        apart = inside[:, first] - inside[:, second]
        apart -= length * np.round(apart / length)
        distance = np.maximum(np.sqrt((apart**2).sum(axis=0)), 1e-12 * side)
        push = _STRENGTH * side * (1.0 - distance / reach) ** 2 * apart / distance
        position = inside + low
        for axis, along in enumerate(push):
            position[axis] += np.bincount(first, along, position.shape[1])
            position[axis] -= np.bincount(second, along, position.shape[1])
    return _wrapped(position, box)
