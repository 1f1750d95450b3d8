"""The pass over distances to the nearest neighbour: it tells whether particles have paired.

A kernel whose Fourier transform turns negative pulls particles together in pairs where its support
holds too many neighbours (Dehnen & Aly 2012, section 3). Sums over neighbours stay smooth, so no
density shows it: only the distances do.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, smaller
from sph.neighbours.lists import IMAGE_SHIFT
from sph.neighbours.order import BLOCK


@njit(**COMPILED)
def nearest(first_block, last_block, dim, neighbours, position, support, mass, density, ratio):
    """Write ratio (N,), distance to the nearest neighbour over (m/rho)^(1/D), over blocks.

    Images of all particles count, also those of the particle itself; position is (D, N), the
    others (N,). inf where no neighbour lies within the support.
    """
    D = len(dim)
    lists, images, _, _ = neighbours
    start, count, candidates = lists
    sign, offset = images
    size = 0
    for block in range(first_block, last_block):
        size = max(size, count[block])
    x = np.empty((D, size))
    own = np.empty(size, np.int64)  # the particle that the candidate is; -1 for an image
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            packed = candidates[start[block] + k]
            j = packed & ((1 << IMAGE_SHIFT) - 1)
            image = packed >> IMAGE_SHIFT
            own[k] = j if image == 0 else -1
            for d in range(D):
                x[d, k] = sign[image, d] * position[d, j] + offset[image, d]
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            # not inf: `smaller` is undefined for it
            farthest = support[i] * support[i]
            found = farthest
            for k in range(nc):
                squared = 0.0
                for d in range(D):
                    squared += (position[d, i] - x[d, k]) ** 2
                found = smaller(found, farthest if own[k] == i else squared)
            spacing = (mass[i] / density[i]) ** (1.0 / D)
            ratio[i] = np.sqrt(found) / spacing if found < farthest else np.inf
