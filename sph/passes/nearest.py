"""The pass for distances to the nearest neighbour, which show the pairing instability.

With too many neighbours, particles form close pairs if the Fourier transform of the kernel has
negative values (Dehnen & Aly 2012, section 3). Sums over neighbours stay smooth, so pairing shows
only in the distances.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, INLINED, smaller
from sph.neighbours.order import BLOCK
from sph.passes.gather import (
    copy_box,
    largest_of,
    longest_list,
    near_blocks,
    near_particles,
    own_box,
    place_block,
    scratch,
    unit,
    unpacked,
)
from sph.simd import (
    at,
    dot,
    filled,
    lane_max,
    load,
    load_spatial,
    minus,
    select,
    times,
    width,
)


@njit(**COMPILED)
def nearest(first, last, dim, _, neighbours, position, support, mass, density, ratio):
    """Write ratio (N,), distance to the nearest neighbour over (m/rho)^(1/D), for superblocks.

    position: (D, N), other arrays (N,). Images of all particles count, including the particle's
    own. inf if there is no neighbour within the support radius.
    """
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    fields = dim + (0,)  # noqa: RUF005  # position, number of the particle
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), fields)
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        x_0 = at(dim, position, i_0)
        per_length = unit(largest_of(support, i_0, i_end))
        for t in range(lists.count[superblock]):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, 0.0)
            to = t * len(fields) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            _number(copied, to + D * BLOCK, block, image, i_0)
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(
                lanes, dim, boxes, lists.count[superblock], low, high, reach, chosen
            )
            nc = near_particles(
                lanes, dim, copied, fields, 0, chosen, blocks, low, high, reach, near
            )
            for i in range(i_first, i_last):
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                farthest = (support[i] * per_length) ** 2
                least = filled(lanes, farthest)  # not inf: `smaller` is undefined for it
                for k in range(0, nc, width(lanes)):
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    number = load(lanes, near, (D, k))
                    other = abs(number - (i - i_0)) > 0.5
                    least = smaller(least, select(other, dot(r_ij, r_ij), farthest))
                found = -lane_max(-least)
                spacing = (mass[i] / density[i]) ** (1.0 / D) * per_length
                ratio[i] = np.sqrt(found) / spacing if found < farthest else np.inf


@njit(**INLINED)
def _number(copied, begin, block, image, i_0):
    """Write which particles a block has, counted from i_0, to `copied`; -1 for images."""
    for p in range(BLOCK):
        copied[begin + p] = block * BLOCK + p - i_0 if image == 0 else -1
