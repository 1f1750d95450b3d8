"""The particles that a pass computes: all or, with individual steps, the active ones.

`active` is None if all particles are computed, which leaves no code. Otherwise it is an array (N,)
that is 1.0 for particles whose time step ends now, and 0.0 for others.
"""

from numba import types
from numba.extending import overload

from sph.compiled import INLINED
from sph.passes.gather import read
from sph.simd import select


def is_active(active, i):
    """Return whether particle i is computed."""


@overload(is_active, jit_options=INLINED)  # type: ignore[arg-type]
def _is_active(active, i):
    if isinstance(active, types.NoneType):
        return lambda active, i: True
    return lambda active, i: active[i] > 0.0


def any_active(active, first, last):
    """Return whether any of the particles [first, last) is computed."""


@overload(any_active, jit_options=INLINED)  # type: ignore[arg-type]
def _any_active(active, first, last):
    if isinstance(active, types.NoneType):
        return lambda active, first, last: True

    def found(active, first, last):
        total = 0.0
        for i in range(first, last):
            total += active[i]
        return total > 0.0

    return found


def where_active(active, lanes, field, block, lane, values):
    """Return `values` in the lanes of active particles, those of `field` in the others."""


@overload(where_active, jit_options=INLINED)  # type: ignore[arg-type]
def _where_active(active, lanes, field, block, lane, values):
    if isinstance(active, types.NoneType):
        return lambda active, lanes, field, block, lane, values: values

    def chosen(active, lanes, field, block, lane, values):
        is_new = read(lanes, active, block, lane, 0.0) > 0.0
        return select(is_new, values, read(lanes, field, block, lane, 0.0))

    return chosen


def step_of(dt, i):
    """Return the time step of particle i; dt: one step for all, or (N,)."""


@overload(step_of, jit_options=INLINED)  # type: ignore[arg-type]
def _step_of(dt, i):
    if isinstance(dt, types.Array):
        return lambda dt, i: dt[i]
    return lambda dt, i: dt
