"""Candidate lists: for each block, all particles and images that may become neighbours.

A list serves all particles of its block. It is valid until a particle has moved, or its support
radius has grown, by more than the skin allows. A candidate is one integer: particle and image.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.domain import Images
from sph.neighbours.order import BLOCK, number_of_blocks
from sph.neighbours.tree import Tree
from sph.threads import SMALLEST_RANGE, Team

CHUNK = 32  # blocks that share a region of the storage
IMAGE_SHIFT = 26  # low bits of a candidate: the particle; above them the image
SHORT_IMAGES = 1 << (31 - IMAGE_SHIFT)  # with so many images a candidate fits into 32 bits
MAX_PARTICLES = 1 << IMAGE_SHIFT


class Lists(NamedTuple):
    """Candidates of block b: candidates[start[b] : start[b] + count[b]]."""

    start: np.ndarray  # (blocks,) int64
    count: np.ndarray  # type: ignore[assignment]  # (blocks,) int64, not tuple.count
    candidates: np.ndarray  # int32, int64 where supports are wider than a thin box


@njit(**COMPILED)
def _gap(lower_a, upper_a, lower_b, upper_b):
    """Return the distance between two intervals, 0 if they overlap."""
    return max(0.0, max(lower_b - upper_a, lower_a - upper_b))


@njit(**INLINED)
def _fill(chunk, dim, tree, position, support, stretch, images, region, start, count, candidates):
    """Fill the lists of a chunk's blocks into its region; return the room they need."""
    first, last, lower, upper, largest = tree
    sign, offset = images
    begin_of_region = region[chunk]
    room = region[chunk + 1] - begin_of_region
    D = len(dim)  # a compile-time constant, so that loops over it are unrolled
    n = support.size
    blocks = start.size
    nodes_on_stack = np.empty(128, np.int64)
    box_lower = np.empty(D)
    box_upper = np.empty(D)
    members = np.empty((D, BLOCK))
    supports = np.empty(BLOCK)
    here = np.empty(D)
    needed = 0
    for block in range(chunk * CHUNK, min((chunk + 1) * CHUNK, blocks)):
        a, b = block * BLOCK, min((block + 1) * BLOCK, n)
        H_block = 0.0
        for p in range(a, b):
            H_block = max(H_block, support[p])
        for p in range(BLOCK):  # a block that is not full repeats its last particle
            supports[p] = support[min(a + p, b - 1)]
            for d in range(D):
                members[d, p] = position[d, min(a + p, b - 1)]
        support_least = supports.min()
        for d in range(D):
            box_lower[d] = box_upper[d] = position[d, a]
            for p in range(a + 1, b):
                box_lower[d] = min(box_lower[d], position[d, p])
                box_upper[d] = max(box_upper[d], position[d, p])
        begin = needed
        for image in range(sign.shape[0]):
            depth = 1
            nodes_on_stack[0] = 0
            while depth > 0:
                depth -= 1
                node = nodes_on_stack[depth]
                squared = 0.0
                for d in range(D):
                    s, o = sign[image, d], offset[image, d]
                    lo = lower[node, d] if s > 0.0 else upper[node, d]
                    hi = upper[node, d] if s > 0.0 else lower[node, d]
                    gap = _gap(box_lower[d], box_upper[d], s * lo + o, s * hi + o)
                    squared += gap * gap
                reach = stretch * max(H_block, largest[node])
                if squared >= reach * reach:
                    continue
                if last[node] - first[node] > 1:
                    nodes_on_stack[depth] = 2 * node + 2
                    nodes_on_stack[depth + 1] = 2 * node + 1
                    depth += 2
                    continue
                for j in range(first[node] * BLOCK, min(last[node] * BLOCK, n)):
                    squared = farthest = 0.0
                    for d in range(D):
                        here[d] = sign[image, d] * position[d, j] + offset[image, d]
                        gap = _gap(box_lower[d], box_upper[d], here[d], here[d])
                        squared += gap * gap
                        farthest += (gap + box_upper[d] - box_lower[d]) ** 2
                    reach = stretch * max(H_block, support[j])
                    if squared >= reach * reach:
                        continue
                    # j is within reach of the block's box. Near its edge, check each particle.
                    nearest = farthest - (stretch * support_least) ** 2
                    if nearest >= 0.0:
                        for p in range(BLOCK):
                            squared = 0.0
                            for d in range(D):
                                squared += (here[d] - members[d, p]) ** 2
                            reach = stretch * larger(supports[p], support[j])
                            nearest = smaller(nearest, squared - reach * reach)
                    if nearest < 0.0:
                        if needed < room:
                            candidates[begin_of_region + needed] = j + (image << IMAGE_SHIFT)
                        needed += 1
        start[block] = begin_of_region + begin
        count[block] = needed - begin
    return needed


@njit(**COMPILED)
def _fill_chunks(
    first, last, dim, tree, position, support, stretch, images, region, start, count, candidates,
    needed,
):  # fmt: skip
    for chunk in range(first, last):
        needed[chunk] = _fill(
            chunk, dim, tree, position, support, stretch, images, region, start, count, candidates
        )


@njit(**COMPILED)
def _regions(room):
    """Where the region of each chunk begins and, last, where the storage ends."""
    region = np.zeros(room.size + 1, np.int64)
    for chunk in range(room.size):
        # 15 % to spare: lists rebuilt in a developing flow then rarely have to be built twice
        region[chunk + 1] = region[chunk] + room[chunk] + room[chunk] // 7 + 64
    return region


@njit(**COMPILED)
def _fits(needed, region):
    """Whether every chunk's candidates fit into its region."""
    fits = True
    for chunk in range(needed.size):
        fits = fits and needed[chunk] <= region[chunk + 1] - region[chunk]
    return fits


def build(
    tree: Tree, position: np.ndarray, support: np.ndarray, skin: float, images: Images, team: Team,
    room: np.ndarray | None = None,
) -> tuple[Lists, np.ndarray]:  # fmt: skip
    """Return the lists of all blocks, and the room (chunks,) that each chunk needed.

    position: (D, N), support: (N,), in block order; tree: built from them. Candidates are within
    (1 + skin) max(H_i, H_j) of a particle i of the block. room: the room that an earlier build
    needed, to size the storage; if it is too small, the lists are built again.
    """
    dim = (0,) * position.shape[0]
    blocks = number_of_blocks(support.size)
    chunks = (blocks + CHUNK - 1) // CHUNK
    if room is None or room.size != chunks:
        room = np.zeros(chunks, np.int64)
    start = np.empty(blocks, np.int64)
    count = np.empty(blocks, np.int64)
    needed = np.empty(chunks, np.int64)
    while True:
        region = _regions(room)
        kind = np.int32 if images.sign.shape[0] <= SHORT_IMAGES else np.int64
        candidates = np.empty(region[-1], kind)
        team.run(
            _fill_chunks, chunks, dim, tree, position, support, 1.0 + skin, images, region, start,
            count, candidates, needed, smallest=SMALLEST_RANGE // CHUNK,
        )  # fmt: skip
        if _fits(needed, region):
            return Lists(start, count, candidates), needed
        room = needed.copy()
