"""Bounding boxes of the block tree, with the largest support radius in each node."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED
from sph.neighbours.order import BLOCK


class Tree(NamedTuple):
    """Nodes by heap index: node k has children 2k + 1 and 2k + 2; unused nodes have first = -1."""

    first: np.ndarray  # (nodes,) first block
    last: np.ndarray  # (nodes,) one past the last block
    lower: np.ndarray  # (nodes, D)
    upper: np.ndarray  # (nodes, D)
    support: np.ndarray  # (nodes,) largest H


@njit(**COMPILED)
def build(position: np.ndarray, support: np.ndarray) -> Tree:
    """Return the tree of particles in block order: position (D, N), support (N,)."""
    D, n = position.shape
    blocks = (n + BLOCK - 1) // BLOCK
    depth = 0
    while (1 << depth) < blocks:
        depth += 1
    nodes = (1 << (depth + 1)) - 1
    first = empty(nodes, np.int64)
    last = empty(nodes, np.int64)
    lower = empty((nodes, D), np.float64)
    upper = empty((nodes, D), np.float64)
    largest = empty(nodes, np.float64)
    for k in range(nodes):  # not np.full, which takes longer to compile
        first[k], last[k] = -1, -1
    first[0], last[0] = 0, blocks
    for k in range(nodes):
        if last[k] - first[k] > 1:
            middle = (first[k] + last[k]) // 2
            first[2 * k + 1], last[2 * k + 1] = first[k], middle
            first[2 * k + 2], last[2 * k + 2] = middle, last[k]
    for k in range(nodes - 1, -1, -1):
        if first[k] < 0:
            continue
        if last[k] - first[k] == 1:
            a, b = first[k] * BLOCK, min(last[k] * BLOCK, n)
            for d in range(D):
                lo = hi = position[d, a]
                for p in range(a + 1, b):
                    lo = min(lo, position[d, p])
                    hi = max(hi, position[d, p])
                lower[k, d], upper[k, d] = lo, hi
            size = support[a]
            for p in range(a + 1, b):
                size = max(size, support[p])
            largest[k] = size
        else:
            left, right = 2 * k + 1, 2 * k + 2
            for d in range(D):
                lower[k, d] = min(lower[left, d], lower[right, d])
                upper[k, d] = max(upper[left, d], upper[right, d])
            largest[k] = max(largest[left], largest[right])
    return Tree(first, last, lower, upper, largest)
