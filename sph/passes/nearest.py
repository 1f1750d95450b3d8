"""The pass for distances to the nearest neighbour, which show the pairing instability.

With too many neighbours, particles form close pairs if the Fourier transform of the kernel has
negative values (Dehnen & Aly 2012, section 3). Sums over neighbours stay smooth, so pairing shows
only in the distances.

A run needs the distances once, for its summary. This pass therefore has plain loops, which take a
third of the time to compile that vectors take, and looks only into blocks whose box is nearer than
the nearest neighbour so far.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, INLINED
from sph.neighbours.order import BLOCK
from sph.passes.gather import unpacked


@njit(**COMPILED)
def nearest(first, last, dim, _, neighbours, position, support, mass, density, ratio):
    """Write ratio (N,), distance to the nearest neighbour over (m/rho)^(1/D), for superblocks.

    position: (D, N), other arrays (N,). Images of all particles count, including the particle's
    own. inf if there is no neighbour within the support radius.
    """
    lists = neighbours.lists
    sign, offset = neighbours.images
    for superblock in range(first, last):
        begin = lists.start[superblock]
        i_end = min(lists.first[superblock + 1] * BLOCK, mass.size)
        for i in range(lists.first[superblock] * BLOCK, i_end):
            farthest = support[i] * support[i]
            least = farthest
            for t in range(begin, begin + lists.count[superblock]):
                block, image = unpacked(lists.entries[t])
                a, b = block * BLOCK, min((block + 1) * BLOCK, mass.size)
                if _gap(dim, position, i, neighbours.boxes, block, sign, offset, image) < least:
                    for j in range(a, b):
                        squared = _squared(dim, position, i, j, sign, offset, image)
                        if squared < least and (j != i or image != 0):
                            least = squared
            spacing = (mass[i] / density[i]) ** (1.0 / len(dim))
            ratio[i] = np.sqrt(least) / spacing if least < farthest else np.inf


@njit(**INLINED)
def _gap(dim, position, i, boxes, block, sign, offset, image):
    """Return the squared distance of particle i from an image of the box of a block."""
    squared = 0.0
    for d in range(len(dim)):
        s, x = sign[image, d], position[d, i] - offset[image, d]
        a, b = s * boxes[block, d], s * boxes[block, len(dim) + d]
        gap = max(0.0, min(a, b) - x, x - max(a, b))
        squared += gap * gap
    return squared


@njit(**INLINED)
def _squared(dim, position, i, j, sign, offset, image):
    """Return the squared distance of particle i from an image of particle j."""
    squared = 0.0
    for d in range(len(dim)):
        r = position[d, i] - (sign[image, d] * position[d, j] + offset[image, d])
        squared += r * r
    return squared
