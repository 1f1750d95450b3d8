"""Limit on the time steps of neighbours, with individual steps.

By Saitoh & Makino (2009), ApJ 697, L99: no particle may have a step more than RATIO times the one
that the state of a neighbour allows. Otherwise fast gas could reach a particle with a long step,
and pass it, before the particle feels any force.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED
from sph.neighbours.order import BLOCK
from sph.passes.gather import (
    copy_box,
    longest_list,
    middle,
    near_blocks,
    own_box,
    unit,
    unpacked,
)
from sph.simd import rows

RATIO = 4.0


class Blocks(NamedTuple):
    """Extremes of the steps and supports of each block, (blocks,) each."""

    shortest: np.ndarray  # step of all particles
    longest: np.ndarray
    shortest_active: np.ndarray  # step of active particles; inf without any
    longest_active: np.ndarray  # 0 without any
    widest: np.ndarray  # support

    @classmethod
    def empty(cls, number: int) -> "Blocks":
        return cls(*(np.empty(number) for _ in cls._fields))


@njit(**COMPILED)
def survey(first, last, length, support, active, blocks):
    """Set the entries [first, last) of `blocks` from length, support and active, (N,)."""
    for block in range(first, last):
        shortest, longest, widest = np.inf, 0.0, 0.0
        shortest_active, longest_active = np.inf, 0.0
        for i in range(block * BLOCK, min((block + 1) * BLOCK, length.size)):
            shortest, longest = min(shortest, length[i]), max(longest, length[i])
            widest = max(widest, support[i])
            if active[i] > 0.0:
                shortest_active = min(shortest_active, length[i])
                longest_active = max(longest_active, length[i])
        blocks.shortest[block], blocks.longest[block] = shortest, longest
        blocks.shortest_active[block], blocks.longest_active[block] = (
            shortest_active, longest_active
        )  # fmt: skip
        blocks.widest[block] = widest


@njit(**COMPILED)
def limit(first, last, dim, models, neighbours, position, support, length, blocks, allowed):
    """Write to allowed (N,) RATIO times the shortest step of any neighbour, inf if none is shorter.

    For superblocks [first, last). length (N,): the steps; blocks: see `survey`. Neighbours are
    particles within the larger of both support radii. A pair without an active particle was
    considered when the last of both was active, and is left out.
    """
    lists, lanes = neighbours.lists, neighbours.lanes
    room = longest_list(first, last, lists)
    boxes, chosen = rows(lanes, 2 * len(dim) + 1, room + BLOCK), empty(room + BLOCK, np.int32)
    entries = empty(room, np.int64)
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        x_0 = middle(dim, neighbours, begin, end)
        widest = longest = longest_active = 0.0
        for own in range(begin, end):
            widest = max(widest, blocks.widest[own])
            longest = max(longest, blocks.longest[own])
            longest_active = max(longest_active, blocks.longest_active[own])
        per_length = unit(widest)
        for i in range(begin * BLOCK, min(end * BLOCK, length.size)):
            allowed[i] = np.inf
        number = 0
        for t in range(lists.count[superblock]):
            entry = lists.entries[lists.start[superblock] + t]
            block, image = unpacked(entry)
            if _may_limit(blocks, block, longest, longest_active):
                reach = blocks.widest[block] * per_length
                copy_box(dim, boxes, number, neighbours, block, image, x_0, per_length, reach)
                entries[number] = entry
                number += 1
        for own in range(begin, end * min(number, 1)):
            low, high = own_box(dim, neighbours, own, x_0, per_length)
            reach = blocks.widest[own] * per_length
            near = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            for t in range(near):
                block, image = unpacked(entries[chosen[t]])
                if _may_limit(blocks, block, blocks.longest[own], blocks.longest_active[own]):
                    _limit_block(
                        dim, neighbours, position, support, length, own, block, image, allowed
                    )


@njit(**INLINED)
def _may_limit(blocks, block, longest, longest_active):
    """Return whether a block may limit particles of which these are the longest steps."""
    by_active = RATIO * blocks.shortest_active[block] < longest
    return by_active or RATIO * blocks.shortest[block] < longest_active


@njit(**INLINED)
def _limit_block(dim, neighbours, position, support, length, own, block, image, allowed):
    """Limit the particles of the block `own` by an image of another block."""
    sign, offset = neighbours.images
    for i in range(own * BLOCK, min((own + 1) * BLOCK, length.size)):
        for j in range(block * BLOCK, min((block + 1) * BLOCK, length.size)):
            if not RATIO * length[j] < min(length[i], allowed[i]):
                continue
            squared = 0.0
            for d in range(len(dim)):
                r = position[d, i] - (sign[image, d] * position[d, j] + offset[image, d])
                squared += r * r
            H = max(support[i], support[j])
            if squared < H * H:
                allowed[i] = RATIO * length[j]
