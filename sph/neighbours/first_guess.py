"""Supports to begin the search of the true ones with, from positions alone."""

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.neighbours import BALL, tree
from sph.neighbours.order import BLOCK

# Levels of the tree, from the blocks upwards, at which the spacing is read: 8 to 64 particles.
GUESS_LEVELS = 4

# Where a guess holds so many times the particles that it is meant to hold, it is halved: lists of
# them would fill the memory before the true support was found.
TOO_MANY = 8.0

HALVINGS = 60


@njit(**COMPILED, forceinline=True)
def _spacing(lower, upper, n):
    """Spacing s of n particles in a box: s apart along axes, they span prod (e + s) = n s^D."""
    D = lower.size
    extent = upper - lower
    spacing = extent.max()
    for _ in range(30):  # a contraction: each pass halves the error at the least
        spacing = (np.prod(extent + spacing) / n) ** (1 / D)
    return spacing


@njit(**COMPILED)
def from_spacing(position: np.ndarray, ratio: float) -> np.ndarray:
    """Supports (N,) for positions (D, N) in block order.

    ratio = (H/h) eta times the least spacing of the boxes that hold the particle. (A box that cuts
    through planes of a lattice, or a gradient of density, shows too wide a spacing: supports that
    begin too wide cost lists of many candidates, ones too narrow only a second build.)
    """
    n = position.shape[1]
    first, last, lower, upper, _ = tree.build(position, np.zeros(n))
    # where particles coincide there is no spacing to be seen: begin from a small support
    least = 1e-6 * _spacing(lower[0], upper[0], n)
    guess = np.empty(n)
    for leaf in range(first.size):
        if last[leaf] - first[leaf] != 1:
            continue
        spacing = np.inf
        node = leaf
        for _ in range(GUESS_LEVELS):
            count = min(last[node] * BLOCK, n) - first[node] * BLOCK
            if count > 1:  # one particle alone spans nothing
                spacing = min(spacing, _spacing(lower[node], upper[node], count))
            node = max(0, (node - 1) // 2)
        guess[first[leaf] * BLOCK : last[leaf] * BLOCK] = ratio * max(spacing, least)
    return guess


@njit(**COMPILED)
def trim(position: np.ndarray, ratio: float, least: float, guess: np.ndarray) -> None:
    """Halve the guesses (N,) that hold far too many particles, for positions in block order.

    None goes below `least`. A support is meant to hold those of a ball of radius `ratio` spacings.
    """
    D, n = position.shape
    boxes = tree.build(position, guess)
    most = TOO_MANY * BALL[D - 1] * ratio**D
    centre = np.empty(D)
    for leaf in range(boxes.first.size):
        if boxes.last[leaf] - boxes.first[leaf] != 1:
            continue
        a, b = boxes.first[leaf] * BLOCK, min(boxes.last[leaf] * BLOCK, n)
        for d in range(D):
            centre[d] = 0.5 * (boxes.lower[leaf, d] + boxes.upper[leaf, d])
        H = guess[a]
        for _ in range(HALVINGS):
            half = 0.5 * H
            if half <= least or _held(boxes, position, centre, H, most) <= most:
                break
            H = half
        guess[a:b] = H


@njit(**COMPILED)
def _held(boxes, position, centre, radius, enough):
    """Number of particles in a ball; the count ends where it exceeds `enough`."""
    D, n = position.shape
    held = 0
    stack = np.empty(128, np.int64)
    stack[0] = 0
    depth = 1
    while depth > 0 and not held > enough:
        depth -= 1
        node = stack[depth]
        nearest = farthest = 0.0
        for d in range(D):
            below = boxes.lower[node, d] - centre[d]
            above = centre[d] - boxes.upper[node, d]
            nearest += max(0.0, below, above) ** 2
            farthest += min(below, above) ** 2
        if nearest > radius * radius:
            continue
        a, b = boxes.first[node] * BLOCK, min(boxes.last[node] * BLOCK, n)
        if not farthest > radius * radius:
            held += b - a
        elif boxes.last[node] - boxes.first[node] > 1:
            stack[depth] = 2 * node + 2
            stack[depth + 1] = 2 * node + 1
            depth += 2
        else:
            for j in range(a, b):
                squared = 0.0
                for d in range(D):
                    squared += (position[d, j] - centre[d]) ** 2
                held += squared < radius * radius
    return held
