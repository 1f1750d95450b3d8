"""The pass for acceleration and potential by gravity (eqs 303-309).

For each group of blocks one walk through the tree finds the nodes that act as a whole, and the
blocks whose particles act one by one. For each block of the group, these particles are sorted into
those that may be within a support of a particle of the block, whose force is softened, and others,
whose force is Newton's. Every sum is relative to the group and in its units, as those of other
passes are to a superblock (`sph.passes.gather`).
"""

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.formulations.gas.weighting import copy_weights, mass_per_weight, weight
from sph.kernels import dw_over_q, enclosed_over_q3, normalisation, potential_depth
from sph.neighbours.order import BLOCK
from sph.parts.gravity import attraction, moments
from sph.parts.gravity._tree import CENTRE, MASS, Q, walk
from sph.passes.active import any_active, is_active
from sph.passes.blocks import load_column, move
from sph.passes.gather import (
    FAR,
    TINY,
    also,
    copy_box,
    copy_values,
    largest_of,
    middle,
    own_box,
    place_block,
    read,
    unit,
    value_of,
)
from sph.simd import (
    at,
    block_width,
    count,
    dot,
    filled,
    filled_block,
    front,
    inverse_sqrt,
    lane_max,
    lane_sum,
    lane_sums,
    larger_each,
    load,
    load_block,
    load_rows,
    load_spatial,
    minus,
    numbers_from,
    pick,
    plus,
    put,
    rows,
    store,
    store_spatial,
    times,
    width,
    zeros,
)

# Quantities of near particles after the position; the last two only with zeta.
M, H_INV, WEIGHT, SLOPE = 3, 4, 5, 6
# Rows of far nodes: position, mass, moments.
FAR_Q, FAR_O, FAR_ROWS = 4, 9, 16


@njit(**COMPILED)
def attract(
    first, last, dim, models, neighbours, nodes, position, mass, support, zeta, acceleration,
    potential,
):  # fmt: skip
    """Add acceleration (3, N) by gravity and set potential (N,), for groups [first, last).

    zeta (N,): zeta/Omega, or None if supports do not follow the density.
    """
    lanes = neighbours.lanes
    expansion, kernel, weighting = models
    every = also(dim + (0, 0), zeta, (0, 0))  # noqa: RUF005
    point = dim + (0,)  # noqa: RUF005
    five, seven = (0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 0, 0)
    C = normalisation(kernel, dim)
    box = empty(6, np.float64)
    far_nodes = empty(nodes.first.size, np.int32)
    near_blocks = empty(nodes.last[0], np.int32)
    room_far, room_near = 0, 0
    far = rows(lanes, FAR_ROWS, 1)
    copied = rows(lanes, 1, 1)[0]
    boxes = rows(lanes, 7, 1)
    soft, plain = rows(lanes, len(every), 1), rows(lanes, 4, 1)
    inside, outside = empty(1, np.int32), empty(1, np.int32)
    for group in range(first, last):
        begin, end = nodes.groups[group], nodes.groups[group + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        if not any_active(neighbours.active, i_0, i_end):
            continue
        size = _box_of(neighbours.boxes, begin, end, box)
        reach = largest_of(support, i_0, i_end)
        n_far, n_near = walk(nodes, box, reach, expansion.opening_angle, far_nodes, near_blocks)
        if n_far > room_far:
            room_far = n_far + n_far // 2
            far = rows(lanes, FAR_ROWS, _odd(lanes, room_far))
        if n_near > room_near:
            room_near = n_near + n_near // 2
            copied = rows(lanes, 1, room_near * len(every) * BLOCK)[0]
            boxes = rows(lanes, 7, room_near + BLOCK)
            soft = rows(lanes, len(every), _odd(lanes, room_near * BLOCK))
            plain = rows(lanes, 4, _odd(lanes, room_near * BLOCK))
            inside = empty(room_near + BLOCK, np.int32)
            outside = empty(room_near + BLOCK, np.int32)
        x_0 = middle(dim, neighbours, begin, end)
        per_length = unit(larger(reach, size))
        per_mass = unit(largest_of(mass, i_0, i_end))
        per_weight = unit(weight(weighting, largest_of(mass, i_0, i_end)))
        # of m zeta/(Omega H^5); zeta has the unit mass length^2/weight
        per_zeta = per_mass * per_length * per_length / per_weight
        _copy_nodes(
            lanes, expansion, nodes.values, far_nodes, n_far, x_0, per_length, per_mass, far
        )
        for t in range(n_near):
            block = near_blocks[t]
            to = t * len(every) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, 0, x_0, per_length)
            copy_values(lanes, copied, to + M * BLOCK, mass, block, per_mass)
            H = _copy_supports(
                lanes, copied, to, weighting, support, mass, zeta, block, per_length, per_weight,
                C * per_zeta * per_mass,
            )  # fmt: skip
            copy_box(dim, boxes, t, neighbours, block, 0, x_0, per_length, H)
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            if not any_active(neighbours.active, i_first, i_last):
                continue
            reach = largest_of(support, i_first, i_last) * per_length
            n_in, n_out = _sort_blocks(lanes, dim, boxes, n_near, low, high, reach, inside, outside)
            n_plain = _copy_points(lanes, point, copied, len(every), outside, n_out, plain)
            n_soft, n_plain = _sort_particles(
                lanes, dim, copied, every, point, inside, n_in, low, high, reach, soft, plain,
                n_plain,
            )  # fmt: skip
            for i in range(i_first, i_last):
                if not is_active(neighbours.active, i):
                    continue
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                total, depth = zeros(lanes, dim), filled(lanes, 0.0)
                for k in range(0, n_far, width(lanes)):
                    r = minus(x_i, load_spatial(lanes, dim, far, 0, k))
                    r_inv = inverse_sqrt(dot(r, r) + TINY)
                    quadrupoles = load_spatial(lanes, five, far, FAR_Q, k)
                    octupoles = load_spatial(lanes, seven, far, FAR_O, k)
                    pull, one = attraction(
                        expansion, load(lanes, far, (3, k)), quadrupoles, octupoles, r, r_inv
                    )
                    total, depth = plus(total, pull), depth + one
                for k in range(0, n_plain, width(lanes)):
                    r = minus(x_i, load_spatial(lanes, dim, plain, 0, k))
                    r_inv = inverse_sqrt(dot(r, r) + TINY)
                    one = load(lanes, plain, (3, k)) * r_inv
                    depth += one
                    total = plus(total, times(r, one * (r_inv * r_inv)))
                H_inv_i = 1.0 / (support[i] * per_length)
                cube = H_inv_i * H_inv_i * H_inv_i
                zeta_i = value_of(zeta, i) * (per_zeta * C) * cube * H_inv_i * H_inv_i
                share = per_weight / (per_mass * mass_per_weight(weighting, mass[i]))
                for k in range(0, n_soft, width(lanes)):
                    r = minus(x_i, load_spatial(lanes, dim, soft, 0, k))
                    squared = dot(r, r) + TINY
                    r_inv = inverse_sqrt(squared)
                    distance = squared * r_inv
                    H_inv_j = load(lanes, soft, (H_INV, k))
                    # at least as wide as the distance: the kernel then acts like a point
                    s_i, s_j = smaller(H_inv_i, r_inv), smaller(H_inv_j, r_inv)
                    q_i, q_j = distance * s_i, distance * s_j
                    m_half = 0.5 * load(lanes, soft, (M, k))
                    depth += m_half * (
                        s_i * potential_depth(kernel, q_i) + s_j * potential_depth(kernel, q_j)
                    )
                    pull = m_half * (
                        s_i * s_i * s_i * enclosed_over_q3(kernel, q_i)
                        + s_j * s_j * s_j * enclosed_over_q3(kernel, q_j)
                    )
                    if zeta is not None:
                        own = load(lanes, soft, (WEIGHT, k)) * zeta_i
                        other = load(lanes, soft, (SLOPE, k)) * share
                        pull += 0.5 * (
                            own * dw_over_q(kernel, dim, distance * H_inv_i)
                            + other * dw_over_q(kernel, dim, distance * H_inv_j)
                        )
                    total = plus(total, times(r, pull))
                sums = times(lane_sums(total), -expansion.G * (per_length * per_length / per_mass))
                put(acceleration, i, plus(at(dim, acceleration, i), sums))
                potential[i] = -expansion.G * (per_length / per_mass) * lane_sum(depth)


@njit(**INLINED)
def _odd(lanes, length):
    """Return a length of rows with room for padding, an odd number of 128-byte lines."""
    return ((length + 2 * width(lanes)) // 32 * 2 + 3) * 16


@njit(**INLINED)
def _box_of(boxes, first, last, box):
    """Write the lower and upper corner of the box of blocks [first, last); return its diagonal."""
    squared = 0.0
    for d in range(3):
        box[d], box[3 + d] = boxes[first, d], boxes[first, 3 + d]
        for block in range(first + 1, last):
            box[d] = min(box[d], boxes[block, d])
            box[3 + d] = max(box[3 + d], boxes[block, 3 + d])
        squared += (box[3 + d] - box[d]) ** 2
    return np.sqrt(squared)


@njit(**INLINED)
def _copy_nodes(lanes, expansion, values, chosen, number, origin, per_length, per_mass, far):
    """Write centre, mass and moments of the nodes to the columns of `far`."""
    per_moment = per_mass * per_length * per_length
    for t in range(number):
        k = chosen[t]
        for d in range(3):
            far[d, t] = (values[k, CENTRE + d] - origin[d]) * per_length
        far[3, t] = values[k, MASS] * per_mass
        for component in range(min(moments(expansion), 5)):
            far[FAR_Q + component, t] = values[k, Q + component] * per_moment
        for component in range(5, moments(expansion)):
            far[FAR_Q + component, t] = values[k, Q + component] * (per_moment * per_length)
    for row in range(FAR_ROWS):
        store(far, (row, number), filled(lanes, FAR if row == 0 else 0.0))


@njit(**INLINED)
def _copy_supports(
    lanes, copied, begin, weighting, support, mass, zeta, block, per_length, per_weight, per_slope
):  # fmt: skip
    """Copy 1/H and, with zeta, weight and m zeta/(Omega H^5) of a block; return the largest H."""
    largest = 0.0
    for lane in range(0, BLOCK, block_width(lanes)):
        H = read(lanes, support, block, lane, 0.0) * per_length
        H_inv = inverse_sqrt(H * H + TINY)  # large outside the array, where H = 0
        store(copied, begin + H_INV * BLOCK + lane, H_inv)
        if zeta is not None:
            m = read(lanes, mass, block, lane, 0.0)
            z = read(lanes, zeta, block, lane, 0.0) * m * per_slope
            fifth = H_inv * H_inv * H_inv * (H_inv * H_inv)
            store(copied, begin + SLOPE * BLOCK + lane, z * fifth)
        largest = max(largest, lane_max(H))
    if zeta is not None:
        copy_weights(lanes, copied, begin + WEIGHT * BLOCK, weighting, mass, block, per_weight)
    return largest


@njit(**INLINED)
def _sort_blocks(lanes, dim, boxes, number, low, high, reach, inside, outside):
    """Write which of the first `number` boxes are within reach of a box; return both numbers.

    The box has the corners low and high. A box is within reach if it is within `reach` or its own.
    """
    D = len(dim)
    for t in range(number, number + BLOCK):  # lanes beyond the list
        for row in range(2 * D + 1):
            boxes[row, t] = FAR if row == 0 or row == D else 0.0
    n_in, n_out = 0, 0
    for t in range(0, number, block_width(lanes)):
        above = minus(load_rows(lanes, dim, boxes, 0, t), high)
        below = minus(low, load_rows(lanes, dim, boxes, D, t))
        gap = larger_each(larger_each(above, below), 0.0)
        farthest = larger(load_block(lanes, boxes, (2 * D, t)), reach)
        squared = dot(gap, gap)
        is_in, is_out = squared < farthest * farthest, squared >= farthest * farthest
        store(inside, n_in, pick(numbers_from(lanes, t), front(lanes, is_in)))
        store(outside, n_out, pick(numbers_from(lanes, t), front(lanes, is_out)))
        n_in += count(is_in)
        n_out += count(is_out)
    while n_in > 0 and inside[n_in - 1] >= number:  # a reach beyond FAR
        n_in -= 1
    while n_out > 0 and outside[n_out - 1] >= number:
        n_out -= 1
    return n_in, n_out


@njit(**INLINED)
def _copy_points(lanes, point, copied, quantities, chosen, number, plain):
    """Write the positions and masses of blocks to the columns of `plain`; return their number."""
    n = 0
    for index in range(number):
        for lane in range(0, BLOCK, block_width(lanes)):
            begin = chosen[index] * (quantities * BLOCK) + lane
            store_spatial(plain, 0, n, load_column(lanes, point, copied, begin))
            n += block_width(lanes)
    return n


@njit(**INLINED)
def _sort_particles(
    lanes, dim, copied, every, point, chosen, blocks, low, high, reach, soft, plain, n_plain
):  # fmt: skip
    """Write particles of blocks to `soft` if within reach of a box, otherwise to `plain`.

    A particle is within reach if it is within `reach`, or within its own support radius. Returns
    the lengths of both; the columns that follow have mass 0.
    """
    n_soft = 0
    for index in range(blocks):
        for lane in range(0, BLOCK, block_width(lanes)):
            begin = chosen[index] * (len(every) * BLOCK) + lane
            x = load_column(lanes, dim, copied, begin)
            gap = larger_each(larger_each(minus(low, x), minus(x, high)), 0.0)
            squared = dot(gap, gap)
            H_inv = load_block(lanes, copied, begin + H_INV * BLOCK)
            in_own = squared * H_inv * H_inv
            is_in = (squared < reach * reach) | (in_own < 1.0)
            is_out = (squared >= reach * reach) & (in_own >= 1.0)
            move(lanes, every, copied, begin, front(lanes, is_in), soft, n_soft)
            move(lanes, point, copied, begin, front(lanes, is_out), plain, n_plain)
            n_soft += count(is_in)
            n_plain += count(is_out)
    for k in range(0, width(lanes), block_width(lanes)):
        for row in range(len(every)):
            store(soft, (row, n_soft + k), filled_block(lanes, FAR if row == 0 else 0.0))
        for row in range(len(point)):
            store(plain, (row, n_plain + k), filled_block(lanes, FAR if row == 0 else 0.0))
    return n_soft, n_plain
