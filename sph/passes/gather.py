"""Candidates of a pass: copied once for a superblock, selected by block and by particle.

A pass copies the blocks in the list of a superblock to `copied`, with images applied, relative to
the superblock and in its units. `near_blocks` and `near_particles` select from these the candidates
of one block, and write their quantities to the rows of `near`, one after another. The selection
uses the present positions, so candidates and their order do not depend on when the lists were
built. Each quantity has a row, numbered by the pass; a vector has a row for each component.

Units of a superblock are powers of two near its largest support, mass and velocity. Multiplication
by a power of two is exact, so results in double precision do not depend on the units; in single
precision they keep intermediate results in range for any units of the scene.
"""

import math

import numpy as np
from numba import njit, types
from numba.extending import overload

from sph.arrays import empty
from sph.compiled import INLINED, larger
from sph.neighbours.lists import IMAGE_SHIFT
from sph.neighbours.order import BLOCK
from sph.passes.blocks import load_column, move
from sph.simd import (
    block_width,
    corner,
    count,
    dot,
    filled_block,
    front,
    larger_each,
    load,
    load_block,
    load_inside,
    load_rows,
    minus,
    numbers_from,
    pick,
    plus,
    rows,
    store,
    store_inside,
    times,
    width,
)

# Coordinate of lanes without a candidate, in units of the superblock. Such lanes have weight 0. The
# square of FAR times that of a density must be a number in single precision.
FAR = 1e8

# Added to r^2 in units of the superblock: keeps 1/r finite at r_ij = 0, where its factor is zero.
TINY = 1e-30


@njit(**INLINED)
def unpacked(entry):
    """Return (block, image) of an entry in the lists."""
    return entry & ((1 << IMAGE_SHIFT) - 1), entry >> IMAGE_SHIFT


@njit(**INLINED)
def longest_list(first, last, lists):
    """Return the number of blocks in the longest list of superblocks [first, last)."""
    size = 0
    for one in range(first, last):
        size = max(size, lists.count[one])
    return size


def also(quantities, field, more):
    """Return the tuple `quantities`, followed by the tuple `more` unless `field` is None."""


@overload(also, jit_options=INLINED)  # type: ignore[arg-type]
def _also(quantities, field, more):
    if isinstance(field, types.NoneType | types.Omitted):
        return lambda quantities, field, more: quantities
    return lambda quantities, field, more: quantities + more


@njit(**INLINED)
def scratch(lanes, dim, blocks, quantities):
    """Return the scratch arrays for lists of up to `blocks` blocks: copied, near, boxes, chosen.

    copied: block by block, the quantities of the block one after another; near: a row for each
    quantity; quantities: their number, and not a tuple, so that this is compiled once.
    """
    length = blocks * BLOCK + 2 * width(lanes)
    # rows an odd number of 128-byte lines apart: others would compete for the same lines of cache
    length = (length // 32 * 2 + 3) * 16
    return (
        rows(lanes, 1, blocks * quantities * BLOCK)[0],
        rows(lanes, quantities, length),
        rows(lanes, 2 * len(dim) + 1, blocks + BLOCK),
        empty(blocks + BLOCK, np.int32),
    )


@njit(**INLINED)
def unit(largest):
    """Return the power of two whose product with `largest` is between 1/2 and 1; 1 for 0."""
    if not 1e-290 < largest < 1e290:
        return 1.0
    return math.ldexp(1.0, -math.frexp(largest)[1])


@njit(**INLINED)
def largest_of(field, first, last):
    """Return the largest value of field[first:last]."""
    found = field[first]
    for i in range(first + 1, last):
        found = larger(found, field[i])
    return found


@njit(**INLINED)
def fastest(dim, velocity, first, last):
    """Return the largest component of velocity (D, N) relative to particle `first`."""
    found = 0.0
    for d in range(len(dim)):
        for i in range(first, last):
            found = larger(found, abs(velocity[d, i] - velocity[d, first]))
    return found


@njit(**INLINED)
def middle(dim, neighbours, first, last):
    """Return the mean of the middles of the boxes of blocks [first, last).

    Distances from there are half of those from a corner, and so is their round-off.
    """
    total = times(corner(dim, neighbours.boxes, first, 0), 0.0)
    for block in range(first, last):
        low, high = (
            corner(dim, neighbours.boxes, block, 0),
            corner(dim, neighbours.boxes, block, len(dim)),
        )
        total = plus(total, plus(low, high))
    return times(total, 0.5 / (last - first))


# --- copying ---


@njit(**INLINED)
def place_block(lanes, dim, copied, begin, position, block, neighbours, image, origin, per_length):
    """Copy the positions of an image of a block to `copied`, axis by axis."""
    sign, offset = neighbours.images
    inside = position.shape[1] - block * BLOCK
    for d in range(len(dim)):
        s, o = sign[image, d], offset[image, d] - origin[d]
        for lane in range(0, BLOCK, block_width(lanes)):
            x = load_inside(
                lanes, position, (d, block * BLOCK + lane), inside - lane, s * FAR / per_length
            )
            store(copied, begin + d * BLOCK + lane, (s * x + o) * per_length)


@njit(**INLINED)
def copy_vectors(lanes, dim, copied, begin, field, block, neighbours, image, origin, factor):
    """Copy an image of a vector (D, N) to `copied`: relative to `origin`, times factor."""
    sign, _ = neighbours.images
    inside = field.shape[1] - block * BLOCK
    for d in range(len(dim)):
        s = sign[image, d]
        for lane in range(0, BLOCK, block_width(lanes)):
            x = load_inside(lanes, field, (d, block * BLOCK + lane), inside - lane, 0.0)
            store(copied, begin + d * BLOCK + lane, (s * x - origin[d]) * factor)


@njit(**INLINED)
def read(lanes, field, block, lane, outside):
    """Return the values of a field (N,) in a block from its lane `lane`, in double precision.

    outside: value of the lanes outside the array.
    """
    k = block * BLOCK + lane
    return load_inside(lanes, field, k, field.size - k, outside)


@njit(**INLINED)
def write(field, block, lane, values):
    """Write the values of a field (N,) in a block from its lane `lane`."""
    k = block * BLOCK + lane
    store_inside(field, k, field.size - k, values)


def copy_values(lanes, copied, begin, field, block, factor):
    """Copy a field (N,) of a block to `copied`, times factor; nothing for None.

    Returns where the next quantity begins.
    """


@overload(copy_values, jit_options=INLINED)  # type: ignore[arg-type]
def _copy_values(lanes, copied, begin, field, block, factor):
    if isinstance(field, types.NoneType | types.Omitted):
        return lambda lanes, copied, begin, field, block, factor: begin

    def copy(lanes, copied, begin, field, block, factor):
        for lane in range(0, BLOCK, block_width(lanes)):
            store(copied, begin + lane, read(lanes, field, block, lane, 0.0) * factor)
        return begin + BLOCK

    return copy


def copy_tensors(lanes, dim, copied, begin, field, block, neighbours, image, factor):
    """Copy an image of a symmetric tensor (D, D, N), its upper triangle; nothing for None.

    Returns where the next quantity begins.
    """


@overload(copy_tensors, jit_options=INLINED)  # type: ignore[arg-type]
def _copy_tensors(lanes, dim, copied, begin, field, block, neighbours, image, factor):
    if isinstance(field, types.NoneType | types.Omitted):
        return lambda lanes, dim, copied, begin, field, block, neighbours, image, factor: begin

    def copy(lanes, dim, copied, begin, field, block, neighbours, image, factor):
        sign, _ = neighbours.images
        inside = field.shape[2] - block * BLOCK
        to = begin
        for a in range(len(dim)):
            for b in range(a, len(dim)):
                s = sign[image, a] * sign[image, b] * factor
                for lane in range(0, BLOCK, block_width(lanes)):
                    k = block * BLOCK + lane
                    x = load_inside(lanes, field, (a, b, k), inside - lane, 0.0)
                    store(copied, to + lane, x * s)
                to += BLOCK
        return to

    return copy


@njit(**INLINED)
def copy_products(lanes, copied, begin, a, b, block, factor):
    """Copy the product of two fields (N,) of a block to `copied`, times factor."""
    for lane in range(0, BLOCK, block_width(lanes)):
        product = read(lanes, a, block, lane, 0.0) * read(lanes, b, block, lane, 0.0)
        store(copied, begin + lane, product * factor)


@njit(**INLINED)
def copy_box(dim, boxes, t, neighbours, block, image, origin, per_length, reach):
    """Copy the box of an image of a block, and how far its particles reach, to column t."""
    D = len(dim)
    corners = neighbours.boxes
    sign, offset = neighbours.images
    for d in range(D):
        s, o = sign[image, d], offset[image, d] - origin[d]
        a = (s * corners[block, d] + o) * per_length
        b = (s * corners[block, D + d] + o) * per_length
        boxes[d, t], boxes[D + d, t] = min(a, b), max(a, b)
    boxes[2 * D, t] = reach


def value_of(field, i):
    """Return field[i], or 0.0 if the field is None."""


@overload(value_of, jit_options=INLINED)  # type: ignore[arg-type]
def _value_of(field, i):
    if isinstance(field, types.NoneType | types.Omitted):
        return lambda field, i: 0.0
    return lambda field, i: field[i]


def load_of(field, lanes, near, row, k):
    """Return lanes of a row of `near` that is there unless `field` is None, otherwise 0.0."""


@overload(load_of, jit_options=INLINED)  # type: ignore[arg-type]
def _load_of(field, lanes, near, row, k):
    if isinstance(field, types.NoneType | types.Omitted):
        return lambda field, lanes, near, row, k: 0.0
    return lambda field, lanes, near, row, k: load(lanes, near, (row, k))


# --- selection ---


@njit(**INLINED)
def own_box(dim, neighbours, block, origin, per_length):
    """Return the lower and upper corner of a block's box."""
    corners = neighbours.boxes
    low, high = corner(dim, corners, block, 0), corner(dim, corners, block, len(dim))
    return times(minus(low, origin), per_length), times(minus(high, origin), per_length)


@njit(**INLINED)
def near_blocks(lanes, dim, boxes, number, low, high, reach, chosen):
    """Write to `chosen` which of the first `number` boxes are near a box; return how many.

    The box has the corners low and high. A box is near if it is within `reach` or its own reach.
    """
    D = len(dim)
    for t in range(number, number + BLOCK):  # lanes beyond the list
        for row in range(2 * D + 1):
            boxes[row, t] = FAR if row == 0 or row == D else 0.0
    m = 0
    for t in range(0, number, block_width(lanes)):
        above = minus(load_rows(lanes, dim, boxes, 0, t), high)
        below = minus(low, load_rows(lanes, dim, boxes, D, t))
        gap = larger_each(larger_each(above, below), 0.0)
        farthest = larger(load_block(lanes, boxes, (2 * D, t)), reach)
        near = dot(gap, gap) < farthest * farthest
        store(chosen, m, pick(numbers_from(lanes, t), front(lanes, near)))
        m += count(near)
    while m > 0 and chosen[m - 1] >= number:  # a reach beyond FAR chooses lanes beyond the list
        m -= 1
    return m


@njit(**INLINED)
def near_particles(lanes, dim, copied, fields, own, chosen, blocks, low, high, reach, near):
    """Write the particles near a box to the columns of `near`; return their number.

    The box has the corners low and high. A particle is near if it is within `reach`, or within its
    own support radius, whose inverse is quantity number `own`; own = 0: only within `reach`. The
    columns that follow have weight 0 and a position out of reach.
    """
    nc = 0
    for index in range(blocks):
        for lane in range(0, BLOCK, block_width(lanes)):
            begin = chosen[index] * (len(fields) * BLOCK) + lane
            x = load_column(lanes, dim, copied, begin)
            gap = larger_each(larger_each(minus(low, x), minus(x, high)), 0.0)
            squared = dot(gap, gap)
            is_near = squared < reach * reach
            if own > 0:
                H_inv = load_block(lanes, copied, begin + own * BLOCK)
                is_near = is_near | (squared * H_inv * H_inv < 1.0)
            move(lanes, fields, copied, begin, front(lanes, is_near), near, nc)
            nc += count(is_near)
    for f in range(len(fields)):
        for k in range(0, width(lanes), block_width(lanes)):
            store(near, (f, nc + k), filled_block(lanes, FAR if f == 0 else 0.0))
    return nc
