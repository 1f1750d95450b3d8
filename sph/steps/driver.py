"""Several time steps in one call of a compiled function.

`take` makes the same calls in the same order as `Simulation.advance`, by address (`calls`), so its
own code is one for all scenes. It returns where Python is needed: at `until`, after a number of
steps or seconds, where lists must be built or widened, and after a step whose sums the watchdog
might refuse. No flag of fast arithmetic is set, so numbers have the bits of Python's. Arguments are
few arrays of numbers, which takes a third of the time to compile.
"""

from typing import Any

import numpy as np
from numba import njit

from sph.arrays import empty
from sph.compiled import LEAN
from sph.integrators.step_size import next_step, rate_of_supports, restricted
from sph.steps.calls import call, read_clock
from sph.totals import drift_of
from sph.watchdog import SETTLING, fits_box, is_sound

# Why `take` returned. Python builds stale lists after the prediction of a step, which the next call
# completes; it completes a step whose first pass requests wider lists; and after a doubtful step it
# looks for gas that would meet in the next one, and repeats the watchdog's checks.
PAUSED, STALE, WIDER, DOUBTFUL = range(4)

# Columns of the rows, one row a step; the components of momentum follow.
(
    TIME, STEP_LIMIT, LIMITER, CRITERION, KINETIC, RELATIVE, INTERNAL, VOLUME, MIN_DENSITY,
    MAX_DENSITY, MIN_ENERGY, MAX_ENERGY, RATES, DRIFT, INJECTED, HELD, WALL, CPU, MOMENTUM,
) = range(19)  # fmt: skip

# Entries of `now`, which changes from step to step: time, limit of the next step, energy injected,
# number of supports limited by max_support, reach factor of the lists, length and end of the last
# step, and the limit of the next step as far as known.
NOW, LIMIT, GIVEN, LIMITED, REACH, LENGTH, UNTIL, NEXT = range(8)

# Entries of `fixed`, numbers that do not change within a call. BOX: volume of a box that gas fills,
# 0 for others; STEP: number of steps before the call; LOWEST: bound of the internal energy;
# PAUSE: time from which on to return after the step that reached it; LONGEST: seconds after which
# to return.
(
    STOP, SKIN, COURANT, END, MAX_DRIFT, BASE_ENERGY, BASE_SCALE, ADDED, BOX, STEP, LOWEST,
    PAUSE, LONGEST,
) = range(13)  # fmt: skip

# What the result of a call is: energy injected (GIVES), motion since lists were built (MOVES),
# whether the first pass found all supports (FINDS), number of supports limited by max_support
# (COUNTS), sums (SUMS), smallest step (BOUNDS), largest change of supports by div v (DIVERGES) or
# by the last step (CHANGES), whether gas that has not met may meet in the next step (MEETS), and
# whether particles are within fences (FENCES).
(
    NOTHING, GIVES, MOVES, FINDS, COUNTS, SUMS, BOUNDS, DIVERGES, CHANGES, MEETS, FENCES,
) = range(11)  # fmt: skip

# Columns of `calls`: those of `Table.finished`, what follows, whether the two arrays are swapped
# then, and the phase that ends there, an index in `spent`, or -1.
THUNK, BEGIN, ACTION, SWAPS, PHASE = range(5)

# Kinds of words that change from step to step: entries of `now`, by their index, and the addresses
# of the two arrays that a pass may swap.
FIRST, SECOND = range(NEXT + 1, NEXT + 3)

FLAGS: dict[str, Any] = {"error_model": "numpy", **LEAN}
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, **FLAGS}
# of functions that only `take` calls: without wrappers for calls from Python
HELPER: dict[str, Any] = {"no_cpython_wrapper": True, **FLAGS}


@njit(**OPTIONS)
def take(calls, places, words, numbers, fixed, momentum, now, rows, spent, clock, first):
    """Take up to len(rows) steps. Return (reason, number of steps, swapped).

    calls: (K, 5) int64; places: (P, 2) kind and index of words; words, numbers: the words as int64
    and float64, in the same memory; momentum: (D,), part of the sums; spent: seconds by phase;
    clock: (2,) address and argument of clock_gettime; first: the first call, 0 or, to complete a
    step after its prediction, the one after MOVES. swapped: whether the two arrays have changed
    places. The column WALL of the rows has seconds since the call, CPU is left out. Raises
    MemoryError.
    """
    base = words.ctypes.data
    moment = empty(2, np.int64)
    begun = before = _nanoseconds(clock, moment)
    swapped = False
    steps = 0
    while steps < rows.shape[0] and (first > 0 or now[NOW] < fixed[STOP]):
        row = rows[steps]
        given = 0.0
        limit, particle, criterion = 0.0, 0, 0
        is_doubtful = False
        if first == 0:
            dt, lands = next_step(now[NOW], now[LIMIT], fixed[STOP])
            now[LENGTH], now[UNTIL] = dt, (fixed[STOP] if lands else now[NOW] + dt)
        _write(numbers, places, now)
        for k in range(first, calls.shape[0]):
            status: Any = call(calls[k, THUNK], base + 8 * calls[k, BEGIN])  # type: ignore
            if status != 0:
                raise MemoryError("not enough memory for a time step")
            at = calls[k, BEGIN] + 1
            result, action = numbers[at], calls[k, ACTION]
            if action == GIVES:
                given += result
            elif action == MOVES:
                now[GIVEN] += given
                given = 0.0
                now[REACH] = 1.0 + fixed[SKIN] - 2.0 * result
                if not now[REACH] > numbers[at + 1]:
                    return STALE, steps, swapped
                _write(numbers, places, now)
            elif action == FINDS:
                if result == 0.0:
                    return WIDER, steps, swapped
            elif action == COUNTS:
                now[LIMITED] = result
            elif action == SUMS:
                now[GIVEN] += given
                now[NOW] = now[UNTIL]
                for column in range(RATES + 1 - KINETIC):
                    row[KINETIC + column] = numbers[at + column]
                for d in range(momentum.size):
                    row[MOMENTUM + d] = momentum[d]
            elif action == BOUNDS:
                limit, particle, criterion = fixed[COURANT] * result, words[at + 1], words[at + 2]
            elif action in (DIVERGES, CHANGES):
                is_divergence = action == DIVERGES
                rate = rate_of_supports(result, is_divergence, momentum.size, now[LENGTH])
                limit, particle, criterion = restricted(
                    limit, particle, criterion, rate, words[at + 1], now[LIMIT], fixed[END]
                )
                now[NEXT] = limit
                _write(numbers, places, now)
            elif action == MEETS:
                is_doubtful = is_doubtful or result > 0.0
            elif action == FENCES:
                is_doubtful = is_doubtful or result == 0.0
            if calls[k, SWAPS] == 1:
                swapped = not swapped
                _exchange(words, places)
            if calls[k, PHASE] >= 0:
                here = _nanoseconds(clock, moment)
                spent[calls[k, PHASE]] += 1e-9 * (here - before)
                before = here
        first = 0
        steps += 1
        now[LIMIT] = limit
        row[TIME], row[STEP_LIMIT] = now[NOW], limit
        row[LIMITER], row[CRITERION] = particle, criterion
        row[INJECTED], row[HELD] = now[GIVEN], now[LIMITED]
        row[DRIFT] = drift_of(
            row[RELATIVE] + row[INTERNAL], fixed[ADDED], fixed[BASE_ENERGY], fixed[BASE_SCALE]
        )
        row[WALL] = 1e-9 * (before - begun)
        if is_doubtful or not _passes_checks(fixed, fixed[STEP] + steps, row):
            return DOUBTFUL, steps, swapped
        if row[WALL] > fixed[LONGEST] or now[NOW] >= fixed[PAUSE]:
            break
    return PAUSED, steps, swapped


@njit(**HELPER)
def _nanoseconds(clock, moment):
    read_clock(clock[0], clock[1], moment.ctypes.data)  # type: ignore[call-arg]
    return 1_000_000_000 * moment[0] + moment[1]


@njit(**HELPER)
def _write(numbers, places, now):
    """Write the entries of `now` to the words that hold them."""
    for index in range(places.shape[0]):
        if places[index, 0] < FIRST:
            numbers[places[index, 1]] = now[places[index, 0]]


@njit(**HELPER)
def _exchange(words, places):
    """Exchange the addresses of the two arrays that a pass swaps."""
    first = second = 0
    for index in range(places.shape[0]):
        if places[index, 0] == FIRST:
            first = words[places[index, 1]]
        elif places[index, 0] == SECOND:
            second = words[places[index, 1]]
    for index in range(places.shape[0]):
        if places[index, 0] == FIRST:
            words[places[index, 1]] = second
        elif places[index, 0] == SECOND:
            words[places[index, 1]] = first


@njit(**HELPER)
def _passes_checks(fixed, step, row):
    """Whether the watchdog would accept the sums; False if in doubt."""
    ratio = row[VOLUME] / fixed[BOX] if fixed[BOX] > 0.0 else 1.0
    return (
        is_sound(
            row[KINETIC] + row[INTERNAL], row[MAX_DENSITY], row[RATES], row[STEP_LIMIT],
            row[MIN_DENSITY], row[MIN_ENERGY], row[TIME], fixed[LOWEST],
        )
        and abs(row[DRIFT]) <= fixed[MAX_DRIFT]
        and abs(ratio) < np.inf
        and (step < SETTLING or fits_box(ratio))
    )  # fmt: skip


# --- functions that the driver calls by address ---------------------------------------------------


@njit(**OPTIONS)
def found(wanted, density):
    """Return 1.0 if no block requests wider lists and no density is negative; else 0.0.

    If so, sets `wanted` to 1.0, as passes expect it.
    """
    good = True
    for block in range(wanted.size):
        good = good and not wanted[block] > 0.0
    for i in range(density.size):
        good = good and not density[i] < 0.0
    if good:
        for block in range(wanted.size):
            wanted[block] = 1.0
    return 1.0 if good else 0.0


@njit(**OPTIONS)
def count(support, largest):
    """Return the number of supports of the size `largest`, as a float."""
    number = 0.0
    for i in range(support.size):
        number += 1.0 if support[i] == largest else 0.0
    return number


@njit(**OPTIONS)
def fenced(position, fences):
    """Return 1.0 if all particles are within fences, (F, 3) axis, lowest and highest position."""
    for k in range(fences.shape[0]):
        x = position[int(fences[k, 0])]
        for i in range(x.size):
            if not fences[k, 1] <= x[i] <= fences[k, 2]:
                return 0.0
    return 1.0
