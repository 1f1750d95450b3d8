"""Projections of 3-D runs along an axis: column density, and means weighted by mass.

Sigma(x, y) = sum_j m_j F(b_j/H_j)/H_j^2 with F(q) the integral of the kernel along a line of sight
that passes its centre at the distance q (Price 2007). Images behind the ends of the line of
sight are left out: the line ends at walls, where each image brings in what its particle takes out,
or, where the axis is periodic, is one period long.
"""

import numpy as np
from numba import njit

from sph.analysis.interpolate import Plane, means, reaches
from sph.compiled import COMPILED
from sph.domain import Domain
from sph.kernels import normalisation

IN_3D = (0, 0, 0)
NODES = 64  # of the quadrature: exact to 1e-6 for kernels of pieces
KNOTS = 1001  # of the table of F, which is linear between them


def along_sight(
    values: np.ndarray, particles, domain: Domain, kernel, plane: Plane
) -> tuple[np.ndarray, np.ndarray]:
    """Means of fields (F, N) along the third axis, (F, ny, nx), and column density (ny, nx).

    The line of sight goes through all gas. Means are NaN where no kernel reaches. A kernel smaller
    than a pixel is widened to one, so that no mass falls between pixels.
    """
    values = np.ascontiguousarray(values, dtype=np.float64)
    H = np.maximum(particles.support, plane.step.max())
    weight = particles.mass / H**2
    sums = np.zeros((len(values), plane.shape[1], plane.shape[0]))
    column = np.zeros(sums.shape[1:])
    table = columns_of_kernel(kernel)
    for sign, offset in zip(*domain.images_within(H.max()), strict=True):
        if sign[plane.third] != 1.0 or offset[plane.third] != 0.0:
            continue
        image = (sign[:, None] * particles.position + offset[:, None])[plane.axes, :]
        near = np.flatnonzero(reaches(image, np.zeros(H.size), H, plane))
        if near.size:
            _scatter(
                table, image[:, near], H[near], weight[near], values[:, near],
                plane.low + plane.step / 2, plane.step, column, sums,
            )  # fmt: skip
    return means(sums, column), column


def columns_of_kernel(kernel) -> np.ndarray:
    """(KNOTS,) F at distances from 0 to 1, in units of H."""
    q = np.linspace(0.0, 1.0, KNOTS)
    half = np.sqrt(1.0 - q * q)  # of the chord
    node, weight = np.polynomial.legendre.leggauss(NODES)
    along = np.sqrt(q[:, None] ** 2 + (half[:, None] * node) ** 2)
    return normalisation(kernel, IN_3D) * half * (kernel.w(IN_3D, along) @ weight)


@njit(**COMPILED)
def _scatter(table, position, H, weight, values, first, step, column, sums):
    """Add each particle to `column` (ny, nx) and `sums` (F, ny, nx); see `interpolate`."""
    ny, nx = column.shape
    last = table.size - 1
    for j in range(H.size):
        x, y = position[0, j], position[1, j]
        left = max(0, int(np.ceil((x - H[j] - first[0]) / step[0])))
        right = min(nx - 1, int(np.floor((x + H[j] - first[0]) / step[0])))
        bottom = max(0, int(np.ceil((y - H[j] - first[1]) / step[1])))
        top = min(ny - 1, int(np.floor((y + H[j] - first[1]) / step[1])))
        for b in range(bottom, top + 1):
            dy = first[1] + b * step[1] - y
            for a in range(left, right + 1):
                dx = first[0] + a * step[0] - x
                place = np.sqrt(dx * dx + dy * dy) / H[j] * last
                if place >= last:
                    continue
                k = int(place)
                share = weight[j] * (table[k] + (place - k) * (table[k + 1] - table[k]))
                column[b, a] += share
                for f in range(values.shape[0]):
                    sums[f, b, a] += share * values[f, j]
