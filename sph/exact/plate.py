"""Period of the first transverse mode of an elastic plate that is held at one end.

The theory of thin plates has a formula. It neglects shear and the material inside the jaws, so the
period in jaws follows from linear elasticity, solved with finite elements (eq 451).
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

FIRST_ROOT = 1.8751040687119611  # of cos z cosh z = -1: a beam clamped at one end

# Cells around the corners where the jaws end, whose sides halve towards the corner, and cells
# across half of the thickness elsewhere. The period of the default plate changes by 1e-4 of itself
# when both numbers are doubled.
HALVINGS, CELLS = 9, 1


class Material(NamedTuple):
    """A linear elastic solid: density, bulk modulus and shear modulus."""

    density: float
    bulk: float
    shear: float

    @property
    def youngs(self) -> float:
        """Young's modulus."""
        return 9.0 * self.bulk * self.shear / (3.0 * self.bulk + self.shear)

    @property
    def poisson(self) -> float:
        """Poisson's ratio."""
        return (3.0 * self.bulk - 2.0 * self.shear) / (2.0 * (3.0 * self.bulk + self.shear))


def shape(x) -> tuple[np.ndarray, np.ndarray]:
    """Return the deflection of the first mode of a thin plate, 1 at the free end, and its slope.

    x: distance from the clamped end in units of the length, 0 to 1; below 0 both are 0.
    """
    z = FIRST_ROOT * np.maximum(x, 0.0)
    k = FIRST_ROOT
    ratio = (math.cos(k) + math.cosh(k)) / (math.sin(k) + math.sinh(k))
    end = math.cosh(k) - math.cos(k) - ratio * (math.sinh(k) - math.sin(k))
    deflection = np.cosh(z) - np.cos(z) - ratio * (np.sinh(z) - np.sin(z))
    slope = k * (np.sinh(z) + np.sin(z) - ratio * (np.cosh(z) - np.cos(z)))
    return deflection / end, slope / end


def thin_period(length: float, height: float, material: Material) -> float:
    """Return the period of a thin plate clamped at x = 0, in plane strain (eq 450).

    Landau & Lifshitz (1986), Theory of Elasticity, section 25, with the stiffness of a plate.
    """
    stiffness = material.youngs * height**3 / (12.0 * (1.0 - material.poisson**2))
    wave_number = FIRST_ROOT / length
    return 2.0 * math.pi / (wave_number**2 * math.sqrt(stiffness / (material.density * height)))


@lru_cache
def held_period(length: float, height: float, held: float, material: Material) -> float:
    """Return the period of a plate in plane strain, by linear elasticity (eq 451).

    The plate is free from x = 0 to `length`. Rigid jaws hold its part from -held to 0 above, below
    and at the end; held = 0: the section at x = 0 is clamped.
    """
    from scipy.sparse.linalg import eigsh  # costs 0.1 s to import

    half = 0.5 * height
    near = half * np.concatenate([[0.0], 0.5 ** np.arange(HALVINGS - 1.0, -1.0, -1.0)])
    near = _divided(near, CELLS)
    y = np.concatenate([near - half, half - near[-2::-1]])
    x = _beyond(near, half, length)
    if held > 0.0:
        x = np.concatenate([-_beyond(near, half, held)[:0:-1], x])
    stiffness, mass, nodes = _assembled(x, y, material)
    at_wall = np.abs(nodes[1]) > half * (1.0 - 1e-9)
    clamped = (nodes[0] <= x[0]) | ((nodes[0] <= 0.0) & at_wall & (held > 0.0))
    free = np.flatnonzero(np.tile(~clamped, 2))
    lowest = eigsh(
        stiffness[free][:, free].tocsc(), k=1, M=mass[free][:, free].tocsc(), sigma=0.0,
        v0=np.ones(free.size), return_eigenvectors=False,
    )  # fmt: skip
    return float(2.0 * math.pi / math.sqrt(lowest[0]))


def _beyond(near: np.ndarray, half: float, end: float) -> np.ndarray:
    """Return ends of cells from 0 to `end`: those near the corner, then cells of equal sides."""
    if end <= half:
        return near * (end / half)
    cells = max(1, round(CELLS * (end / half - 1.0)))
    return np.concatenate([near, np.linspace(half, end, cells + 1)[1:]])


def _divided(ends: np.ndarray, parts: int) -> np.ndarray:
    """Return the ends of cells, each divided into equal parts."""
    return np.interp(np.arange(parts * (ends.size - 1) + 1) / parts, np.arange(ends.size), ends)


def _assembled(x: np.ndarray, y: np.ndarray, material: Material):
    """Return stiffness and mass matrices of biquadratic elements, and positions of nodes (2, n).

    x, y: ends of the cells. Unknowns: displacement along x of all nodes, then along y. On a grid
    all matrices are Kronecker products of those of one axis.
    """
    from scipy.sparse import bmat, kron

    nodes_x, mass_x, stretch_x, mixed_x = _axis(x)
    nodes_y, mass_y, stretch_y, mixed_y = _axis(y)
    first = material.bulk - 2.0 * material.shear / 3.0  # Lame's constants: first and shear
    along = first + 2.0 * material.shear
    stretched, sheared = kron(stretch_x, mass_y), kron(mass_x, stretch_y)
    coupled = first * kron(mixed_x, mixed_y.T) + material.shear * kron(mixed_x.T, mixed_y)
    stiffness = bmat([
        [along * stretched + material.shear * sheared, coupled],
        [coupled.T, material.shear * stretched + along * sheared],
    ], format="csr")  # fmt: skip
    one = material.density * kron(mass_x, mass_y)
    mass = bmat([[one, None], [None, one]], format="csr")
    positions = np.array([each.ravel() for each in np.meshgrid(nodes_x, nodes_y, indexing="ij")])
    return stiffness, mass, positions


def _axis(ends: np.ndarray):
    """Return nodes and matrices of quadratic elements: int f_a f_b, f_a' f_b' and f_a' f_b."""
    from scipy.sparse import csr_matrix

    sides = np.diff(ends)
    nodes = _divided(ends, 2)
    mass = np.array([[4.0, 2.0, -1.0], [2.0, 16.0, 2.0], [-1.0, 2.0, 4.0]]) / 30.0
    stretch = np.array([[7.0, -8.0, 1.0], [-8.0, 16.0, -8.0], [1.0, -8.0, 7.0]]) / 3.0
    mixed = np.array([[-3.0, -4.0, 1.0], [4.0, 0.0, -4.0], [-1.0, 4.0, 3.0]]) / 6.0
    of_element = 2 * np.arange(sides.size)[:, None, None] + np.arange(3)
    rows, columns = np.broadcast_arrays(of_element.transpose(0, 2, 1), of_element)

    def matrix(each):
        return csr_matrix((each.ravel(), (rows.ravel(), columns.ravel())))

    side = sides[:, None, None]
    ones = np.ones_like(side)
    return nodes, matrix(side * mass), matrix(stretch / side), matrix(ones * mixed)
