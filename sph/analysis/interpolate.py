"""Fields of particles on the pixels of a plane, weighted by the particles' own kernels."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.domain import Domain
from sph.kernels import w


class Plane(NamedTuple):
    """Pixels of a rectangle along x and y; in 3-D it lies at `height` on the z axis."""

    low: np.ndarray  # (2,) corner
    high: np.ndarray  # (2,) opposite corner
    shape: tuple[int, int]  # pixels along x and y
    height: float | None = None

    @classmethod
    def through_centre(cls, box: np.ndarray, pixels: int) -> "Plane":
        """All of a 2-D `box` (D, 2) or the middle of a 3-D one; `pixels` on the longer side."""
        low, high = box[:2, 0], box[:2, 1]
        sides = high - low
        shape = np.maximum(1, np.round(pixels * sides / sides.max())).astype(int)
        height = float(box[2].mean()) if len(box) == 3 else None
        return cls(low, high, (int(shape[0]), int(shape[1])), height)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top."""
        return self.low[0], self.high[0], self.low[1], self.high[1]


def onto_plane(values: np.ndarray, particles, domain: Domain, kernel, plane: Plane) -> np.ndarray:
    """Scalar fields `values` (F, N) of the particles at the centres of the pixels, (F, ny, nx).

    A(x) = sum_j V_j A_j W(x - x_j, H_j) / sum_j V_j W(x - x_j, H_j), V = m/rho, over particles and
    their images (Shepard 1968): a constant field stays constant. NaN where no kernel reaches.
    """
    values = np.ascontiguousarray(values, dtype=np.float64)
    H = particles.support
    # The normalisation C of the kernel cancels.
    weight = particles.mass / (particles.density * H**particles.dimension)
    step = (plane.high - plane.low) / np.array(plane.shape)
    first = plane.low + step / 2
    sums = np.zeros((len(values), plane.shape[1], plane.shape[0]))
    total = np.zeros(sums.shape[1:])
    for sign, offset in zip(*domain.images_within(H.max()), strict=True):
        image = sign[:, None] * particles.position + offset[:, None]
        depth = image[2] - plane.height if particles.dimension == 3 else np.zeros(H.size)
        near = np.flatnonzero(_reaches(image[:2], depth, H, plane))
        if near.size:
            _scatter(
                kernel, (0,) * particles.dimension, image[:2, near], depth[near], H[near],
                weight[near], values[:, near], first, step, total, sums,
            )  # fmt: skip
    with np.errstate(invalid="ignore"):
        return np.where(total > 0.0, sums / total, np.nan)


def _reaches(position, depth, H, plane: Plane) -> np.ndarray:
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
