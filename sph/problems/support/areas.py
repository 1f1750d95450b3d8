"""Parts of a box that contain gas: bodies, slabs and half-spaces, also periodic.

Lower faces belong to a part and upper faces do not, so that adjacent parts share no point.
"""

from dataclasses import dataclass

import numpy as np

from sph.problems.support.bodies import Shape
from sph.problems.support.lattice import fill, grid, unit_cell, whole_cells

ROUNDS = 2  # lattices after the first that `covered` tries to come near a number of particles
FINER = 4  # cells for each particle along an axis in `sampled`, so that counts follow the density


@dataclass(frozen=True, eq=False)  # configurations are compared, and arrays have no truth value
class Everywhere:
    """The whole box."""

    box: np.ndarray  # (D, 2)

    @property
    def extent(self) -> np.ndarray:
        return self.box

    def contains(self, position: np.ndarray) -> np.ndarray:
        return np.ones(position.shape[1], dtype=bool)


@dataclass(frozen=True, eq=False)
class HalfSpace:
    """The side of a plane (3-D), line (2-D) or point to which a normal vector points."""

    box: np.ndarray  # (D, 2)
    point: np.ndarray  # (D,)
    normal: np.ndarray  # (D,)

    @property
    def extent(self) -> np.ndarray:
        return self.box

    def contains(self, position: np.ndarray) -> np.ndarray:
        return ((position - self.point[:, None]) * self.normal[:, None]).sum(axis=0) >= 0.0


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape of `sph.problems.support.bodies`, with its lower faces."""

    shape: Shape

    @property
    def extent(self) -> np.ndarray:
        return self.shape.extent

    def contains(self, position: np.ndarray) -> np.ndarray:
        shape, flat = self.shape, list(self.shape.flat)
        ends = shape.extent[flat]
        within = (ends[:, :1] <= position[flat]) & (position[flat] < ends[:, 1:])
        inside: np.ndarray = np.all(within, axis=0)
        if shape.radial:
            radial = list(shape.radial)
            distance = np.sqrt(((position - shape.centre[:, None])[radial] ** 2).sum(axis=0))
            inside &= (shape.inner <= distance) & (distance < shape.outer)
        return inside


Area = Everywhere | HalfSpace | Solid


def image(position: np.ndarray, area: Area, box: np.ndarray, boundaries) -> np.ndarray:
    """Return the periodic images (D, N) of positions that are nearest to the centre of an area."""
    found = position.copy()
    centre = area.extent.mean(axis=1)
    for axis, kind in enumerate(boundaries):
        if kind == "periodic":
            length = box[axis, 1] - box[axis, 0]
            found[axis] -= length * np.floor((found[axis] - centre[axis]) / length + 0.5)
    return found


def covered(box: np.ndarray, n: int, kind: str, inside) -> tuple[np.ndarray, float]:
    """Return positions (D, N) of a lattice, N near n, and the volume of each particle.

    inside: returns which of the positions (D, M) hold matter (M,); others have no particle.
    """
    position = fill(box, n, kind)
    there = inside(position)
    for _ in range(ROUNDS if there.any() and not there.all() else 0):
        position = fill(box, round(n / there.mean()), kind)
        there = inside(position)
    volume = float(np.prod(box[:, 1] - box[:, 0]))
    return position[:, there], volume / position.shape[1]


def within(box: np.ndarray, extent: np.ndarray, n: float, kind: str) -> tuple[np.ndarray, float]:
    """Return the part near an extent (D, 2) of a lattice that fills `box`, and a particle's volume.

    n: number of particles in the whole box, which is filled by whole cells. The part consists of
    the cells that touch the extent; of all cells along an axis that the extent leaves.
    """
    cell = unit_cell(kind, len(box))
    counts = np.array(whole_cells(box, n / len(cell.sites), cell.sides))
    step = (box[:, 1] - box[:, 0]) / counts
    first = np.floor((extent[:, 0] - box[:, 0]) / step)
    last = np.ceil((extent[:, 1] - box[:, 0]) / step)
    leaves = (first < 0) | (last > counts)
    first, last = np.where(leaves, 0, first), np.where(leaves, counts, last)
    part = box[:, :1] + np.stack([first, last], axis=1) * step[:, None]
    position = grid(part, kind, tuple((last - first).astype(int)))
    return position, float(step.prod()) / len(cell.sites)


def sampled(box: np.ndarray, n: int, density, seed: int) -> tuple[np.ndarray, float]:
    """Return positions (D, n) whose number density follows a density, and the mass of a particle.

    There is no noise on large scales.
    density: returns the values (M,) at positions (D, M). The cells of a fine grid are passed along
    a curve that fills the box. A cell gets a particle, at a random place, wherever the mass passed
    so far exceeds that of another particle.
    """
    fine = fill(box, n * FINER ** min(len(box), 2), "cubic")
    order = _along_curve(fine, box)
    cell = float(np.prod(box[:, 1] - box[:, 0])) / fine.shape[1]
    passed = np.cumsum(density(fine[:, order]) * cell)
    edges = np.floor(passed / passed[-1] * n + 0.5).astype(int)
    copies = np.diff(edges, prepend=0)
    found = np.repeat(fine[:, order], copies, axis=1)
    shift = np.random.default_rng(seed).uniform(-0.49, 0.49, found.shape)
    return found + cell ** (1.0 / len(box)) * shift, float(passed[-1] / n)


def _along_curve(position: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Return the order of positions along a Morton curve."""
    bits = 20
    scaled = (position - box[:, :1]) / (box[:, 1:] - box[:, :1])
    index = np.minimum((scaled * 2**bits).astype(np.int64), 2**bits - 1)
    code = np.zeros(position.shape[1], dtype=np.int64)
    for bit in range(bits):
        for axis in range(len(box)):
            code |= ((index[axis] >> bit) & 1) << (bit * len(box) + axis)
    return np.argsort(code, kind="stable")
