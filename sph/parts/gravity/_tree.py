"""Nodes of the block tree with their moments, and the walk that finds far and near ones.

Nodes have the indices and blocks of `sph.neighbours.tree`. Moments are computed anew in each step,
from the present positions, so nothing is kept between steps.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED, larger
from sph.neighbours.order import BLOCK, number_of_blocks
from sph.threads import Team

# Blocks of a group, at most: a subtree whose particles share one walk through the tree.
GROUP = 4

# Columns of `values`. Moments are those about the centre of mass (eq 307), without their
# traces: the quadrupole xx, xy, xz, yy, yz and the octupole xxx, xxy, xxz, xyy, xyz, yyy, yyz.
# Those that the walk reads come first.
CENTRE, RADIUS, SUPPORT, LOW, HIGH, MASS, Q, OCT, COLUMNS = 0, 3, 4, 5, 8, 11, 12, 17, 24


class Nodes(NamedTuple):
    """Nodes by heap index: node k has children 2k + 1 and 2k + 2; unused nodes have first = -1."""

    first: np.ndarray  # (nodes,) first block
    last: np.ndarray  # (nodes,) one past the last block
    values: np.ndarray  # (nodes, COLUMNS)
    groups: np.ndarray  # (groups + 1,) first block of each group, and the number of blocks


def build(position: np.ndarray, mass: np.ndarray, support: np.ndarray, team: Team) -> Nodes:
    """Return the nodes of particles in block order: position (3, N), mass and support (N,)."""
    blocks = number_of_blocks(mass.size)
    size = (2 << (blocks - 1).bit_length()) - 1
    first, last, values = np.full(size, -1), np.full(size, -1), np.empty((size, COLUMNS))
    leaf, groups = np.empty(blocks, np.int64), np.empty(blocks + 1, np.int64)
    number = _split(blocks, first, last, leaf, groups)
    team.run(_sum_particles, blocks, leaf, position, mass, support, values)
    _sum_nodes(first, last, values)
    return Nodes(first, last, values, np.sort(groups[: number + 1]))


@njit(**COMPILED)
def _split(blocks, first, last, leaf, groups):
    """Set the blocks of each node, and the node of each block, as `sph.neighbours.tree` does.

    Writes the first block of each group, in the order of nodes, and the number of blocks to
    `groups`; returns the number of groups.
    """
    first[0], last[0] = 0, blocks
    number = 0
    for k in range(first.size):
        if first[k] < 0:
            continue
        parent = (k - 1) // 2
        if last[k] - first[k] <= GROUP and (k == 0 or last[parent] - first[parent] > GROUP):
            groups[number] = first[k]
            number += 1
        if last[k] - first[k] == 1:
            leaf[first[k]] = k
            continue
        middle = (first[k] + last[k]) // 2
        first[2 * k + 1], last[2 * k + 1] = first[k], middle
        first[2 * k + 2], last[2 * k + 2] = middle, last[k]
    groups[number] = blocks
    return number


@njit(**INLINED)
def _add_mass(values, k, m, x, y, z):
    """Add the moments of a mass at (x, y, z) from the centre of node k."""
    squared = x * x + y * y + z * z
    values[k, Q] += m * (3.0 * x * x - squared)
    values[k, Q + 1] += m * (3.0 * x * y)
    values[k, Q + 2] += m * (3.0 * x * z)
    values[k, Q + 3] += m * (3.0 * y * y - squared)
    values[k, Q + 4] += m * (3.0 * y * z)
    values[k, OCT] += m * x * (15.0 * x * x - 9.0 * squared)
    values[k, OCT + 1] += m * y * (15.0 * x * x - 3.0 * squared)
    values[k, OCT + 2] += m * z * (15.0 * x * x - 3.0 * squared)
    values[k, OCT + 3] += m * x * (15.0 * y * y - 3.0 * squared)
    values[k, OCT + 4] += m * (15.0 * x * y * z)
    values[k, OCT + 5] += m * y * (15.0 * y * y - 9.0 * squared)
    values[k, OCT + 6] += m * z * (15.0 * y * y - 3.0 * squared)


@njit(**INLINED)
def _add_node(values, k, child, x, y, z):
    """Add the moments of a child of node k, whose centre is at (x, y, z) from that of node k."""
    for component in range(Q, OCT + 7):
        values[k, component] += values[child, component]
    _add_mass(values, k, values[child, MASS], x, y, z)
    xx, xy, xz = values[child, Q], values[child, Q + 1], values[child, Q + 2]
    yy, yz = values[child, Q + 3], values[child, Q + 4]
    # the octupole by the quadrupole: 5 (s_a Q_bc + s_b Q_ac + s_c Q_ab), without its traces
    trace_x = 2.0 * (xx * x + xy * y + xz * z)
    trace_y = 2.0 * (xy * x + yy * y + yz * z)
    trace_z = 2.0 * (xz * x + yz * y - (xx + yy) * z)
    values[k, OCT] += 15.0 * x * xx - 3.0 * trace_x
    values[k, OCT + 1] += 5.0 * (2.0 * x * xy + y * xx) - trace_y
    values[k, OCT + 2] += 5.0 * (2.0 * x * xz + z * xx) - trace_z
    values[k, OCT + 3] += 5.0 * (2.0 * y * xy + x * yy) - trace_x
    values[k, OCT + 4] += 5.0 * (x * yz + y * xz + z * xy)
    values[k, OCT + 5] += 15.0 * y * yy - 3.0 * trace_y
    values[k, OCT + 6] += 5.0 * (2.0 * y * yz + z * yy) - trace_z


@njit(**COMPILED)
def _sum_particles(first, last, leaf, position, mass, support, values):
    """Set the values of the nodes that are blocks [first, last)."""
    for block in range(first, last):
        k = leaf[block]
        a, b = block * BLOCK, min((block + 1) * BLOCK, mass.size)
        for column in range(COLUMNS):
            values[k, column] = 0.0
        for p in range(a, b):
            values[k, MASS] += mass[p]
            values[k, SUPPORT] = max(values[k, SUPPORT], support[p])
        for d in range(3):
            total, low, high = 0.0, position[d, a], position[d, a]
            for p in range(a, b):
                total += mass[p] * (position[d, p] - position[d, a])
                low, high = min(low, position[d, p]), max(high, position[d, p])
            values[k, CENTRE + d] = position[d, a] + total / values[k, MASS]
            values[k, LOW + d], values[k, HIGH + d] = low, high
        farthest = 0.0
        for p in range(a, b):
            x = position[0, p] - values[k, CENTRE]
            y = position[1, p] - values[k, CENTRE + 1]
            z = position[2, p] - values[k, CENTRE + 2]
            farthest = max(farthest, x * x + y * y + z * z)
            _add_mass(values, k, mass[p], x, y, z)
        values[k, RADIUS] = np.sqrt(farthest)


@njit(**COMPILED)
def _sum_nodes(first, last, values):
    """Set the values of the nodes that have children, from those of the children."""
    for k in range(first.size - 1, -1, -1):
        if first[k] < 0 or last[k] - first[k] == 1:
            continue
        a, b = 2 * k + 1, 2 * k + 2
        part = values[b, MASS] / (values[a, MASS] + values[b, MASS])
        values[k, MASS] = values[a, MASS] + values[b, MASS]
        values[k, SUPPORT] = max(values[a, SUPPORT], values[b, SUPPORT])
        corner = 0.0
        for d in range(3):
            low = min(values[a, LOW + d], values[b, LOW + d])
            high = max(values[a, HIGH + d], values[b, HIGH + d])
            centre = values[a, CENTRE + d]
            centre += part * (values[b, CENTRE + d] - centre)
            values[k, LOW + d], values[k, HIGH + d], values[k, CENTRE + d] = low, high, centre
            corner += max(centre - low, high - centre) ** 2
        for component in range(Q, OCT + 7):
            values[k, component] = 0.0
        farthest = 0.0
        for child in (a, b):
            x = values[child, CENTRE] - values[k, CENTRE]
            y = values[child, CENTRE + 1] - values[k, CENTRE + 1]
            z = values[child, CENTRE + 2] - values[k, CENTRE + 2]
            _add_node(values, k, child, x, y, z)
            apart = np.sqrt(x * x + y * y + z * z)
            farthest = max(farthest, apart + values[child, RADIUS])
        # no particle is farther away than the farthest corner of the box
        values[k, RADIUS] = min(farthest, np.sqrt(corner))


@njit(**INLINED)
def _gap(box, d, low, high):
    """Return the gap along axis d between a box and the interval from low to high, 0 for none."""
    return larger(0.0, larger(box[d] - high, low - box[3 + d]))


@njit(**INLINED)
def walk(nodes, box, reach, opening_angle, far, near):
    """Write nodes that act as a whole on a group to `far`, and blocks of the others to `near`.

    Returns (length of far, length of near). box (6,): lower and upper corner of the group; reach:
    its largest support. A node acts as a whole if its radius is below opening_angle times the
    distance of its centre from the box, and if no particle of the node and none of the group can be
    within a support of the other.
    """
    first, last, values, _ = nodes
    stack = empty(128, np.int64)
    stack[0] = 0
    depth, n_far, n_near = 1, 0, 0
    while depth > 0:
        depth -= 1
        k = stack[depth]
        squared = 0.0
        for d in range(3):
            squared += _gap(box, d, values[k, CENTRE + d], values[k, CENTRE + d]) ** 2
        is_far = values[k, RADIUS] ** 2 < opening_angle * opening_angle * squared
        if is_far:
            squared = 0.0
            for d in range(3):
                squared += _gap(box, d, values[k, LOW + d], values[k, HIGH + d]) ** 2
            is_far = squared >= max(reach, values[k, SUPPORT]) ** 2
        if is_far:
            far[n_far] = k
            n_far += 1
        elif last[k] - first[k] == 1:
            near[n_near] = first[k]
            n_near += 1
        else:
            stack[depth] = 2 * k + 2
            stack[depth + 1] = 2 * k + 1
            depth += 2
    return n_far, n_near
