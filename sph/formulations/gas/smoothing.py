"""Support radius H and density of a particle from its neighbours (step 2).

Both methods use the distances r[:nc] and weights m[:nc] (by default masses, see `weighting`) of the
candidates of a particle. They return (H, sum of weights, Omega, wanted); with masses as weights the
sum is the density rho. The candidates are complete up to the radius `reach`. If H exceeds `reach`,
`wanted` is the radius that the lists must reach before the next attempt; otherwise it is 0.0. If
there is no root up to `largest`, H is `largest` and Omega is 1, because H does not depend on the
density.
"""

from typing import NamedTuple

from numba import njit

from sph.compiled import INLINED, verb
from sph.kernels import dw_over_q, normalisation, w

# Each pass of eqs 7 and 15 multiplies the distance from their common root by 1 - Omega. In resolved
# flow the passes converge to within one per cent. They diverge if Omega exceeds 2, at jumps of mass
# or density between neighbours. If the last pass changes H by more than this fraction, Newton's
# iteration finds the root instead.
UNSETTLED = 0.05

# The logarithm of the sum of masses is nearly linear in that of H: Newton's iteration needs 3 or 4
# steps from a guess within a factor 2, and bisection to 1e-10 at most 40 more.
MAX_ITERATIONS = 100


@verb
def find_support(self, kernel, dim, r, m, nc, mass, H, ratio, reach, largest):
    return self.find_support(kernel, dim, r, m, nc, mass, H, ratio, reach, largest)


class FixedPasses(NamedTuple):
    """Evaluate eqs 7, 8 and 15 `count` times; solve them if the last change of H is large."""

    count: int  # type: ignore[assignment]
    tolerance: float  # of the solution, relative
    unsettled: float = UNSETTLED

    def find_support(self, kernel, dim, r, m, nc, mass, H, ratio, reach, largest):
        C = normalisation(kernel, dim)
        D = len(dim)
        rho = 0.0
        Omega = 0.0
        for index in range(self.count):
            if not reach >= H:
                return H, rho, Omega, H
            H_inv = 1.0 / H
            sum_w = 0.0
            if index < self.count - 1:
                for k in range(nc):
                    sum_w += m[k] * w(kernel, dim, r[k] * H_inv)
            else:
                sum_dw = 0.0
                for k in range(nc):
                    q = r[k] * H_inv
                    sum_w += m[k] * w(kernel, dim, q)
                    sum_dw += m[k] * (q * q) * dw_over_q(kernel, dim, q)
                Omega = -sum_dw / (D * sum_w)  # eq 8 with eqs 7 and 10: the D w terms cancel the 1
            rho = C * H_inv**D * sum_w  # eq 7
            H = min(ratio * (mass / rho) ** (1.0 / D), largest)  # eq 15
        if abs(H * H_inv - 1.0) > self.unsettled or not largest > H:
            return solve(
                kernel, dim, r, m, nc, mass, 1.0 / H_inv, ratio, reach, largest, self.tolerance
            )
        return H, rho, Omega, (0.0 if reach >= H else H)


class Converged(NamedTuple):
    """Solve eqs 7 and 15 together to the relative `tolerance`."""

    tolerance: float

    def find_support(self, kernel, dim, r, m, nc, mass, H, ratio, reach, largest):
        return solve(kernel, dim, r, m, nc, mass, H, ratio, reach, largest, self.tolerance)


@njit(**INLINED)
def solve(kernel, dim, r, m, nc, mass, H, ratio, reach, largest, tolerance):
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
        sum_w = 0.0
        sum_dw = 0.0
        for k in range(nc):
            q = r[k] * H_inv
            sum_w += m[k] * w(kernel, dim, q)
            sum_dw += m[k] * (q * q) * dw_over_q(kernel, dim, q)
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
