"""The pass for distances to the nearest neighbour, which show the pairing instability.

With too many neighbours, particles form close pairs if the Fourier transform of the kernel has
negative values (Dehnen & Aly 2012, section 3). Sums over neighbours stay smooth, so pairing shows
only in the distances.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, smaller
from sph.neighbours.order import BLOCK
from sph.passes.gather import most_candidates, place_in, unpacked


@njit(**COMPILED)
def nearest(first_block, last_block, dim, _, neighbours, position, support, mass, density, ratio):
    """Write ratio (N,), distance to the nearest neighbour over (m/rho)^(1/D), for some blocks.

    position: (D, N), other arrays (N,). Images of all particles count, including the particle's
    own. inf if there is no neighbour within the support radius.
    """
    D = len(dim)
    start, count, candidates = neighbours.lists
    sign, offset = neighbours.images
    size = most_candidates(first_block, last_block, count)
    x = np.empty((D, size))
    own = np.empty(size, np.int64)  # the particle that the candidate is; -1 for an image
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            j, image = unpacked(candidates[start[block] + k])
            own[k] = j if image == 0 else -1
            place_in(x, k, position, j, dim, sign, offset, image)
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
