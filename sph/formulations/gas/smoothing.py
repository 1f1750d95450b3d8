"""Support radius H and density of a particle from its neighbours (step 2).

Both methods use the distances and weights (by default masses, see `weighting`) of the n candidates
of a particle, which are rows of the array `pairs` from the row `row`, in any units. They return
(H, sum of weights, Omega, wanted); with masses as weights the sum is the density rho. The
candidates are complete up to the radius `reach`. If H exceeds `reach`, `wanted` is the radius that
the candidates must reach before the next attempt; otherwise it is 0.0. If there is no root up to
`largest`, H is `largest` and Omega is 1, because H does not depend on the density.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import INLINED
from sph.kernels import dw_over_q, normalisation, w
from sph.simd import filled, inverse_cbrt, lane_sum, load, width

# Rows of `pairs`, which has ROWS for each particle: distance, weight, others of the density pass.
R, WEIGHT, ROWS = 0, 1, 7

# Each pass of eqs 7 and 15 multiplies the distance from their common root by 1 - Omega. In resolved
# flow the passes converge to within one per cent. They diverge if Omega exceeds 2, at jumps of mass
# or density between neighbours. If the last pass changes H by more than this fraction, Newton's
# iteration finds the root instead.
UNSETTLED = 0.05

# The logarithm of the sum of masses is nearly linear in that of H: Newton's iteration needs 3 or 4
# steps from a guess within a factor 2, and bisection to 1e-10 at most 40 more.
MAX_ITERATIONS = 100


class Smoothing(NamedTuple):
    """Evaluate eqs 7, 8 and 15 `passes` times; solve them if the last change of H is large.

    passes = 0: solve them always. tolerance: of the solution, relative.
    """

    passes: int
    tolerance: float
    unsettled: float = UNSETTLED


@njit(**INLINED)
def _per_spacing(dim, number):
    """Return number^(1/D), the inverse of the spacing, for a number of particles per volume."""
    if len(dim) == 3:
        root = inverse_cbrt(number)
        return number * (root * root)
    return number if len(dim) == 1 else np.sqrt(number)


@njit(**INLINED)
def _sums(lanes, kernel, dim, pairs, row, n, H_inv):
    """Return the sums of m w(q) and m q^2 (dw/dq)/q over candidates."""
    sum_w = filled(lanes, 0.0)
    sum_dw = filled(lanes, 0.0)
    for k in range(0, n, width(lanes)):
        q = load(lanes, pairs, (row + R, k)) * H_inv
        m_k = load(lanes, pairs, (row + WEIGHT, k))
        sum_w += m_k * w(kernel, dim, q)
        sum_dw += m_k * (q * q) * dw_over_q(kernel, dim, q)
    return lane_sum(sum_w), lane_sum(sum_dw)


@njit(**INLINED)
def find_support(smoothing, lanes, kernel, dim, pairs, row, n, mass, H, ratio, reach, largest):
    """Return (H, sum of weights, Omega, wanted) by the method of `smoothing`."""
    C = normalisation(kernel, dim)
    D = len(dim)
    rho = 0.0
    Omega = 0.0
    # in terms of 1/H, so that no division delays the next pass
    H_inv = before = 1.0 / H
    mass_inv, ratio_inv, largest_inv = 1.0 / mass, 1.0 / ratio, 1.0 / largest
    for index in range(smoothing.passes):
        if not reach * H_inv >= 1.0:
            return 1.0 / H_inv, rho, Omega, 1.0 / H_inv
        if index < smoothing.passes - 1:
            total = filled(lanes, 0.0)
            for k in range(0, n, width(lanes)):
                m, r = load(lanes, pairs, (row + WEIGHT, k)), load(lanes, pairs, (row + R, k))
                total += m * w(kernel, dim, r * H_inv)
            sum_w = lane_sum(total)
        else:
            sum_w, sum_dw = _sums(lanes, kernel, dim, pairs, row, n, H_inv)
            Omega = -sum_dw / (D * sum_w)  # eq 8 with eqs 7 and 10: the D w terms cancel the 1
        rho = C * H_inv**D * sum_w  # eq 7
        before = H_inv
        H_inv = max(_per_spacing(dim, rho * mass_inv) * ratio_inv, largest_inv)  # eq 15
    settled = abs(before - H_inv) <= smoothing.unsettled * H_inv and H_inv > largest_inv
    if settled and smoothing.passes > 0:
        H = 1.0 / H_inv
        return H, rho, Omega, (0.0 if reach >= H else H)
    return _solve(
        lanes, kernel, dim, pairs, row, n, mass, 1.0 / before, ratio, reach, largest,
        smoothing.tolerance,
    )  # fmt: skip


@njit(**INLINED)
def _solve(lanes, kernel, dim, pairs, row, n, mass, H, ratio, reach, largest, tolerance):
    """Return the root of eqs 7 and 15 by Newton's iteration, safeguarded by bisection."""
    C = normalisation(kernel, dim)
    D = len(dim)
    target = mass * ratio**D / C  # sum m w at the root of eqs 7 and 15
    H = min(H, largest)
    lower, upper = 0.0, 0.0  # bracket; upper = 0: none known yet
    for _ in range(MAX_ITERATIONS):
        if not reach >= H:
            return H, 0.0, 0.0, H
        H_inv = 1.0 / H
        sum_w, sum_dw = _sums(lanes, kernel, dim, pairs, row, n, H_inv)
        if sum_w < target:  # sum m w(r/H) rises with H
            lower = H
            if not largest > H:
                return H, C * H_inv**D * sum_w, 1.0, 0.0
        else:
            upper = H
        # slope = d ln(sum m w)/d ln H = -sum_dw/sum_w. Without neighbours the slope is zero, and H
        # changes by the bound of a step. The upper bound is small otherwise, because a support that
        # is too wide contains many neighbours.
        slope = max(-sum_dw / sum_w, 0.1)
        growth = 1.25 if slope > 0.1 else 2.0
        H_next = min(H * min(max((target / sum_w) ** (1.0 / slope), 0.5), growth), largest)
        if upper > 0.0 and not lower < H_next < upper:
            H_next = 0.5 * (lower + upper)
        if abs(H_next - H) <= tolerance * H:
            rho = C * H_inv**D * sum_w
            return H, rho, -sum_dw / (D * sum_w), 0.0
        H = H_next
    return H, -1.0, 0.0, 0.0  # a density below zero: the caller names the particle
