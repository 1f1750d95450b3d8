"""Interpolation of particle fields with the kernels: at points and on pixels of a plane.

A(x) = sum_j V_j A_j W(x - x_j, H_j) / sum_j V_j W(x - x_j, H_j), V = m/rho, over particles and
their images (Shepard 1968): a constant field stays constant. NaN where no kernel reaches.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.domain import Domain
from sph.kernels import normalisation, w

# Particles that `at_points` handles at once: some million pairs in 3-D.
CHUNK = 10_000


class Plane(NamedTuple):
    """Pixels of a rectangle along two axes; in 3-D it lies at `height` on the third axis."""

    low: np.ndarray  # (2,) corner
    high: np.ndarray  # (2,) opposite corner
    shape: tuple[int, int]  # pixels along both axes
    height: float | None = None  # None in 2-D, and for projections along the third axis
    axes: tuple[int, int] = (0, 1)  # horizontal and vertical

    @classmethod
    def through_centre(
        cls, box: np.ndarray, pixels: int, axes: tuple[int, int] = (0, 1)
    ) -> "Plane":
        """All of a 2-D `box` (D, 2) or the middle of a 3-D one; `pixels` on the longer side."""
        low, high = box[axes, 0], box[axes, 1]
        sides = high - low
        shape = np.maximum(1, np.round(pixels * sides / sides.max())).astype(int)
        height = float(box[3 - sum(axes)].mean()) if len(box) == 3 else None
        return cls(low, high, (int(shape[0]), int(shape[1])), height, axes)

    @property
    def third(self) -> int:
        """The axis across the plane of a 3-D run."""
        return 3 - sum(self.axes)

    @property
    def step(self) -> np.ndarray:
        """(2,) sides of a pixel."""
        return (self.high - self.low) / np.array(self.shape)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top."""
        return self.low[0], self.high[0], self.low[1], self.high[1]


def at_points(
    scalars: np.ndarray, vector: np.ndarray, particles, domain: Domain, kernel, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Scalar fields (F, N) and a vector field (D, N) at (D, M) points: (F, M) and (D, M).

    Vectors of images behind a mirror are reflected.
    """
    from scipy.spatial import cKDTree  # costs 0.2 s to import, which most runs do not need

    D, H, weight = particles.dimension, particles.support, _weight(particles)
    tree = cKDTree(points.T)
    low, high = points.min(axis=1), points.max(axis=1)
    sums = np.zeros((len(scalars) + D + 1, points.shape[1]))
    for sign, offset in zip(*domain.images_within(H.max()), strict=True):
        image = sign[:, None] * particles.position + offset[:, None]
        values = np.vstack([scalars, sign[:, None] * vector, np.ones_like(H)])
        reaches = (image + H > low[:, None]) & (image - H < high[:, None])
        near = np.flatnonzero(reaches.all(axis=0))
        for j in np.array_split(near, len(near) // CHUNK + 1):
            found = tree.query_ball_point(image[:, j].T, H[j])
            i = np.concatenate([*map(np.asarray, found), np.zeros(0)]).astype(int)
            j = np.repeat(j, [len(one) for one in found])
            q = np.linalg.norm(points[:, i] - image[:, j], axis=0) / H[j]
            share = weight[j] * kernel.w((0,) * D, q)
            for total, value in zip(sums, values, strict=True):
                total += np.bincount(i, share * value[j], total.size)
    found = means(sums[:-1], sums[-1])
    return found[: len(scalars)], found[len(scalars) :]


def onto_plane(
    values: np.ndarray, particles, domain: Domain, kernel, plane: Plane, least: float = 0.0
) -> np.ndarray:
    """Scalar fields `values` (F, N) of the particles at the centres of the pixels, (F, ny, nx).

    NaN where the sum of V W is at most `least`; it is 1 inside matter and 1/2 at a plane surface.
    """
    found, cover = with_cover(values, particles, domain, kernel, plane)
    return np.where(cover > least, found, np.nan)


def with_cover(
    values: np.ndarray, particles, domain: Domain, kernel, plane: Plane
) -> tuple[np.ndarray, np.ndarray]:
    """Scalar fields (F, N) at the centres of the pixels, (F, ny, nx), and sum V W (ny, nx) there.

    Fields are NaN where no kernel reaches.
    """
    values = np.ascontiguousarray(values, dtype=np.float64)
    H, weight = particles.support, _weight(particles)
    step = plane.step
    first = plane.low + step / 2
    sums = np.zeros((len(values), plane.shape[1], plane.shape[0]))
    total = np.zeros(sums.shape[1:])
    for sign, offset in zip(*domain.images_within(H.max()), strict=True):
        image = sign[:, None] * particles.position + offset[:, None]
        depth = np.zeros(H.size)
        if particles.dimension == 3:
            depth = image[plane.third] - plane.height
        flat = image[plane.axes, :]
        near = np.flatnonzero(reaches(flat, depth, H, plane))
        if near.size:
            _scatter(
                kernel, (0,) * particles.dimension, flat[:, near], depth[near], H[near],
                weight[near], values[:, near], first, step, total, sums,
            )  # fmt: skip
    return means(sums, total), total * normalisation(kernel, (0,) * particles.dimension)


def _weight(particles) -> np.ndarray:
    """(N,) V/H^D, the factor before the kernel, whose normalisation cancels."""
    return particles.mass / (particles.density * particles.support**particles.dimension)


def means(sums: np.ndarray, total: np.ndarray) -> np.ndarray:
    """sums (F, …) over the sum of weights (…), NaN where that is zero."""
    with np.errstate(invalid="ignore"):
        return np.where(total > 0.0, sums / total, np.nan)


def reaches(position, depth, H, plane: Plane) -> np.ndarray:
    """Whether kernels at (2, N) positions along the axes of the plane reach it, (N,)."""
    low, high = plane.low[:, None], plane.high[:, None]
    beside = np.all((position + H > low) & (position - H < high), axis=0)
    return beside & (np.abs(depth) < H)


@njit(**COMPILED)
def _scatter(kernel, dim, position, depth, H, weight, values, first, step, total, sums):
    """Add each particle to `total` (ny, nx) and `sums` (F, ny, nx) where its kernel reaches.

    `first` is the centre of the corner pixel. One thread in a fixed order: pictures are the same on
    every machine.
    """
    ny, nx = total.shape
    for j in range(H.size):
        x, y = position[0, j], position[1, j]
        reach = np.sqrt(H[j] * H[j] - depth[j] * depth[j])
        left = max(0, int(np.ceil((x - reach - first[0]) / step[0])))
        right = min(nx - 1, int(np.floor((x + reach - first[0]) / step[0])))
        bottom = max(0, int(np.ceil((y - reach - first[1]) / step[1])))
        top = min(ny - 1, int(np.floor((y + reach - first[1]) / step[1])))
        for b in range(bottom, top + 1):
            dy = first[1] + b * step[1] - y
            for a in range(left, right + 1):
                dx = first[0] + a * step[0] - x
                q = np.sqrt(dx * dx + dy * dy + depth[j] * depth[j]) / H[j]
                share = weight[j] * w(kernel, dim, q)  # zero for q >= 1
                total[b, a] += share
                for f in range(values.shape[0]):
                    sums[f, b, a] += share * values[f, j]
