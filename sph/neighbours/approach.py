"""Bound on the time step by pairs that are not neighbours yet but would meet within it.

Eq 32 bounds a step by the approach of neighbours. Cold streams that are still apart have no
neighbours across the gap. They could overlap by whole support radii before any pair force acts, or
be pushed through a long step by a force that is found only at its end. Here a pair, images
included, bounds the step if its straight paths bring it from outside both supports to within the
larger and shorten the distance by more than FAR of the smaller. The step then ends at the edge of
the support or, for pairs that start close to the edge, at the depth that eq 32 allows neighbours
in a step. Node pairs of the block tree are skipped if their relative motion is small or they stay
apart; in smooth flow this is true of the root.
"""

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.domain import Images
from sph.neighbours import tree
from sph.neighbours.order import BLOCK

FAR = 0.5

SLACK = 1e-9

# Size of the stack of node pairs: each level of the tree leaves two at most, after 27 images at the
# root.
STACK = 27 + 4 * 64


def first_contact(
    position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, support: np.ndarray,
    identity: np.ndarray, images: Images, box_length: float, dt: float, reached: float,
) -> tuple[float, int]:  # fmt: skip
    """Return the fraction of dt at which the step must end, and the ID of a particle of that pair.

    position, velocity, acceleration: (D, N); support, identity: (N,), all in block order; images:
    of the domain, valid for distances up to box_length; reached: depth, in units of the smaller
    support, that a pair starting close to the edge may reach. A step with relative motions above
    box_length is cut to that, with ID 0. Returns (1, 0) if no pair bounds the step.
    """
    whole = served(velocity, acceleration, support, images.sign, box_length, dt)
    if not whole > 0.0:
        return 1.0, 0
    dt = whole * dt
    moves = dt * (velocity + 0.5 * dt * acceleration)
    boxes = tree.build(position, support)
    motion = tree.build(moves, -support)  # whose largest -H is the smallest H
    # compiled only in runs with gas that has not met
    part, particle = _walk(
        boxes, motion, position, moves, support, identity, images, min(reached, FAR)
    )
    return whole * part, particle


@njit(**COMPILED)
def served(velocity, acceleration, support, sign, box_length, dt):
    """Return the fraction of dt for which images are valid; 0 if relative motions are small."""
    D, n = velocity.shape
    least = np.inf
    for i in range(n):
        least = smaller(least, support[i])
    squared = 0.0
    for d in range(D):
        low, high = np.inf, -np.inf
        for i in range(n):
            move = dt * (velocity[d, i] + 0.5 * dt * acceleration[d, i])
            low, high = smaller(low, move), larger(high, move)
        apart = high - low
        for image in range(sign.shape[0]):
            if sign[image, d] < 0.0:  # at a wall, particles move relative to their images
                apart = larger(apart, larger(2.0 * high, -2.0 * low))
        squared += apart * apart
    apart = np.sqrt(squared)
    if not (FAR * least < apart < np.inf):
        return 0.0
    return min(1.0, box_length / apart)


@njit(**COMPILED)
def _walk(boxes, motion, position, moves, support, identity, images, reached):
    """Return the first contact as a fraction of the step with displacements `moves` (D, N)."""
    n = support.size
    first, last = boxes.first, boxes.last
    best, particle = 1.0, 0
    stack = empty((STACK, 3), np.int64)
    depth = 0
    for image in range(images.sign.shape[0] - 1, -1, -1):
        stack[depth] = 0, 0, image
        depth += 1
    while depth > 0:
        depth -= 1
        a, b, image = stack[depth]
        if not _earliest(boxes, motion, images, a, b, image, best) <= best:
            continue
        many_a, many_b = last[a] - first[a], last[b] - first[b]
        if many_a == 1 and many_b == 1:
            for i in range(first[a] * BLOCK, min(last[a] * BLOCK, n)):
                begin = first[b] * BLOCK
                if image == 0 and a == b:  # each pair once, and no particle with itself
                    begin = i + 1
                for j in range(begin, min(last[b] * BLOCK, n)):
                    part = _contact(position, moves, support, images, i, j, image, reached)
                    lower = min(identity[i], identity[j])
                    if part < best or (part == best and lower < particle):
                        best, particle = part, lower
            continue
        if image == 0 and a == b:
            stack[depth] = 2 * a + 1, 2 * a + 2, 0
            stack[depth + 1] = 2 * a + 2, 2 * a + 2, 0
            stack[depth + 2] = 2 * a + 1, 2 * a + 1, 0
            depth += 3
            continue
        near, far = (2 * a + 1, b), (2 * a + 2, b)
        if many_b > many_a:
            near, far = (a, 2 * b + 1), (a, 2 * b + 2)
        # the pair that may meet first is examined first, since its result excludes others
        if _earliest(boxes, motion, images, far[0], far[1], image, best) < _earliest(
            boxes, motion, images, near[0], near[1], image, best
        ):
            near, far = far, near
        stack[depth] = far[0], far[1], image
        stack[depth + 1] = near[0], near[1], image
        depth += 2
    return best, particle


@njit(**COMPILED)
def _earliest(boxes, motion, images, a, b, image, best):
    """Return a fraction of the step before which no pair of two nodes meets; inf if after `best`.

    SLACK allows for rounding, so that the result does not depend on how this was compiled.
    """
    least = -max(motion.support[a], motion.support[b])
    reach = (1.0 + SLACK) * max(boxes.support[a], boxes.support[b])
    apart = travel = missed = 0.0
    for d in range(boxes.lower.shape[1]):
        s, o = images.sign[image, d], images.offset[image, d]
        flip = s < 0.0
        x_low = s * (boxes.upper[b, d] if flip else boxes.lower[b, d]) + o
        x_high = s * (boxes.lower[b, d] if flip else boxes.upper[b, d]) + o
        m_low = s * (motion.upper[b, d] if flip else motion.lower[b, d])
        m_high = s * (motion.lower[b, d] if flip else motion.upper[b, d])
        low, high = boxes.lower[a, d] - x_high, boxes.upper[a, d] - x_low
        back, forth = motion.lower[a, d] - m_high, motion.upper[a, d] - m_low
        apart += max(0.0, low, -high) ** 2
        travel += max(-back, forth) ** 2
        missed += max(0.0, low + min(0.0, best * back), -high - max(0.0, best * forth)) ** 2
    if not travel > ((1.0 - SLACK) * FAR * least) ** 2 or missed > reach * reach:
        return np.inf
    return max(0.0, np.sqrt(apart) - reach) / np.sqrt(travel)


@njit(**INLINED)
def _contact(position, moves, support, images, i, j, image, reached):
    """Return the fraction at which the step must end for i and an image of j; inf if no bound."""
    squared = along = travel = 0.0
    for d in range(position.shape[0]):
        s = images.sign[image, d]
        r = position[d, i] - (s * position[d, j] + images.offset[image, d])
        move = moves[d, i] - s * moves[d, j]
        squared += r * r
        along += r * move
        travel += move * move
    H, least = max(support[i], support[j]), min(support[i], support[j])
    if squared < H * H or not along < 0.0:  # already neighbours, or separating
        return np.inf
    nearest = min(1.0, -along / travel)
    closest = squared + nearest * (2.0 * along + nearest * travel)
    apart = np.sqrt(squared)
    if not closest < H * H or apart - np.sqrt(max(0.0, closest)) < FAR * least:
        return np.inf
    end = H if apart > H + reached * least else H - reached * least
    outside = squared - end * end
    return outside / (np.sqrt(max(0.0, along * along - travel * outside)) - along)
