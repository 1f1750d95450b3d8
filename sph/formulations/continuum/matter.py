"""Positions, velocities, supports and volumes of candidates, as both pair loops copy them."""

from numba import njit

from sph.compiled import INLINED
from sph.neighbours.order import BLOCK
from sph.passes.gather import TINY, copy_box, copy_vectors, place_block, read
from sph.simd import block_width, dot, inverse_sqrt, lane_max, store

# Quantities of candidates after position and velocity, and where those of a pass begin.
H, H_INV, VOLUME, NEXT = 0, 1, 2, 3


@njit(**INLINED)
def copy_matter(
    lanes, dim, copied, begin, boxes, t, block, neighbours, image, position, velocity, mass,
    density, support, x_0, v_0, per_length, per_velocity, C,
):  # fmt: skip
    """Copy an image of a block to `copied`, and its box to column t of `boxes`.

    C: normalisation of the kernel, a factor of the volumes. Returns where quantity NEXT begins.
    """
    place_block(lanes, dim, copied, begin, position, block, neighbours, image, x_0, per_length)
    to = begin + len(dim) * BLOCK
    copy_vectors(lanes, dim, copied, to, velocity, block, neighbours, image, v_0, per_velocity)
    to += len(dim) * BLOCK
    reach = _copy_supports(lanes, copied, to, support, block, per_length)
    _copy_volumes(
        lanes, copied, to + VOLUME * BLOCK, mass, density, block, C * per_length ** len(dim)
    )
    copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, reach)
    return to + NEXT * BLOCK


@njit(**INLINED)
def of_pair(lanes, r_ij, H_i, H_j):
    """Return q = r/H_ij and 1/H_ij of eq 401, with H_ij = (H_i + H_j)/2."""
    H_inv = 2.0 / (H_i + H_j)
    squared = dot(r_ij, r_ij) + TINY
    return squared * inverse_sqrt(squared) * H_inv, H_inv


@njit(**INLINED)
def power(dim, x):
    """Return x^D."""
    found = x
    for _ in range(len(dim) - 1):
        found = found * x
    return found


@njit(**INLINED)
def _copy_supports(lanes, copied, begin, support, block, per_length):
    """Copy H and 1/H of a block; return the largest H."""
    largest = 0.0
    for lane in range(0, BLOCK, block_width(lanes)):
        H_j = read(lanes, support, block, lane, 0.0) * per_length
        store(copied, begin + H * BLOCK + lane, H_j)
        store(copied, begin + H_INV * BLOCK + lane, inverse_sqrt(H_j * H_j + TINY))
        largest = max(largest, lane_max(H_j))
    return largest


@njit(**INLINED)
def _copy_volumes(lanes, copied, begin, mass, density, block, factor):
    """Copy V = m/rho of a block, times factor."""
    for lane in range(0, BLOCK, block_width(lanes)):
        V = read(lanes, mass, block, lane, 0.0) / read(lanes, density, block, lane, 1.0)
        store(copied, begin + lane, V * factor)
