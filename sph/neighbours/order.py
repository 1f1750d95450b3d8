"""Block order of particles: median splits along the longest axis down to BLOCK particles.

Blocks are contiguous ranges of the order and the leaves of an implicit binary tree. Node k has the
children 2k + 1 and 2k + 2 and covers blocks [first, last), split at their middle. The order depends
only on positions and IDs, not on the previous order or on threads.
"""

import itertools
import math

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED
from sph.threads import CHUNK, SMALLEST_RANGE, Team

BLOCK = 8  # particles per block; 4 and 16 were 20-40 % slower in 3-D (density, rates and lists)

# Smallest number of particles that all threads split together; below, a thread is as fast.
LARGE = 16 * CHUNK
SAMPLE = 4096  # number of particles that bound the median


def number_of_blocks(n: int) -> int:
    return (n + BLOCK - 1) // BLOCK


@njit(**INLINED)
def _before(key_a, id_a, key_b, id_b):
    return key_a < key_b or (key_a == key_b and id_a < id_b)


@njit(**COMPILED)
def _select(key, order, identity, a, b, k):
    """Partition [a, b) in place at index k of the sorted order (quickselect)."""
    lo, hi = a, b - 1
    while hi > lo:
        middle = (lo + hi) // 2
        # median of three: sorted input is then the best case instead of the worst
        for p, q in ((lo, middle), (lo, hi), (middle, hi)):
            if _before(key[q], identity[order[q]], key[p], identity[order[p]]):
                key[p], key[q] = key[q], key[p]
                order[p], order[q] = order[q], order[p]
        pivot, pivot_id = key[middle], identity[order[middle]]
        i, j = lo, hi
        while i <= j:
            while _before(key[i], identity[order[i]], pivot, pivot_id):
                i += 1
            while _before(pivot, pivot_id, key[j], identity[order[j]]):
                j -= 1
            if i <= j:
                key[i], key[j] = key[j], key[i]
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if k <= j:
            hi = j
        elif k >= i:
            lo = i
        else:
            return


@njit(**INLINED)
def _longest_axis(position, order, a, b):
    best, axis = -1.0, 0
    if position.shape[0] == 1:
        return axis
    for d in range(position.shape[0]):
        lo = hi = position[d, order[a]]
        for p in range(a + 1, b):
            x = position[d, order[p]]
            lo = min(lo, x)
            hi = max(hi, x)
        if hi - lo > best:
            best, axis = hi - lo, d
    return axis


@njit(**INLINED)
def _sort_by_id(order, identity, a, b):
    for p in range(a + 1, b):
        moved = order[p]
        q = p - 1
        while q >= a and identity[order[q]] > identity[moved]:
            order[q + 1] = order[q]
            q -= 1
        order[q + 1] = moved


@njit(**COMPILED)
def _split(first, last, position, identity, order, key, edges, depth):
    """Split nodes [first, last) `depth` times, or to single blocks.

    Node k of a level covers the blocks [edges[k], edges[k + 1]).
    """
    n = order.size
    stack = empty((64, 3), np.int64)  # of nodes: first block, last block, depth
    for node in range(first, last):
        # not stack[0] = ..., whose conversion of a tuple to an array takes seconds to compile
        stack[0, 0], stack[0, 1], stack[0, 2] = edges[node], edges[node + 1], depth
        size = 1
        while size > 0:
            size -= 1
            begin, end, rest = stack[size, 0], stack[size, 1], stack[size, 2]
            a, b = begin * BLOCK, min(end * BLOCK, n)
            if end - begin <= 1:
                _sort_by_id(order, identity, a, b)
                continue
            if rest == 0:
                continue
            middle = (begin + end) // 2
            axis = _longest_axis(position, order, a, b)
            for p in range(a, b):
                key[p] = position[axis, order[p]]
            _select(key, order, identity, a, b, middle * BLOCK)
            for half, (start, stop) in enumerate(((begin, middle), (middle, end))):
                stack[size + half, 0] = start
                stack[size + half, 1] = stop
                stack[size + half, 2] = rest - 1
            size += 2


def _split_by_team(position, identity, order, key, first, last, team):
    """Split the node of blocks [first, last) once, by all threads of the team."""
    a, b = first * BLOCK, min(last * BLOCK, order.size)
    k = (first + last) // 2 * BLOCK
    part, axis = order[a:b], 0
    if position.shape[0] > 1:
        low, high = zip(*team.run(_extent, b - a, position, part, smallest=CHUNK), strict=True)
        axis = int(np.argmax(np.max(high, axis=0) - np.min(low, axis=0)))
    # two bounds that enclose the key at k, except where a sample of the keys is unlikely
    sample = np.sort(position[axis].take(part[:: max(1, part.size // SAMPLE)]))
    rank = (k - a) * sample.size // part.size
    margin = 2 * math.isqrt(sample.size)
    low, high = sample[max(0, rank - margin)], sample[min(sample.size - 1, rank + margin)]
    pieces = team.run(_deal, b - a, position[axis], part, low, high, smallest=CHUNK)
    less, between, more = zip(*pieces, strict=True)
    np.concatenate([*less, *between, *more], out=part)
    begin, end = a + sum(map(len, less)), b - sum(map(len, more))
    if not begin <= k < end:
        begin, end = a, b
    key[begin:end] = position[axis].take(order[begin:end])
    _select(key, order, identity, begin, end, k)


def _extent(first, last, position, part):
    """Return the smallest and the largest position of particles part[first:last], (D,) each."""
    rows = [row.take(part[first:last]) for row in position]
    return [row.min() for row in rows], [row.max() for row in rows]


def _deal(first, last, coordinate, part, low, high):
    """Return the particles of part[first:last] below `low`, from there to `high`, and above."""
    particles = part[first:last]
    key = coordinate.take(particles)
    below, above = key < low, key > high
    return particles[below], particles[~(below | above)], particles[above]


def block_order(position: np.ndarray, identity: np.ndarray, team: Team) -> np.ndarray:
    """Return the block order, (N,) indices. position: (D, N), identity: (N,) IDs, team: threads."""
    n = identity.size
    order = np.arange(n)
    key = np.empty(n)
    arrays = position, identity, order, key
    # about four subtrees per thread balance the load; smaller numbers of blocks are not shared
    blocks = number_of_blocks(n)
    shared = team.threads > 1 and blocks > 8 * SMALLEST_RANGE
    levels = (4 * team.threads - 1).bit_length() if shared else 0
    while levels > 0 and blocks < SMALLEST_RANGE << levels:
        levels -= 1
    edges = np.array([0, blocks])
    for _ in range(levels):
        nodes = edges.size - 1
        if nodes < team.threads and n // nodes >= LARGE:
            for first, last in itertools.pairwise(edges.tolist()):
                _split_by_team(*arrays, first, last, team)
        else:
            team.run(_split, nodes, *arrays, edges, 1, smallest=1)
        edges = np.sort(np.append(edges, (edges[:-1] + edges[1:]) // 2))
    team.run(_split, edges.size - 1, *arrays, edges, 64, smallest=1)
    return order
