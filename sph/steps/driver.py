"""Several time steps in one call of a compiled function.

`take` makes the same calls in the same order as `Simulation.advance`, by address (`calls`), so its
own code is one for all scenes. It returns where Python is needed: at `until`, after a number of
steps or seconds, where lists must be built or widened, and after a step whose sums the watchdog
might refuse. No flag of fast arithmetic is set, so numbers have the bits of Python's.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from sph.integrators.step_size import APPROACH, next_step, rate_of_supports, restricted
from sph.steps.calls import call, read_clock
from sph.totals import drift_of
from sph.watchdog import SETTLING, fits_box, is_sound

# Why `take` returned. Python builds stale lists after the prediction of a step, which the next call
# completes; it completes a step whose first pass requests wider lists; and it repeats the
# watchdog's checks of a doubtful step.
PAUSED, STALE, WIDER, DOUBTFUL = range(4)

# Columns of the rows, one row a step; the components of momentum follow.
(
    TIME, STEP_LIMIT, LIMITER, CRITERION, KINETIC, RELATIVE, INTERNAL, VOLUME, MIN_DENSITY,
    MAX_DENSITY, MIN_ENERGY, MAX_ENERGY, RATES, DRIFT, INJECTED, HELD, WALL, CPU, MOMENTUM,
) = range(19)  # fmt: skip

OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


class Plan(NamedTuple):
    """The calls of a step, and the indices of words that change from step to step.

    The calls are those of the prediction, one for the motion since lists were built, the passes,
    the correction, and one each for totals, smallest step, change of supports and first contact.
    """

    calls: np.ndarray  # (K, 2) of `Table.finished`
    motion: int  # index of the call for the motion
    widens: bool  # whether the first pass may request wider lists; others do not
    swaps: np.ndarray  # (passes,) whether the two swapped arrays are exchanged after the pass
    phases: np.ndarray  # (passes,) entry of `spent`; 0 is that of the leapfrog, 1 that of the sums
    dt: np.ndarray  # words: the length of the step,
    reach: np.ndarray  # the reach factor of the lists,
    next_dt: np.ndarray  # the limit of the next step,
    first: np.ndarray  # and the addresses of the two swapped arrays
    second: np.ndarray
    has_divergence: bool  # whether the change of supports comes from div v
    clock: np.ndarray  # (2,) address of clock_gettime, and its clock


class Bounds(NamedTuple):
    """Numbers that do not change within a call."""

    until: float
    skin: float
    courant: float
    end: float
    max_support: float
    max_drift: float
    baseline_energy: float
    baseline_scale: float
    added: float
    box_volume: float  # of a box that gas fills; 0 for others
    step: int  # number of steps before the call
    longest: float  # seconds after which the call returns


class Arrays(NamedTuple):
    """Arrays that the driver itself reads."""

    wanted: np.ndarray
    density: np.ndarray
    position: np.ndarray
    momentum: np.ndarray  # (D,) of the totals
    first: np.ndarray  # the two swapped arrays: the first is the support at the beginning
    second: np.ndarray
    fences: np.ndarray  # (F, 3) axis, lowest and highest position


# Entries of the array `now`, which changes from step to step: time, limit of the next step, energy
# injected, number of supports limited by max_support, reach factor of the lists, and length and end
# of the last step.
NOW, LIMIT, GIVEN, LIMITED, REACH, LENGTH, UNTIL = range(7)


@njit(**OPTIONS)
def take(plan, bounds, arrays, words, numbers, now, rows, spent, is_predicted):
    """Take up to len(rows) steps. Return (reason, number of steps, swapped).

    words, numbers: the words of the calls, as int64 and float64 in the same memory; spent: seconds
    by phase; is_predicted: whether the call begins after the prediction of a step, with new lists.
    swapped: whether the two swapped arrays have changed places. The column WALL of the rows has
    seconds since the call, CPU is left out. Raises MemoryError.
    """
    calls, passes = plan.calls, plan.motion + 1
    correction = passes + plan.swaps.size
    moment = np.empty(2, np.int64)
    begun = last = _nanoseconds(plan.clock, moment)
    swapped = False
    steps = 0
    while steps < rows.shape[0] and (is_predicted or now[NOW] < bounds.until):
        if not is_predicted:
            dt, lands = next_step(now[NOW], now[LIMIT], bounds.until)
            now[LENGTH], now[UNTIL] = dt, (bounds.until if lands else now[NOW] + dt)
            _set(numbers, plan.dt, dt)
            now[GIVEN] += _run(calls, 0, plan.motion, words, numbers)
            moved = _run(calls, plan.motion, passes, words, numbers)
            grown = numbers[calls[plan.motion, 1] + 2]
            now[REACH] = 1.0 + bounds.skin - 2.0 * moved
            if not now[REACH] > grown:
                return STALE, steps, swapped
        is_predicted = False
        _set(numbers, plan.reach, now[REACH])
        last = _stamp(plan.clock, moment, last, spent, 0)
        arrays.wanted[:] = 1.0
        for index in range(plan.swaps.size):
            _run(calls, passes + index, passes + index + 1, words, numbers)
            if index == 0 and plan.widens and not _found(arrays.wanted, arrays.density):
                return WIDER, steps, swapped
            if plan.swaps[index]:
                swapped = not swapped
                _exchange(words, plan.first, plan.second)
            if index == 0 and plan.widens and bounds.max_support < np.inf:
                support = arrays.second if swapped else arrays.first
                now[LIMITED] = _number_of(support, bounds.max_support)
            last = _stamp(plan.clock, moment, last, spent, plan.phases[index])
        now[GIVEN] += _run(calls, correction, calls.shape[0] - 4, words, numbers)
        now[NOW] = now[UNTIL]
        last = _stamp(plan.clock, moment, last, spent, 0)
        row = rows[steps]
        _measure(plan, bounds, arrays, words, numbers, now, row)
        steps += 1
        last = _stamp(plan.clock, moment, last, spent, 1)
        row[WALL] = 1e-9 * (last - begun)
        if not _passes_checks(bounds, arrays, bounds.step + steps, row):
            return DOUBTFUL, steps, swapped
        if row[WALL] > bounds.longest:
            break
    return PAUSED, steps, swapped


@njit(**OPTIONS)
def _run(calls, first, last, words, numbers):
    """Make the calls [first, last). Return the sum of their results, or of the first of each."""
    base = words.ctypes.data
    total = 0.0
    for k in range(first, last):
        if call(calls[k, 0], base + 8 * calls[k, 1]) != 0:
            raise MemoryError("not enough memory for a time step")
        total += numbers[calls[k, 1] + 1]
    return total


@njit(**OPTIONS)
def _set(numbers, places, value):
    for place in places:
        numbers[place] = value


@njit(**OPTIONS)
def _exchange(words, first, second):
    one, other = words[first[0]], words[second[0]]
    for place in first:
        words[place] = other
    for place in second:
        words[place] = one


@njit(**OPTIONS)
def _nanoseconds(clock, moment):
    read_clock(clock[0], clock[1], moment.ctypes.data)
    return 1_000_000_000 * moment[0] + moment[1]


@njit(**OPTIONS)
def _stamp(clock, moment, last, spent, phase):
    """Add the time since `last` to a phase, and return the present time in ns."""
    here = _nanoseconds(clock, moment)
    spent[phase] += 1e-9 * (here - last)
    return here


@njit(**OPTIONS)
def _found(wanted, density):
    """Whether a pass found all supports: no block requests wider lists, no density is negative."""
    found = True
    for block in range(wanted.size):
        found = found and not wanted[block] > 0.0
    for i in range(density.size):
        found = found and not density[i] < 0.0
    return found


@njit(**OPTIONS)
def _number_of(support, largest):
    number = 0
    for i in range(support.size):
        number += support[i] == largest
    return number


@njit(**OPTIONS)
def _measure(plan, bounds, arrays, words, numbers, now, row):
    """Write a row, and the limit of the next step: `totals.of`, `step_size.limit`."""
    calls = plan.calls
    K = calls.shape[0]
    _run(calls, K - 4, K - 1, words, numbers)
    totals, smallest, change, contact = (
        calls[K - 4, 1] + 1, calls[K - 3, 1] + 1, calls[K - 2, 1] + 1, calls[K - 1, 1] + 1,
    )  # fmt: skip
    for column in range(KINETIC, RATES + 1):
        row[column] = numbers[totals + column - KINETIC]
    D = arrays.momentum.size
    for d in range(D):
        row[MOMENTUM + d] = arrays.momentum[d]
    energy = row[RELATIVE] + row[INTERNAL] + 0.0
    row[DRIFT] = drift_of(energy, bounds.added, bounds.baseline_energy, bounds.baseline_scale)
    rate = rate_of_supports(numbers[change], plan.has_divergence, D, now[LENGTH])
    limit, particle, criterion = restricted(
        bounds.courant * numbers[smallest], words[smallest + 1], words[smallest + 2], rate,
        words[change + 1], now[LIMIT], bounds.end,
    )  # fmt: skip
    _set(numbers, plan.next_dt, limit)
    part = _run(calls, K - 1, K, words, numbers)
    if part < 1.0:
        limit, particle, criterion = part * limit, words[contact + 1], APPROACH
    now[LIMIT] = limit
    row[TIME] = now[NOW]
    row[STEP_LIMIT] = limit
    row[LIMITER] = particle
    row[CRITERION] = criterion
    row[INJECTED] = now[GIVEN]
    row[HELD] = now[LIMITED]


@njit(**OPTIONS)
def _passes_checks(bounds, arrays, step, row):
    """Whether the watchdog would find nothing; if in doubt, False."""
    if not is_sound(
        row[KINETIC] + row[INTERNAL] + 0.0, row[MAX_DENSITY], row[RATES], row[STEP_LIMIT],
        row[MIN_DENSITY], row[MIN_ENERGY], row[TIME],
    ):  # fmt: skip
        return False
    if not abs(row[DRIFT]) <= bounds.max_drift:
        return False
    if bounds.box_volume > 0.0:
        ratio = row[VOLUME] / bounds.box_volume
        if not math.isfinite(ratio) or (step >= SETTLING and not fits_box(ratio)):
            return False
    for fence in range(arrays.fences.shape[0]):
        axis = int(arrays.fences[fence, 0])
        low, high = arrays.fences[fence, 1], arrays.fences[fence, 2]
        for i in range(arrays.position.shape[1]):
            if not low <= arrays.position[axis, i] <= high:
                return False
    return True
