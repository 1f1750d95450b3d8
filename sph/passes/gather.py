"""Copying of candidates' values to scratch arrays, with images applied by the field's rank.

`sign` (K, D) and `offset` (K, D) describe the images (`sph.domain`). A field or scratch array that
is None costs no time. The loops run over len(dim), which is a constant for the compiler; it would
not unroll loops over the shape of an array.
"""

from numba import njit, types
from numba.extending import overload

from sph.compiled import INLINED
from sph.neighbours.lists import IMAGE_SHIFT


@njit(**INLINED)
def unpacked(packed):
    """Return (particle, image) of a candidate in the lists."""
    return packed & ((1 << IMAGE_SHIFT) - 1), packed >> IMAGE_SHIFT


@njit(**INLINED)
def most_candidates(first_block, last_block, count):
    """Return the length of scratch arrays for blocks [first_block, last_block)."""
    size = 0
    for block in range(first_block, last_block):
        size = max(size, count[block])
    return size


@njit(**INLINED)
def place_in(scratch, k, position, j, dim, sign, offset, image):
    """Set scratch[:, k] to the position of an image of particle j; position: (D, N)."""
    for d in range(len(dim)):
        scratch[d, k] = sign[image, d] * position[d, j] + offset[image, d]


def copy_in(scratch, k, field, j, dim, sign, image):
    """Set scratch[..., k] to field[..., j], reflected by its rank: (N,), (D, N) or (D, D, N)."""


@overload(copy_in, jit_options=INLINED)  # type: ignore[arg-type]
def _copy_in(scratch, k, field, j, dim, sign, image):
    if isinstance(field, types.NoneType | types.Omitted):
        return lambda scratch, k, field, j, dim, sign, image: None
    if field.ndim == 1:

        def copy(scratch, k, field, j, dim, sign, image):
            scratch[k] = field[j]

    elif field.ndim == 2:

        def copy(scratch, k, field, j, dim, sign, image):
            for d in range(len(dim)):
                scratch[d, k] = sign[image, d] * field[d, j]

    else:

        def copy(scratch, k, field, j, dim, sign, image):
            for d in range(len(dim)):
                for e in range(len(dim)):
                    scratch[d, e, k] = sign[image, d] * sign[image, e] * field[d, e, j]

    return copy
