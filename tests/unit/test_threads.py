"""Loops over particles that threads share: no bit may depend on the number of threads."""

import math
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from sph import state as states
from sph import threads, totals
from sph.integrators import leapfrog, step_size
from sph.neighbours import order
from sph.part import Evolved
from sph.state import COMMON, Field, State
from sph.threads import Team

CHUNK = 8
TEAMS = [2, 3, 7]
# around one, two, three and many chunks
SIZES = [1, 7, 8, 9, 15, 16, 17, 24, 25, 1003]
FIELDS = (*COMMON, Field("div_v"), *(Field(f"tensor{of}", 2) for of in ("", "_rate", "_full")))
EVOLVED = (
    Evolved("internal_energy", "energy_rate", "predicted_energy", leapfrog.POSITIVE),
    Evolved("tensor", "tensor_rate", "tensor_full", leapfrog.STRAIGHT),
)
BOUNDS = step_size.Bounds(0.3, "signal_speed", energy=True, acceleration=True, end=1e9)


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    for module in (threads, states, order):
        monkeypatch.setattr(module, "CHUNK", CHUNK)


@pytest.fixture
def team():
    """team(threads): a team that is closed after the test."""
    made = []

    def make(number):
        made.append(Team(number))
        return made[-1]

    yield make
    for each in made:
        each.close()


def gas(n, dimension=2, seed=1):
    """Random values in all fields, some of which cool so much that energies must be kept."""
    random = np.random.default_rng(seed)
    state = State.at_start(FIELDS, *np.ones((2, dimension, n)), np.ones(n), np.ones(n))
    for field in FIELDS:
        if not field.integer:
            signed = field.rank or field.name in ("energy_rate", "div_v")
            low = -1.0 if signed else 0.5
            getattr(state, field.name)[:] = random.uniform(low, 2.0, field.shape(dimension, n))
    state.id[:] = random.permutation(n) + 1
    state.energy_rate[5::20] = -9.0
    return state


def bits(state):
    return {field.name: getattr(state, field.name).tobytes() for field in state.fields}


# --- ranges and chunks --------------------------------------------------------------------------


@pytest.mark.parametrize("number", [1, *TEAMS])
def test_chunks_do_not_depend_on_threads(team, number):
    found = team(number).chunks(lambda first, last, step: (first, last, step), 20, "argument")
    assert found == [(0, 8, "argument"), (8, 16, "argument"), (16, 20, "argument")]


@pytest.mark.parametrize("number", [1, *TEAMS])
def test_ranges_cover_all_items_in_order(team, number):
    found = team(number).run(lambda *edges: edges, 100, smallest=10)
    assert len(found) == min(4 * number, 10) if number > 1 else 1
    assert [first for first, _ in found] == [0, *(last for _, last in found[:-1])]
    assert found[-1][1] == 100


def test_threads_of_team_work_at_the_same_time(team):
    """Each of three calls waits for the two others."""
    begun = []

    def meet(first, last):
        begun.append(first)
        end = time.monotonic() + 60.0
        while len(begun) < 3:
            assert time.monotonic() < end
            time.sleep(1e-3)

    team(3).chunks(meet, 3 * CHUNK)


@pytest.mark.parametrize("number", [1, *TEAMS])
@pytest.mark.parametrize("wrong", [0, 5, 9])
def test_error_in_any_thread_is_raised(team, number, wrong):
    def fail(first, last):
        time.sleep(1e-3)  # so that other threads take part
        if first == wrong * CHUNK:
            raise MemoryError("here")

    with pytest.raises(MemoryError, match="here"):
        team(number).chunks(fail, 10 * CHUNK)


# --- loops over particles -----------------------------------------------------------------------


def stepped(n, team):
    """(energies given, totals, limits, bits) of one step without its passes."""
    state = gas(n)
    given = leapfrog.predict(state, EVOLVED, 0.3, team), leapfrog.correct(state, EVOLVED, 0.3, team)
    found = totals.of(state, (), np.array([1.0, 0.0]), team)
    past = step_size.Past(1e-3, 1e9)
    limits = [step_size.limit(BOUNDS, state, (), past, team)]
    state.reorder(np.random.default_rng(2).permutation(n), ("id", "mass", "velocity"), team)
    arrays = bits(state)
    del state.div_v
    limits.append(step_size.limit(BOUNDS, state, (), past, team))
    sums = [
        np.array(found[k]).tobytes() for k, name in enumerate(found._fields) if name != "energies"
    ]
    return given, sums, limits, arrays


@pytest.mark.parametrize("n", SIZES)
def test_step_on_threads_equals_step_on_one_bit_for_bit(team, n):
    alone = stepped(n, team(1))
    for number in TEAMS:
        assert stepped(n, team(number)) == alone


def test_chunks_together_equal_one_chunk(team, monkeypatch):
    """Sums by chunks differ in rounding alone, and everything else not at all."""
    n = 1003
    given, _, limits, arrays = stepped(n, team(1))
    by_chunks = totals.of(gas(n), (), np.array([1.0, 0.0]))
    monkeypatch.setattr(threads, "CHUNK", n)
    whole = stepped(n, team(1))
    assert (limits, arrays) == (whole[2], whole[3])
    assert given == pytest.approx(whole[0], rel=1e-14)  # tens of terms of one sign
    expected = totals.of(gas(n), (), np.array([1.0, 0.0]))
    for name in by_chunks._fields:
        if name != "energies":
            # sums of a thousand terms of about one, some of both signs
            np.testing.assert_allclose(
                getattr(by_chunks, name), getattr(expected, name), rtol=1e-12, atol=1e-11
            )
    for name in ("min_density", "max_density", "min_internal_energy", "max_internal_energy"):
        assert getattr(by_chunks, name) == getattr(expected, name)
    assert given[0] > 0.0  # the loop with branches was used as well


def test_energy_that_needs_no_keeping_rounds_alike_with_and_without_branches():
    """One particle that cools takes all of its range through the other loop."""
    random = np.random.default_rng(3)
    n, dt = 1003, 0.7
    given = random.uniform(1.0, 2.0, (1, n)), random.normal(size=(1, n)) * 0.3
    mass, results = np.ones(n), []
    for last_rate in (0.1, -100.0):
        energy, rate, full = given[0].copy(), given[1].copy(), np.empty((1, n))
        rate[0, -1] = last_rate
        leapfrog.POSITIVE.predict(0, n, dt, energy, rate, mass, full)
        half = energy.copy()
        leapfrog.POSITIVE.correct(0, n, dt, energy, rate, mass)
        results.append([array[0, :-1].tobytes() for array in (full, half, energy)])
    assert results[0] == results[1]


@pytest.mark.parametrize("boost", [0.0, 1e6])
def test_kinetic_energy_without_bulk_by_chunks_excludes_motion_of_all(boost):
    """Chunks whose mean velocities differ, against long arithmetic."""
    n = 100
    state = gas(n)
    state.velocity[0] += boost + np.arange(n)
    mass = state.mass.tolist()
    expected = 0.0
    for row in state.velocity.tolist():
        mean = math.fsum(m * v for m, v in zip(mass, row, strict=True)) / math.fsum(mass)
        expected += 0.5 * math.fsum(m * (v - mean) ** 2 for m, v in zip(mass, row, strict=True))
    found = totals.of(state, (), np.ones(2)).kinetic_energy_without_bulk
    # the mean rounds at 1e-16 of the boost, which is 3e4 times the velocities left
    assert found == pytest.approx(expected, rel=1e-14 + 1e-17 * boost)


@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.parametrize("where", [0, 7, 8, 24])
@pytest.mark.parametrize(
    ("field", "total"),
    [
        ("velocity", "kinetic_energy"), ("internal_energy", "internal_energy"),
        ("density", "volume"), ("acceleration", "rates"), ("energy_rate", "rates"),
    ],
)  # fmt: skip
def test_nan_in_any_chunk_is_seen_in_totals(team, number, where, field, total):
    state = gas(25)
    getattr(state, field)[..., where] = np.nan
    assert np.isnan(getattr(totals.of(state, (), np.ones(2), team(number)), total))


@pytest.mark.parametrize("number", [1, 3])
def test_nan_is_kept_and_limits_no_step(team, number):
    """As on one thread: the watchdog finds NaN by the totals, and the limit names a particle."""
    state = gas(25)
    state.internal_energy[8] = state.signal_speed[16] = np.nan
    limit = step_size.limit(BOUNDS, state, (), None, team(number))
    assert np.isfinite(limit.dt)
    assert limit.particle > 0
    leapfrog.predict(state, EVOLVED, 1e-3, team(number))
    assert np.isnan(state.internal_energy[8])
    assert np.isnan(state.predicted_energy[8])


@pytest.mark.parametrize("criterion", ["signal_speed", "energy", "acceleration"])
@pytest.mark.parametrize("least", [0, 63, 64, 200, 1002])
def test_smallest_step_is_found_wherever_the_particle_is(monkeypatch, least, criterion):
    """Among particles of which most are passed over in groups without a division."""
    monkeypatch.setattr(threads, "CHUNK", 10_000)
    state = gas(1003)
    # limits of 2, but 1 by the criterion, and a little less for one particle
    state.support[:], state.signal_speed[:], state.div_v[:] = 1.0, 1.0, 0.0
    state.internal_energy[:], state.energy_rate[:] = 1.0, 0.5
    state.acceleration[:] = np.array([[0.25], [0.0]])
    less = np.ones(1003)
    less[least] += 1e-12
    expected = 1.0 / less[least]
    if criterion == "signal_speed":
        state.signal_speed[:] = 2.0 * less
    elif criterion == "energy":
        state.energy_rate[:] = -less
    else:
        state.acceleration[0] = less
        expected = np.sqrt(expected)
    bounds = BOUNDS._replace(courant=1.0, acceleration=criterion == "acceleration")
    assert step_size.limit(bounds, state, (), None) == (expected, state.id[least], criterion)


def test_equal_steps_name_lowest_id_of_all_chunks():
    state = gas(1003)
    state.support[:], state.signal_speed[:], state.div_v[:] = 1.0, 3.0, 0.0
    free = BOUNDS._replace(energy=False, acceleration=False)
    assert step_size.limit(free, state, (), None).particle == 1
    state.div_v[:] = -100.0
    assert step_size.limit(free, state, (), None)[1:] == (1, "support")


def test_sum_does_not_depend_on_threads_of_blas():
    """Products of more than 10000 numbers round differently on one and two threads of OpenBLAS."""
    program = (
        "import numpy as np; from sph.state import COMMON, State; "
        "r = np.random.default_rng(1); n = 100000; "
        "s = State(COMMON, {'mass': r.random(n)}); "
        "print(*(s.total(r.random(n)).hex() for _ in range(10)))"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", program], env=os.environ | {"OPENBLAS_NUM_THREADS": number},
            capture_output=True, text=True, check=True, timeout=300,
        ).stdout
        for number in ("1", "2", "3")
    }  # fmt: skip
    assert len(found) == 1


# --- the order ----------------------------------------------------------------------------------


def places(kind, dimension, n):
    x = np.random.default_rng(4).random((dimension, n))
    return {"random": x, "lattice": np.floor(6 * x), "coincident": np.zeros_like(x)}[kind]


@pytest.mark.parametrize("sample", [1, 64])
@pytest.mark.parametrize("kind", ["random", "lattice", "coincident"])
@pytest.mark.parametrize("dimension", [1, 3])
def test_order_on_threads_equals_order_on_one(team, monkeypatch, dimension, kind, sample):
    """With all of the first levels split by all threads; a sample of one misses the median."""
    monkeypatch.setattr(order, "SMALLEST_RANGE", 0)
    monkeypatch.setattr(order, "LARGE", 2 * order.BLOCK)
    monkeypatch.setattr(order, "SAMPLE", sample)
    split = []
    by_team = order._split_by_team
    monkeypatch.setattr(order, "_split_by_team", lambda *a: split.append(a[4:6]) or by_team(*a))
    for n in (100, 1003):
        position = places(kind, dimension, n)
        identity = np.random.default_rng(5).permutation(n) + 1
        alone = order.block_order(position, identity, team(1))
        assert sorted(alone) == list(range(n))
        for number in TEAMS:
            split.clear()
            found = order.block_order(position, identity, team(number))
            np.testing.assert_array_equal(found, alone)
            assert len(split) >= min(number - 1, 3)


@pytest.mark.parametrize(("smallest", "subtrees"), [(1, 32), (6, 16), (15, 8), (16, 1), (300, 1)])
def test_order_is_shared_as_far_as_subtrees_are_large_enough(team, monkeypatch, smallest, subtrees):
    """126 blocks on seven threads: up to 32 subtrees, each of at least `smallest` blocks."""
    monkeypatch.setattr(order, "SMALLEST_RANGE", smallest)
    seven, items = team(7), []
    run = seven.run
    monkeypatch.setattr(seven, "run", lambda f, n, *a, **k: items.append(n) or run(f, n, *a, **k))
    position, identity = places("random", 2, 1003), np.arange(1003)
    found = order.block_order(position, identity, seven)
    assert items[-1] == subtrees
    np.testing.assert_array_equal(found, order.block_order(position, identity, team(1)))
