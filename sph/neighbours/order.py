"""Block order of particles: median splits along the longest axis down to BLOCK particles.

Blocks are contiguous ranges of the order and the leaves of an implicit binary tree. Node k has the
children 2k + 1 and 2k + 2 and covers blocks [first, last), split at their middle. The order depends
only on positions and IDs, not on the previous order or on threads.
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.threads import SMALLEST_RANGE, Team

BLOCK = 8  # particles per block; 4 and 16 were 20-40 % slower in 3-D (density, rates and lists)


def number_of_blocks(n: int) -> int:
    return (n + BLOCK - 1) // BLOCK


@njit(**COMPILED)
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


@njit(**COMPILED)
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


@njit(**COMPILED)
def _sort_by_id(order, identity, a, b):
    for p in range(a + 1, b):
        moved = order[p]
        q = p - 1
        while q >= a and identity[order[q]] > identity[moved]:
            order[q + 1] = order[q]
            q -= 1
        order[q + 1] = moved


@njit(**COMPILED)
def _split(position, identity, order, key, first, last, levels):
    """Split blocks [first, last) `levels` times, or down to single blocks."""
    n = order.size
    stack = [(first, last, levels)]
    while len(stack) > 0:
        first, last, levels = stack.pop()
        a, b = first * BLOCK, min(last * BLOCK, n)
        if last - first <= 1:
            _sort_by_id(order, identity, a, b)
            continue
        if levels == 0:
            continue
        middle = (first + last) // 2
        axis = _longest_axis(position, order, a, b)
        for p in range(a, b):
            key[p] = position[axis, order[p]]
        _select(key, order, identity, a, b, middle * BLOCK)
        stack.append((first, middle, levels - 1))
        stack.append((middle, last, levels - 1))


@njit(**COMPILED)
def _split_subtrees(first_tree, last_tree, position, identity, order, key, levels):
    """Split the subtrees [first_tree, last_tree) of the 2^levels that `_split` left."""
    blocks = (order.size + BLOCK - 1) // BLOCK
    for tree in range(first_tree, last_tree):
        a, b = 0, blocks
        for level in range(levels - 1, -1, -1):
            middle = (a + b) // 2
            if (tree >> level) & 1:
                a = middle
            else:
                b = middle
        if b > a:
            _split(position, identity, order, key, a, b, 64)


def block_order(position: np.ndarray, identity: np.ndarray, team: Team) -> np.ndarray:
    """Return the block order, (N,) indices. position: (D, N), identity: (N,) IDs, team: threads."""
    n = identity.size
    order = np.arange(n)
    key = np.empty(n)
    # about four subtrees per thread balance the load; smaller numbers of blocks are not shared
    shared = team.threads > 1 and number_of_blocks(n) > 4 * team.threads * SMALLEST_RANGE
    levels = (4 * team.threads - 1).bit_length() if shared else 0
    _split(position, identity, order, key, 0, number_of_blocks(n), levels)
    team.run(_split_subtrees, 1 << levels, position, identity, order, key, levels, smallest=1)
    return order
