"""Corrected kernel gradients and tractions of a pair, by the arrays that a scene has.

The functions for particle i take its index, those for candidates (`*_of`) the rows of `near`.
"""

from numba import types
from numba.extending import overload

from sph.compiled import INLINED
from sph.neighbours.order import BLOCK
from sph.passes.gather import copy_vectors
from sph.simd import at, load, load_spatial, plus, symmetric_at, symmetric_times, times

# --- the corrected gradient of the kernel (eq 402), for particle i and for candidates


def corrected_gradient(dim, sym, i, F_r, W, factor, gradient, matrix, per_length):
    """Return the corrected gradient of particle i."""


@overload(corrected_gradient, jit_options=INLINED)  # type: ignore[arg-type]
def _own_gradient(dim, sym, i, F_r, W, factor, gradient, matrix, per_length):
    def plain(dim, sym, i, F_r, W, factor, gradient, matrix, per_length):
        return F_r

    def order_0(dim, sym, i, F_r, W, factor, gradient, matrix, per_length):
        return plus(times(F_r, factor[i]), times(times(at(dim, gradient, i), 1.0 / per_length), W))

    def order_1(dim, sym, i, F_r, W, factor, gradient, matrix, per_length):
        return plus(
            symmetric_times(symmetric_at(dim, matrix, i), F_r),
            times(times(at(dim, gradient, i), 1.0 / per_length), W),
        )

    return _by_order(factor, matrix, plain, order_0, order_1)


def corrected_gradient_of(
    lanes, dim, sym, near, k, F_r, W, factor, gradient, matrix, factor_row, gradient_row, matrix_row
):  # fmt: skip
    """Return the corrected gradients of candidates."""


@overload(corrected_gradient_of, jit_options=INLINED)  # type: ignore[arg-type]
def _gradients_of_candidates(
    lanes, dim, sym, near, k, F_r, W, factor, gradient, matrix, factor_row, gradient_row, matrix_row
):  # fmt: skip
    def plain(
        lanes, dim, sym, near, k, F_r, W, factor, gradient, matrix, factor_row, gradient_row,
        matrix_row,
    ):  # fmt: skip
        return F_r

    def order_0(
        lanes, dim, sym, near, k, F_r, W, factor, gradient, matrix, factor_row, gradient_row,
        matrix_row,
    ):  # fmt: skip
        return plus(
            times(F_r, load(lanes, near, (factor_row, k))),
            times(load_spatial(lanes, dim, near, gradient_row, k), W),
        )

    def order_1(
        lanes, dim, sym, near, k, F_r, W, factor, gradient, matrix, factor_row, gradient_row,
        matrix_row,
    ):  # fmt: skip
        return plus(
            symmetric_times(load_spatial(lanes, sym, near, matrix_row, k), F_r),
            times(load_spatial(lanes, dim, near, gradient_row, k), W),
        )

    return _by_order(factor, matrix, plain, order_0, order_1)


def _by_order(factor, matrix, plain, order_0, order_1):
    if _is_there(matrix):
        return order_1
    return order_0 if _is_there(factor) else plain


def _is_there(kind) -> bool:
    return not isinstance(kind, types.NoneType | types.Omitted)


def copy_gradients(lanes, dim, copied, begin, field, block, neighbours, image, origin, factor):
    """As `copy_vectors`, nothing for None. Return where the next quantity begins."""


@overload(copy_gradients, jit_options=INLINED)  # type: ignore[arg-type]
def _copy_vector_gradients(
    lanes, dim, copied, begin, field, block, neighbours, image, origin, factor
):
    def nothing(lanes, dim, copied, begin, field, block, neighbours, image, origin, factor):
        return begin

    def copy(lanes, dim, copied, begin, field, block, neighbours, image, origin, factor):
        copy_vectors(lanes, dim, copied, begin, field, block, neighbours, image, origin, factor)
        return begin + len(dim) * BLOCK

    return copy if _is_there(field) else nothing


# --- the stress, or minus the pressure of a fluid


def traction(dim, pressure, stress, i, a, per_stress):
    """Return sigma_i . a."""


@overload(traction, jit_options=INLINED)  # type: ignore[arg-type]
def _own_traction(dim, pressure, stress, i, a, per_stress):
    def of_pressure(dim, pressure, stress, i, a, per_stress):
        return times(a, -pressure[i] * per_stress)

    def of_stress(dim, pressure, stress, i, a, per_stress):
        return symmetric_times(times(symmetric_at(dim, stress, i), per_stress), a)

    return of_stress if _is_there(stress) else of_pressure


def traction_of(lanes, dim, sym, pressure, stress, near, p_row, s_row, k, a):
    """Return sigma_j . a of candidates."""


@overload(traction_of, jit_options=INLINED)  # type: ignore[arg-type]
def _tractions_of_candidates(lanes, dim, sym, pressure, stress, near, p_row, s_row, k, a):
    def of_pressure(lanes, dim, sym, pressure, stress, near, p_row, s_row, k, a):
        return times(a, -load(lanes, near, (p_row, k)))

    def of_stress(lanes, dim, sym, pressure, stress, near, p_row, s_row, k, a):
        return symmetric_times(load_spatial(lanes, sym, near, s_row, k), a)

    return of_stress if _is_there(stress) else of_pressure
