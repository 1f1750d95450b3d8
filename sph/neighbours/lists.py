"""Neighbour lists: for each superblock, the blocks and images of blocks that it may need.

A superblock is a subtree of at most SUPERBLOCK blocks. Its list serves all of its particles: a pass
copies the listed blocks once, and selects for each block and each particle those candidates that
are within reach at present (`sph.passes.gather`). A list is complete until a particle has moved, or
its support radius has grown, by more than the skin allows. Entries beyond the present reach change
no result, because a pass does not select them. An entry is one integer: block and image.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED
from sph.domain import Images
from sph.neighbours.order import BLOCK
from sph.neighbours.tree import Tree
from sph.threads import SMALLEST_RANGE, Team

SUPERBLOCK = 16  # blocks of a superblock, at most
CHUNK = 4  # superblocks that share a region of the storage
IMAGE_SHIFT = 23  # low bits of an entry: the block; above them the image
SHORT_IMAGES = 1 << (31 - IMAGE_SHIFT)  # with so many images an entry fits into 32 bits
MAX_PARTICLES = BLOCK << IMAGE_SHIFT


class Lists(NamedTuple):
    """The list of superblock s: entries[start[s] : start[s] + count[s]]."""

    first: np.ndarray  # (superblocks + 1,) first block of each superblock, and the number of blocks
    start: np.ndarray  # (superblocks,) int64
    count: np.ndarray  # type: ignore[assignment]  # (superblocks,) int64, not tuple.count
    entries: np.ndarray  # int32, or int64 where supports are wider than a thin box


@njit(**COMPILED)
def _superblocks(tree: Tree, found: np.ndarray) -> int:
    """Write the first block of each superblock, in order, to `found`; return how many there are."""
    first, last = tree.first, tree.last
    stack = empty(128, np.int64)
    stack[0] = 0
    depth, number = 1, 0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if last[node] - first[node] <= SUPERBLOCK:
            found[number] = first[node]
            number += 1
        else:
            stack[depth] = 2 * node + 2
            stack[depth + 1] = 2 * node + 1
            depth += 2
    return number


def superblocks(tree: Tree) -> np.ndarray:
    """Return the first block of each superblock, in order, and the number of blocks."""
    blocks = tree.last[0]
    found = np.empty(blocks, np.int64)
    return np.append(found[: _superblocks(tree, found)], blocks)


@njit(**INLINED)
def _squared_gap(dim, lower, upper, a, low, high, b, sign, offset, image):
    """Return the squared distance between box a and an image of box b, 0 if they overlap."""
    squared = 0.0
    for d in range(len(dim)):
        s, o = sign[image, d], offset[image, d]
        near = low[b, d] if s > 0.0 else high[b, d]
        far = high[b, d] if s > 0.0 else low[b, d]
        gap = max(0.0, max(s * near + o - upper[a, d], lower[a, d] - (s * far + o)))
        squared += gap * gap
    return squared


@njit(**INLINED)
def _fill(superblock, dim, tree, leaf, stretch, images, first, entries, begin, room):
    """Write the list of a superblock to entries[begin:]; return its length.

    leaf (blocks,): node of each block. Nothing is written beyond `room` entries.
    """
    node_first, node_last, lower, upper, largest = tree
    sign, offset = images
    a, b = first[superblock], first[superblock + 1]
    stack = empty(128, np.int64)
    own_lower, own_upper = empty((1, len(dim)), np.float64), empty((1, len(dim)), np.float64)
    H = 0.0
    for block in range(a, b):
        H = max(H, largest[leaf[block]])
    for d in range(len(dim)):
        own_lower[0, d], own_upper[0, d] = lower[leaf[a], d], upper[leaf[a], d]
        for block in range(a + 1, b):
            own_lower[0, d] = min(own_lower[0, d], lower[leaf[block], d])
            own_upper[0, d] = max(own_upper[0, d], upper[leaf[block], d])
    number = 0
    for image in range(sign.shape[0]):
        depth = 1
        stack[0] = 0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            reach = stretch * max(H, largest[node])
            squared = _squared_gap(
                dim, own_lower, own_upper, 0, lower, upper, node, sign, offset, image
            )
            if squared >= reach * reach:
                continue
            if node_last[node] - node_first[node] > 1:
                stack[depth] = 2 * node + 2
                stack[depth + 1] = 2 * node + 1
                depth += 2
                continue
            needed = False
            for block in range(a, b):
                own = leaf[block]
                reach = stretch * max(largest[own], largest[node])
                squared = _squared_gap(
                    dim, lower, upper, own, lower, upper, node, sign, offset, image
                )
                if squared < reach * reach:
                    needed = True
                    break
            if needed:
                if number < room:
                    entries[begin + number] = node_first[node] + (image << IMAGE_SHIFT)
                number += 1
    return number


@njit(**COMPILED)
def _fill_chunks(
    first_chunk, last_chunk, dim, tree, leaf, stretch, images, wanted, first, region, start, count,
    entries, needed,
):  # fmt: skip
    """Fill the lists of `wanted` superblocks; needed: room that each chunk needs.

    region: where the storage of each chunk begins and, last, where all storage ends.
    """
    superblocks = first.size - 1
    for chunk in range(first_chunk, last_chunk):
        begin, end = region[chunk], region[chunk + 1]
        used = 0
        for one in range(chunk * CHUNK, min((chunk + 1) * CHUNK, superblocks)):
            if wanted[one]:
                start[one] = begin + used
                count[one] = _fill(
                    one, dim, tree, leaf, stretch, images, first, entries, begin + used,
                    end - begin - used,
                )  # fmt: skip
                used += count[one]
        needed[chunk] = used


@njit(**COMPILED)
def _copy_lists(old_start, count, old_entries, start, entries):
    """Copy the first `count` (superblocks,) entries of each list to its start in `entries`."""
    for one in range(count.size):
        for k in range(count[one]):
            entries[start[one] + k] = old_entries[old_start[one] + k]


@njit(**COMPILED)
def _regions(room, begin, is_estimate):
    """Return where the region of each chunk begins and, last, where the storage ends."""
    region = np.empty(room.size + 1, np.int64)
    region[0] = begin
    for chunk in range(room.size):
        # 15 % to spare: lists rebuilt in a developing flow rarely have to be built twice
        spare = room[chunk] // 7 + 8 if is_estimate else 0
        region[chunk + 1] = region[chunk] + room[chunk] + spare
    return region


@njit(**COMPILED)
def leaves(tree: Tree) -> np.ndarray:
    """Return the node of each block, (blocks,)."""
    found = empty(tree.last[0], np.int64)
    for node in range(tree.first.size):
        if tree.first[node] >= 0 and tree.last[node] - tree.first[node] == 1:
            found[tree.first[node]] = node
    return found


def listed(lists: Lists, which: np.ndarray) -> np.ndarray:
    """Return which superblocks (superblocks,) are in the lists of the superblocks `which`."""
    found = np.zeros(which.size, np.bool_)
    mask = (1 << IMAGE_SHIFT) - 1
    for one in np.flatnonzero(which):
        begin = lists.start[one]
        blocks = lists.entries[begin : begin + lists.count[one]] & mask
        found[np.searchsorted(lists.first, blocks, side="right") - 1] = True
    return found


class Builder:
    """Builds the lists of one tree: all, or again those of some superblocks."""

    def __init__(self, tree: Tree, skin: float, images: Images, team: Team):
        self.tree, self.images, self.team = tree, images, team
        self.stretch = 1.0 + skin
        self.first = superblocks(tree)
        self.leaves = leaves(tree)

    def all(self, room: np.ndarray | None = None) -> tuple[Lists, np.ndarray]:
        """Return the lists, and the room (chunks,) that each chunk needed.

        room: the room that an earlier build needed, to size the storage; if it is too small, the
        lists are built again.
        """
        number = self.first.size - 1
        start, count = np.empty(number, np.int64), np.empty(number, np.int64)
        kind = np.int32 if self.images.sign.shape[0] <= SHORT_IMAGES else np.int64
        empty = Lists(self.first, start, count, np.empty(0, kind))
        return self._filled(empty, np.ones(number, np.bool_), room)

    def again(self, old: Lists, wanted: np.ndarray) -> Lists:
        """Return lists of which those of `wanted` (superblocks,) are new."""
        kept = np.where(wanted, 0, old.count)
        start = np.cumsum(kept) - kept
        entries = np.empty(kept.sum(), old.entries.dtype)
        _copy_lists(old.start, kept, old.entries, start, entries)
        return self._filled(old._replace(start=start, entries=entries), wanted, None)[0]

    def boxes(self) -> np.ndarray:
        """Return the lower and upper corners of the box of each block, (blocks, 2 D)."""
        D = self.tree.lower.shape[1]
        boxes = np.empty((self.leaves.size, 2 * D))
        boxes[:, :D] = self.tree.lower[self.leaves]
        boxes[:, D:] = self.tree.upper[self.leaves]
        return boxes

    def _filled(self, old, wanted, room):
        """Return `old` with the lists of `wanted` added, in storage after that of `old`."""
        chunks = (wanted.size + CHUNK - 1) // CHUNK
        is_estimate = room is not None and room.size == chunks
        if not is_estimate:
            room = np.zeros(chunks, np.int64)  # the lists are counted before they are written
        needed = np.empty(chunks, np.int64)
        begin = old.entries.size
        dim = (0,) * self.images.sign.shape[1]
        while True:
            region = _regions(room, begin, is_estimate)
            entries = np.empty(region[-1], old.entries.dtype)
            entries[:begin] = old.entries
            self.team.run(
                _fill_chunks, chunks, dim, self.tree, self.leaves, self.stretch, self.images,
                wanted, self.first, region, old.start, old.count, entries, needed,
                smallest=max(1, SMALLEST_RANGE // (SUPERBLOCK * CHUNK)),
            )  # fmt: skip
            if (needed <= np.diff(region)).all():
                return old._replace(entries=entries), needed
            room, is_estimate = needed.copy(), False
