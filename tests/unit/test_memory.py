"""Memory of a run: arrays that are kept, temporary arrays, and what the C library keeps.

The benchmark measures the slope of the peak of whole processes, 285 bytes per particle in 3-D. The
peak of the small runs of a test is that of the imports, so the tests here count arrays.
"""

import ctypes
import subprocess
import sys
import tracemalloc
import weakref

import h5py
import numpy as np
import pytest

from sph import config, resolution
from sph.analysis import errors
from sph.clock import Clock
from sph.neighbours import lists
from sph.output import layout
from sph.runner import state_of
from sph.scene import Scene
from sph.simulation import Simulation
from sph.state import State

N = 16**3
GAS = f"""
[problem]
name = "uniform"
dimension = 3
n = {N}
noise = 0.2
[physics]
alpha = 1.0
balsara = true
[time]
end = 0.1
"""
TUBE = '[problem]\nname = "shock_tube"\nn = 60\n[time]\nend = 0.1\n'


def started(text):
    return Simulation.start(Scene(config.from_text(text, "the test")), 1, Clock())


@pytest.fixture(scope="module")
def gas():
    simulation = started(GAS)
    simulation.advance(0.1)
    return simulation


def arrays_of(*owners):
    """The arrays that objects hold, by address, so that each counts once."""
    found, seen, rest = {}, set(), list(owners)
    while rest:
        one = rest.pop()
        if isinstance(one, np.ndarray):
            base = one
            while isinstance(base.base, np.ndarray):
                base = base.base
            found[base.ctypes.data] = base
        elif id(one) not in seen:
            seen.add(id(one))
            if isinstance(one, tuple | list):
                rest += one
            elif isinstance(one, dict):
                rest += one.values()
            elif type(one).__module__.startswith("sph."):
                rest += vars(one).values() if hasattr(one, "__dict__") else []
    return list(found.values())


def bytes_per_particle(*owners):
    return sum(array.nbytes for array in arrays_of(*owners)) / N


def test_arrays_that_a_3d_run_keeps(gas):
    """27 numbers in fields, 4 of the lists' origin, boxes 6 bytes, `wanted` 1, and the lists."""
    entries = gas.search.lists.entries.nbytes / N
    assert entries < 20.0  # 11 to 18 in runs of 16^3 to 100^3 particles
    assert bytes_per_particle(gas.particles) == 8 * 27
    kept = bytes_per_particle(gas.particles, gas.search, gas.sweep)
    # the rest: start and length of each list, and the images
    assert kept - entries <= 8 * (27 + 4) + 6 + 1 + 2


def test_old_lists_are_freed_before_particles_are_reordered(monkeypatch):
    simulation, alive = started(TUBE), []
    search = simulation.search
    old = [weakref.ref(one) for one in (search.lists.entries, search.origin.position, search.boxes)]
    build, reorder = lists.Builder.all, State.reorder

    def watched(function):
        def call(*arguments):
            alive.append([one() is not None for one in old])
            return function(*arguments)

        return call

    monkeypatch.setattr(State, "reorder", watched(reorder))
    monkeypatch.setattr(lists.Builder, "all", watched(build))
    while not alive:
        simulation.advance(0.1)
    assert alive == [[False] * 3] * 2


def test_end_frees_the_arrays_that_checkpoints_do_not_store():
    simulation = started(TUBE)
    before, stored = simulation.nearest(), simulation.particles.arrays()
    simulation.end()
    particles = simulation.particles
    assert particles.arrays().keys() == stored.keys()
    assert sorted(map(id, arrays_of(particles))) == sorted(map(id, stored.values()))
    np.testing.assert_array_equal(simulation.nearest(), before)


def transient(function):
    """Bytes per particle of the arrays that exist at once during a call, beyond those before."""
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    function()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return (peak - before) / N


# Bounds of the following tests: what was measured, and 8 to 10 % to spare for objects of Python.


@pytest.mark.parametrize("precision", ["double", "single"])
def test_check_of_resolution_needs_few_arrays(gas, monkeypatch, precision):
    monkeypatch.setattr(Scene, "is_single", precision == "single")
    assert transient(lambda: resolution.check(gas)) < 50.0


def test_errors_of_vectors_are_computed_axis_by_axis(gas):
    p, exact = gas.particles, np.zeros((3, N))
    state, inside = {"velocity": p.velocity}, np.ones(N, dtype=bool)
    needed = transient(lambda: errors.by_field(state, {"velocity": exact}, p.mass, inside))
    assert needed < 44.0


def test_public_fields_are_written_in_parts(gas, monkeypatch, tmp_path):
    monkeypatch.setattr(layout, "LARGEST_CHUNK", 24 * N // 16)
    checkpoint = state_of(gas)
    with h5py.File(tmp_path / "public.h5", "w") as file:
        assert transient(lambda: layout.write_public(file, checkpoint)) < 26.0


FRAGMENTS = """
import os
import numpy as np
from sph import allocation

allocation.return_large_arrays()

def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

large = np.ones(3 << 20)
del large  # glibc keeps later arrays of up to this size
arrays = [np.ones(1 << 18) for _ in range(40)]
full = resident()
del arrays[1:-1]  # those between the first and the last
print(full - resident())
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="an option of glibc")
def test_large_arrays_go_back_to_the_system():
    done = subprocess.run([sys.executable, "-c", FRAGMENTS], capture_output=True, check=True)
    freed = int(done.stdout)
    assert freed > 0.95 * 38 * (1 << 21)
