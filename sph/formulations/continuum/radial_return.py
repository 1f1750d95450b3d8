"""Radial return of a deviatoric stress to the yield surface (eqs 434-435).

Wilkins, M. L. (1964), Methods Comput. Phys. 3, 211. All three normal components count, also those
that are not stored: in 2-D S_zz = -(S_xx + S_yy), in 1-D S_yy = S_zz = -S_xx/2.
"""

import numpy as np
from numba import njit

from sph.compiled import INLINED
from sph.formulations.continuum.strength import yield_stress_of

# Of the stress, to which the stress and the yield stress agree: some tens of roundings.
TOLERANCE = 1e-14
MAX_ITERATIONS = 100


@njit(**INLINED)
def equivalent_stress(dim, deviatoric, i):
    """Return sqrt(3/2 S:S) of particle i. deviatoric: (D, D, N)."""
    D = len(dim)
    total = 0.0
    trace = 0.0
    for a in range(D):
        trace += deviatoric[a, a, i]
        for b in range(D):
            total += deviatoric[a, b, i] * deviatoric[a, b, i]
    if D == 2:
        total += trace * trace
    elif D == 1:
        total += 0.5 * trace * trace
    return np.sqrt(1.5 * total)  # eq 434


@njit(**INLINED)
def returned(strength, equivalent, plastic_strain, strain_rate, internal_energy):
    """Return (factor, increment): the factor on S, and the increment of the plastic strain.

    equivalent: the equivalent stress before the return. After it, the equivalent stress is the
    yield stress at the new plastic strain, unless it was below before; then (1, 0) is returned.
    """
    excess = equivalent - yield_stress_of(strength, plastic_strain, strain_rate, internal_energy)
    if not excess > 0.0:  # also NaN, for the watchdog to find
        return 1.0, 0.0
    # The root of S_eq - 3 G d - Y(d) by regula falsi in the Illinois variant: one iteration for
    # perfect plasticity, at most 36 for n = 0.05. Hardening laws may have an infinite slope at zero
    # plastic strain, so no slope is used.
    stiffness = 3.0 * strength.shear_modulus
    low, above = 0.0, excess
    high = equivalent / stiffness
    at_high = yield_stress_of(strength, plastic_strain + high, strain_rate, internal_energy)
    if not at_high > 0.0:  # molten: no stress is left
        return 0.0, high
    below = -at_high
    increment, side = high, 0
    for _ in range(MAX_ITERATIONS):
        increment = high - below * (high - low) / (below - above)
        if not low < increment < high:
            increment = 0.5 * (low + high)
        excess = equivalent - stiffness * increment - yield_stress_of(
            strength, plastic_strain + increment, strain_rate, internal_energy
        )  # fmt: skip
        if abs(excess) <= TOLERANCE * equivalent:
            break
        if excess > 0.0:
            below *= 0.5 if side > 0 else 1.0
            low, above, side = increment, excess, 1
        else:
            above *= 0.5 if side < 0 else 1.0
            high, below, side = increment, excess, -1
    return 1.0 - stiffness * increment / equivalent, increment  # eq 435
