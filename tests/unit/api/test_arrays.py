"""sph.Simulation: particles given as arrays, and the same state as by a problem file."""

import gc
import re
import threading
from pathlib import Path

import numpy as np
import pytest

import sph
from sph.problems.support import lattice

ROOT = Path(__file__).parents[3]
CLOUDS = ROOT / "docs" / "notebooks" / "two_clouds.py"
N = 400


@pytest.fixture(scope="module")
def by_file():
    tables = {
        "problem": {"file": CLOUDS, "n": N}, "time": {"end": 0.04}, "output": {"interval": 0.02}
    }  # fmt: skip
    return sph.run(tables)


def two_clouds(**changed):
    """The arrays of two_clouds.py, written once more for a script."""
    side = 20
    axis = (np.arange(side) + 0.5) / side
    position = np.stack([one.ravel() for one in np.meshgrid(axis, axis, indexing="ij")])
    left, right = (((position - [[x], [0.5]]) ** 2).sum(axis=0) < 0.01 for x in (0.3, 0.7))
    density = np.where(left | right, 4.0, 1.0)
    arrays = {
        "position": position,
        "velocity": np.stack([1.0 * left - 1.0 * right, np.zeros(N)]),
        "mass": density / N,
        "internal_energy": 1.0 / ((5.0 / 3.0 - 1.0) * density),
        "box": [0.0, 1.0],
        "physics": {"gamma": 5.0 / 3.0, "alpha": 1.0},
    }
    return arrays | changed


def test_two_clouds_by_file_and_by_arrays_are_equal_bit_for_bit(by_file):
    with sph.Simulation(**two_clouds()) as simulation:
        hashes = [simulation.state_hash]
        for time in (0.02, 0.04):
            simulation.advance(time)
            hashes.append(simulation.state_hash)
    assert hashes == [one.state_hash for one in by_file.checkpoints]
    assert len(set(hashes)) == 3


@pytest.mark.parametrize("threads", [1, 2])
def test_simulation_does_not_depend_on_threads_or_on_stops(by_file, threads):
    with sph.Simulation(**two_clouds(threads=threads)) as simulation:
        simulation.advance(0.02)
        simulation.advance(0.02)  # nothing to do
        simulation.advance(0.04)
        assert simulation.state_hash == by_file.checkpoints[-1].state_hash


def test_history_is_that_of_a_run(by_file):
    with sph.Simulation(**two_clouds()) as simulation:
        simulation.advance(0.02)
        assert simulation.history["t"][-1] == 0.02
        simulation.advance(0.04)
        found = simulation.history
    expected = by_file.history
    measured = {"wall_seconds", "cpu_seconds"}
    of_problem = {"kinetic_energy_x", "volume_ratio"}
    assert found.keys() == expected.keys() - of_problem
    for name in found.keys() - measured:
        assert np.array_equal(found[name], expected[name]), name
        assert found[name].dtype == expected[name].dtype


def test_particles_keep_their_order_and_pass_periodic_faces():
    x = np.linspace(0.05, 0.95, 10)[::-1]
    with sph.Simulation([x], [np.ones(10)], 0.1, box=[0.0, 1.0]) as simulation:
        simulation.advance(0.1)
        found = simulation.particles.position[0]
    # uniform flow: no force; ten steps round off
    assert np.abs((found - x - 0.1 + 0.5) % 1.0 - 0.5).max() < 1e-12


def test_defaults_are_rest_and_unit_masses():
    with sph.Simulation(
        lattice.fill(np.array([[0.0, 4.0]]), 20, "cubic"), box=[0.0, 4.0], boundary="mirror"
    ) as simulation:
        p = simulation.particles
        assert np.all(p.velocity == 0.0)
        assert np.all(p.mass == 1.0)
        assert np.all(p.internal_energy == 1.0)
        assert simulation.box.tolist() == [[0.0, 4.0]]
        assert 0.0 < simulation.next_step < 1.0


def test_input_arrays_are_copied():
    arrays = two_clouds()
    with sph.Simulation(**arrays) as simulation:
        before = {name: np.array(arrays[name]) for name in ("position", "mass")}
        simulation.advance(0.01)
        assert all(np.array_equal(arrays[name], before[name]) for name in before)
        simulation.particles.density[:] = 0.0  # a copy too
        assert simulation.particles.density.min() > 0.0


@pytest.mark.slow
def test_density_of_continuum_is_given_among_others():
    physics = {
        "formulation": "continuum", "eos": {"name": "tait", "rho_0": 1.0, "c_0": 10.0}
    }  # fmt: skip
    arrays = two_clouds(physics=physics, internal_energy=0.0, mass=1.0 / N, velocity=None)
    with pytest.raises(sph.ConfigError, match="expected its initial values, others="):
        sph.Simulation(**arrays)
    with sph.Simulation(**arrays, others={"density": 1.0}) as simulation:
        simulation.advance(0.01)
        assert np.abs(simulation.particles.density - 1.0).max() < 1e-10


WRONG = {
    "transposed": ({"position": np.zeros((N, 2))}, "expected (D, N), with D = 1, 2 or 3"),
    "flat": ({"position": np.zeros(N)}, "position of the shape (400,); expected (D, N)"),
    "no particles": ({"position": np.zeros((2, 0))}, "position of the shape (2, 0)"),
    "text": ({"mass": "heavy"}, "mass: expected an array of numbers"),
    "ragged": ({"velocity": [[1.0], [1.0, 2.0]]}, "velocity: expected an array of numbers"),
    "short": ({"mass": np.ones(3)}, "mass of the shape (3,); expected (N,) = (400,)"),
    "turned": (
        {"velocity": np.zeros((N, 2))},
        "velocity of the shape (400, 2); expected (D, N) = (2, 400). Try: the transpose",
    ),
    "NaN": ({"internal_energy": np.nan}, "internal_energy with values that are not finite"),
    "no mass": ({"mass": 0.0}, "masses that are not above 0"),
    "outside": (
        {"box": [0.0, 0.9]},
        "particle 361 at x = 0.925, outside the domain [0, 0.9], which is periodic along that axis",
    ),
    "box": ({"box": [1.0, 0.0]}, "sph.Simulation: box = [1.0, 0.0]: expected lo < hi"),
    "boundary": ({"boundary": "wall"}, 'boundary = "wall": expected "periodic"'),
    "key": ({"physics": {"alhpa": 1.0}}, "physics.alhpa is not a key of [physics]; did you mean"),
    "other": ({"others": {"densty": 1.0}}, "others has densty; the fields of this scene are id, "),
    "threads": ({"threads": 0}, "run.threads = 0: expected"),
    "domain": ({"domain": [0, 1]}, "domain is not an argument; expected box=, the ends of"),
    "gamma": ({"gamma": 1.4}, 'gamma is not an argument; expected physics={"gamma": …}'),
    "solid": ({"strength": 1.4}, 'strength is not an argument; expected physics={"strength": …}'),
    "misspelt": ({"velocities": 1.0}, "velocities is not an argument; did you mean velocity?"),
    "stepping": ({"stepping": "own"}, 'time.stepping = "own": expected "global"'),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_arrays_and_keys_are_refused(name):
    changed, words = WRONG[name]
    with pytest.raises(sph.ConfigError, match=re.escape(words)):
        sph.Simulation(**two_clouds(**changed))


def test_unphysical_state_raises_numerical_error():
    with pytest.raises(sph.NumericalError, match="internal energy"):
        sph.Simulation(**two_clouds(internal_energy=-1.0))


def test_negative_energy_of_continuum_is_a_matter_of_the_initial_state():
    clouds = two_clouds(internal_energy=-1.0, physics={"formulation": "continuum"})
    with pytest.raises(sph.NumericalError, match="Try: an initial state with another density"):
        sph.Simulation(**clouds, others={"density": 1.0})


def test_failure_while_advancing_raises_numerical_error():
    physics = {"gamma": 5.0 / 3.0, "max_energy_drift": 1e-9}
    with sph.Simulation(**two_clouds(physics=physics)) as simulation:
        with pytest.raises(sph.NumericalError, match="energy"):
            simulation.advance(1.0)
        assert 0.0 < simulation.time < 1.0


@pytest.mark.parametrize("until", [-1.0, float("nan"), float("inf")])
def test_time_that_is_not_later_is_refused(until):
    simulation = sph.Simulation(**two_clouds())
    with pytest.raises(ValueError, match="expected a time after 0"):
        simulation.advance(until)


def test_closed_simulation_keeps_its_state_and_refuses_to_advance():
    simulation = sph.Simulation(**two_clouds(threads=2))
    simulation.close()
    simulation.close()
    assert simulation.particles.density.shape == (N,)
    with pytest.raises(ValueError, match="the simulation is closed"):
        simulation.advance(1.0)


def test_forgotten_simulation_ends_its_threads():
    before = threading.active_count()
    for _ in range(3):
        simulation = sph.Simulation(**two_clouds(threads=2))
        simulation.advance(0.005)
    del simulation
    gc.collect()
    assert threading.active_count() == before
