"""CPU seconds by phase, with compilation apart."""

import time
from contextlib import closing
from types import SimpleNamespace

import pytest
from numba import njit

from sph.clock import STARTING, Clock


def burn(seconds):
    """Spend CPU time."""
    begin = time.process_time()
    while time.process_time() - begin < seconds:
        pass


@pytest.fixture
def clock():
    with closing(Clock()) as made:
        yield made


def test_phase_adds_up_cpu_time_without_waiting(clock):
    for _ in range(2):
        with clock.phase("work"):
            burn(0.02)
            time.sleep(0.05)
    with clock.phase("other"):
        burn(0.01)
    assert set(clock.seconds) == {"work", "other"}
    # whatever else the test's machine does is not counted, but for the burning's own last turn
    assert 0.04 <= clock.seconds["work"] < 0.09
    assert clock.cpu >= sum(clock.seconds.values())
    assert clock.wall >= 0.14


def test_phase_excludes_compilation(clock):
    @njit
    def outer(x):
        return inner(x) + 1.0

    @njit
    def inner(x):
        return x * x

    with clock.phase("work"):
        outer(2.0)
        burn(0.02)
    assert clock.compiling > 0.01  # two functions, the inner one while the outer one is compiled
    assert 0.02 <= clock.seconds["work"] < 0.02 + 0.5 * clock.compiling
    assert clock.cpu >= clock.seconds["work"]


def test_first_compilation_calls_callback_at_its_start(clock):
    told = []
    clock.on_compilation = lambda: told.append(clock.compiling)

    @njit
    def one(x):
        return x + 1.0

    @njit
    def other(x):
        return x + 2.0

    one(1.0)
    other(1.0)
    assert told == [0.0]


def test_phase_that_raises_is_counted(clock):
    def fail():
        with clock.phase("work"):
            burn(0.01)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert clock.seconds["work"] >= 0.01


def test_closed_clock_ignores_compilation(clock):
    Clock().close()
    other = Clock()
    other.close()

    @njit
    def compiled(x):
        return x - 1.0

    compiled(2.0)
    assert other.compiling == 0.0
    assert clock.compiling > 0.0


@pytest.fixture
def fake_time(monkeypatch):
    """The times that a clock reads, to be set, and a clock that began at 10 s and 100 s."""
    now = SimpleNamespace(cpu=10.0, wall=100.0)
    read = SimpleNamespace(process_time=lambda: now.cpu, perf_counter=lambda: now.wall)
    monkeypatch.setattr("sph.clock.time", read)
    with closing(Clock()) as now.clock:
        yield now


def test_seconds_are_cpu_and_wall_counts_from_start(fake_time):
    fake_time.cpu, fake_time.wall = 13.0, 107.0
    assert (fake_time.clock.cpu, fake_time.clock.wall) == (3.0, 7.0)


def test_compilation_and_numba_start_counted_apart(fake_time):
    clock = fake_time.clock
    with clock.phase("work"):
        fake_time.cpu += 1.0
        for length in (2.0, 4.0):
            clock.on_start(None)
            fake_time.cpu += length
            clock.on_start(None)
            fake_time.cpu += length
            clock.on_end(None)
            clock.on_end(None)
    with clock.phase("work"):
        fake_time.cpu += 8.0
        fake_time.wall += 50.0
    with clock.phase(STARTING):
        fake_time.cpu += 0.5
    assert clock.compiling == 12.0
    assert clock.seconds == {"work": 9.0, STARTING: 0.5}
    assert clock.cpu == 9.0  # without the other two
    assert clock.wall == 50.0
