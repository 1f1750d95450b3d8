"""Individual (block) time steps: each particle has its own step, a power of two of ticks.

A long step of the simulation has TICKS ticks. A particle's step is at most twice as long as its
last one, and begins at a multiple of its own length. `sph.individual` takes the steps.
"""

import math

import numpy as np
from numba import njit
from numba.extending import register_jitable

from sph.compiled import COMPILED
from sph.integrators.step_size import SUPPORT_CHANGE
from sph.neighbours.order import BLOCK
from sph.part import Pass
from sph.state import Field, Public

TICKS = 2.0**40  # of a long step: exact in floating point

# The longest step is at most this multiple of the shortest. Particles whose own steps could be
# longer cost little if they are computed once in so many shortest steps.
DEPTH = 128.0

ROUNDING = 1.0 + 1e-9

LONGER = 2.0  # largest ratio of a step to the last step of the particle

PREDICTION = 0.6  # largest |div v| dt for which the change of a density is predicted

FIELDS = (
    Field(
        "time_step",
        above=0.0,
        public=Public("TimeSteps", 0, 0, 1, 0, "Time step that the state of the particle allows"),
    ),
    Field("step_begin", stored=False),  # in ticks of the present long step
    Field("step_end", stored=False),
    Field("own_step", stored=False),  # length of the step that ends now, or 0
    Field("active", stored=False),  # see `sph.passes.active`
)


def fields(of_parts: tuple[Field, ...], passes: tuple[Pass, ...]) -> tuple[Field, ...]:
    """Return the fields of a scene with individual steps, from those that its parts declare.

    A tick writes the fields of passes for active particles only, and reads them for all. Therefore
    checkpoints must contain them.
    """
    written = {name for one in passes for name in one.fields_written}
    written -= {one.swaps[1] for one in passes if one.swaps is not None}
    found = (
        field._replace(stored=True, remade=field.remade or not field.stored)
        if field.name in written else field
        for field in of_parts
    )  # fmt: skip
    return (*found, *FIELDS)


@register_jitable
def power_of_two(x: float) -> float:
    """Return the largest power of two up to x > 0, but for rounding.

    A step that may be twice as long as the last one must not remain as it is for a rounding error.
    """
    return math.ldexp(1.0, math.frexp(x * ROUNDING)[1] - 1)


# Each function below considers particles [first, last); arrays are (N,).


@njit(**COMPILED)
def begin_all(first, last, per_tick, time_step, begin, end):
    """Begin a step for each particle. Return the shortest step, in ticks, and the sum of 1/step."""
    shortest, rates = np.inf, 0.0
    for k in range(first, last, BLOCK):
        length = TICKS
        for i in range(k, min(k + BLOCK, last)):
            length = min(length, power_of_two(max(time_step[i] * per_tick, 0.5)))
        for i in range(k, min(k + BLOCK, last)):
            begin[i], end[i] = 0.0, length
            rates += 1.0 / length
        shortest = min(shortest, length)
    return shortest, rates


@njit(**COMPILED)
def first_end(first, last, end):
    least = end[first]
    for i in range(first, last):
        least = min(least, end[i])
    return least


@njit(**COMPILED)
def activate(first, last, now, tick, begin, end, active, since, own):
    """Set active, since and own for the time `now`; return the number of active particles."""
    number = 0
    for i in range(first, last):
        since[i] = (now - begin[i]) * tick
        ends = end[i] == now
        active[i] = 1.0 if ends else 0.0
        own[i] = since[i] if ends else 0.0
        number += ends
    return number


@njit(**COMPILED)
def drift(first, last, dt, dimension, largest, divergence, density, support):
    """Predict density and support after dt, by drho/dt = -rho div v and dH/dt = H div v/D."""
    for i in range(np.uint64(first), np.uint64(last)):
        half = 0.5 * min(max(divergence[i] * dt, -PREDICTION), PREDICTION)
        # as good as exponentials for changes that are so small, and inverse to each other
        density[i] *= (1.0 - half) / (1.0 + half)
        half /= dimension
        support[i] = min(support[i] * (1.0 + half) / (1.0 - half), largest)


@njit(**COMPILED)
def allow(
    first, last, courant, energy_limit, dimension, active, own, identity, support, signal_speed,
    energy, energy_rate, acceleration, divergence, time_step,
):  # fmt: skip
    """Set the steps that active particles allow: eq 32 and the limits of `step_size`.

    Returns the shortest, the ID of its particle, and the index of its criterion. The shortest is 0
    if a step is not positive.
    """
    best, particle, criterion = np.inf, 0, 0
    for i in range(first, last):
        if active[i] == 0.0:
            continue
        dt, reason = 2.0 * support[i] / signal_speed[i], 0
        if energy_limit and energy[i] > 0.0 and energy[i] < dt * abs(energy_rate[i]):
            dt, reason = energy[i] / abs(energy_rate[i]), 1
        if acceleration is not None:
            squared = 0.0
            for d in range(acceleration.shape[0]):
                squared += acceleration[d, i] ** 2
            by_acceleration = np.sqrt(support[i] / np.sqrt(squared))
            if by_acceleration < dt:
                dt, reason = by_acceleration, 2
        dt *= courant
        if abs(divergence[i]) * dt > SUPPORT_CHANGE * dimension:
            dt, reason = SUPPORT_CHANGE * dimension / abs(divergence[i]), 3
        if LONGER * own[i] < dt:
            dt, reason = LONGER * own[i], 4
        time_step[i] = dt
        if not dt > 0.0:  # NaN, too
            return 0.0, identity[i], reason
        if dt < best or (dt == best and identity[i] < particle):
            best, particle, criterion = dt, identity[i], reason
    return best, particle, criterion


@njit(**COMPILED)
def lengths(first, last, tick, time_step, active, begin, end, length):
    """Set the lengths of steps in ticks: those allowed if active, otherwise the present ones."""
    for i in range(first, last):
        length[i] = time_step[i] / tick if active[i] > 0.0 else end[i] - begin[i]


@njit(**COMPILED)
def begin_next(first, last, now, tick, length, allowed, active, time_step, begin, end):
    """Begin the next steps of active particles, and end the steps of others early if necessary.

    Active particles of a block begin equal steps, so that later whole blocks are active together:
    a pass over a block takes almost as long for one particle as for all. `first` begins a block.
    """
    for k in range(first, last, BLOCK):
        shortest = TICKS
        for i in range(k, min(k + BLOCK, last)):
            if active[i] > 0.0:
                shortest = min(shortest, power_of_two(max(min(length[i], allowed[i]), 1.0)))
        while math.floor(now / shortest) * shortest != now:  # steps begin at their multiples
            shortest *= 0.5
        for i in range(k, min(k + BLOCK, last)):
            if active[i] > 0.0:
                if allowed[i] < length[i]:
                    time_step[i] = allowed[i] * tick
                begin[i], end[i] = now, now + shortest
            elif allowed[i] < length[i]:
                step = power_of_two(max(allowed[i], 1.0))
                end[i] = min(end[i], (math.floor(now / step) + 1.0) * step)
