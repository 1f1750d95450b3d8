"""The pass over clamped particles, such as those in the jaws of a vice: no force moves them."""

from numba import njit

from sph.compiled import COMPILED
from sph.neighbours.order import BLOCK


@njit(**COMPILED)
def hold(first, last, dim, models, neighbours, clamped, acceleration):
    """Set the acceleration (D, N) of particles in superblocks [first, last) to 0 if clamped (N,).

    They keep their initial velocity.
    """
    lists = neighbours.lists
    i_end = min(lists.first[last] * BLOCK, clamped.size)
    for d in range(len(dim)):
        for i in range(lists.first[first] * BLOCK, i_end):
            if clamped[i] > 0.0:
                acceleration[d, i] = 0.0
