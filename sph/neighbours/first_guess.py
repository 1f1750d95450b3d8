"""Initial guesses of support radii from positions alone."""

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.neighbours import BALL, tree
from sph.neighbours.order import BLOCK

# Levels of the tree, from blocks upwards, that give a spacing: nodes of 8 to 64 particles.
GUESS_LEVELS = 4

# A guess is halved while it contains this many times the intended number of particles: lists of
# them would exhaust memory before the support radius is found.
TOO_MANY = 8.0

HALVINGS = 60


def from_spacing(position: np.ndarray, ratio: float) -> np.ndarray:
    """Return guesses (N,) for positions (D, N) in block order.

    A guess is ratio = (H/h) eta times the smallest spacing of the tree nodes that contain the
    particle. (Nodes that cut through lattice planes or a density gradient give too large a spacing.
    Guesses that are too large cost memory for lists; small ones cost only a second build.)
    """
    n = position.shape[1]
    guess = np.empty(n)
    _from_spacing(tree.build(position, np.zeros(n)), ratio, guess)
    return guess


@njit(**COMPILED)
def _from_spacing(boxes, ratio, guess):
    n = guess.size
    nodes, D = boxes.lower.shape
    spacings = empty(nodes, np.float64)
    extent = empty(D, np.float64)
    for node in range(nodes):
        count = min(boxes.last[node] * BLOCK, n) - boxes.first[node] * BLOCK
        spacings[node] = np.inf
        if count > 1:  # a single particle has no extent
            for d in range(D):
                extent[d] = boxes.upper[node, d] - boxes.lower[node, d]
            spacings[node] = _spacing(extent, count)
    # coincident particles have no spacing: begin with a small support radius
    least = 1e-6 * spacings[0]
    for leaf in range(nodes):
        if boxes.last[leaf] - boxes.first[leaf] != 1:
            continue
        spacing = np.inf
        node = leaf
        for _ in range(GUESS_LEVELS):
            spacing = min(spacing, spacings[node])
            node = max(0, (node - 1) // 2)
        for i in range(boxes.first[leaf] * BLOCK, min(boxes.last[leaf] * BLOCK, n)):
            guess[i] = ratio * max(spacing, least)


@njit(**INLINED)
def _spacing(extent, n):
    """Return the spacing s of n particles whose extent is e, from prod(e + s) = n s^D."""
    D = extent.size
    spacing = 0.0
    for d in range(D):
        spacing = max(spacing, extent[d])
    for _ in range(30):  # a contraction: each iteration at least halves the error
        volume = 1.0
        for d in range(D):
            volume *= extent[d] + spacing
        spacing = (volume / n) ** (1 / D)
    return spacing


def trim(position: np.ndarray, ratio: float, least: float, guess: np.ndarray) -> None:
    """Halve guesses (N,) that contain far too many particles, in place; `least` is the lower limit.

    position: (D, N) in block order; the intended number is that in a ball of `ratio` spacings.
    """
    D = len(position)
    _trim(tree.build(position, guess), position, TOO_MANY * BALL[D - 1] * ratio**D, least, guess)


@njit(**COMPILED)
def _trim(boxes, position, most, least, guess):
    D, n = position.shape
    centre = empty(D, np.float64)
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
        for i in range(a, b):
            guess[i] = H


@njit(**INLINED)
def _held(boxes, position, centre, radius, enough):
    """Return the number of particles in a ball, counted until it exceeds `enough`."""
    D, n = position.shape
    held = 0
    stack = empty(128, np.int64)
    stack[0] = 0
    depth = 1
    while depth > 0 and not held > enough:
        depth -= 1
        node = stack[depth]
        nearest = farthest = 0.0
        for d in range(D):
            below = boxes.lower[node, d] - centre[d]
            above = centre[d] - boxes.upper[node, d]
            gap, span = larger(0.0, larger(below, above)), smaller(below, above)
            nearest += gap * gap
            farthest += span * span
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
                    r = position[d, j] - centre[d]
                    squared += r * r
                held += squared < radius * radius
    return held
