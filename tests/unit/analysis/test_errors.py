"""Norms of made-up differences whose norms are known by construction."""

import numpy as np
import pytest
from states import gas_state

from sph import config
from sph.analysis import errors

ROUND_OFF = 1e-13  # sums of at most some hundred terms of order 1


def test_norms_constant_difference_equal_difference():
    volume = np.random.default_rng(1).random(100) + 0.1
    found = errors.norms(np.full(100, -0.25), volume)
    for name in ("L1", "L2", "Linf"):
        assert found[name] == pytest.approx(0.25, rel=ROUND_OFF)


def test_norms_are_weighted_by_volume():
    # a difference of 2 in a quarter of the volume, none elsewhere
    found = errors.norms(np.array([2.0, 0.0]), np.array([1.0, 3.0]))
    assert found["L1"] == pytest.approx(0.5, rel=ROUND_OFF)
    assert found["L2"] == pytest.approx(1.0, rel=ROUND_OFF)
    assert found["Linf"] == 2.0


def test_norms_vector_use_its_length():
    difference = np.array([[3.0, 0.0], [-4.0, 0.0]])
    found = errors.norms(difference, np.array([1.0, 1.0]))
    assert found == pytest.approx({"L1": 2.5, "L2": np.sqrt(12.5), "Linf": 5.0}, rel=ROUND_OFF)


@pytest.fixture
def tube():
    """A shock tube, and particles in its exact state at t = 0.1."""
    made = config.from_text(
        '[problem]\nname = "shock_tube"\ndimension = 2\nerror_range = [-0.2, 0.3]\n'
    )
    eos, problem = made.physics.eos_model(), made.problem
    random = np.random.default_rng(2)
    low, high = problem.box[:, :1], problem.box[:, 1:]
    position = low + (high - low) * random.random((2, 200))
    exact = problem.exact(eos, 0.1, position)
    particles = gas_state(position, exact["velocity"], np.full(200, 0.01), exact["internal_energy"])
    particles.density[:] = exact["density"]
    return made, particles, exact["pressure"].copy()


def test_errors_exact_state_are_zero(tube):
    made, particles, pressure = tube
    found = errors.against_exact(made, 0.1, particles, pressure)
    assert set(found["fields"]) == set(errors.FIELDS)
    assert all(norm["Linf"] == 0.0 for norm in found["fields"].values())


def test_errors_shifted_field_equal_shift(tube):
    made, particles, pressure = tube
    particles.velocity += np.array([[0.03], [0.04]])
    particles.internal_energy -= 0.01
    found = errors.against_exact(made, 0.1, particles, pressure + 0.02)["fields"]
    assert found["velocity"]["L1"] == pytest.approx(0.05, rel=ROUND_OFF)
    assert found["internal_energy"]["L2"] == pytest.approx(0.01, rel=ROUND_OFF)
    assert found["pressure"]["Linf"] == pytest.approx(0.02, rel=ROUND_OFF)
    assert found["density"]["Linf"] == 0.0


def test_errors_outside_error_region_ignored(tube):
    made, particles, pressure = tube
    x = particles.position[0]
    inside = (x > -0.2) & (x < 0.3)
    found = errors.against_exact(made, 0.1, particles, pressure + np.where(inside, 0.0, 9.0))
    assert found["fields"]["pressure"]["Linf"] == 0.0
    assert found["particles"] == inside.sum()
    assert found["region"] == "-0.2 < x < 0.3"


def test_errors_empty_region_are_missing(tube):
    made, particles, pressure = tube
    particles.position[0] = 0.4
    assert errors.against_exact(made, 0.1, particles, pressure) is None


def test_errors_without_exact_solution_are_missing(tube):
    _, particles, pressure = tube
    made = config.from_text('[problem]\nname = "kelvin_helmholtz"\n')
    assert errors.against_exact(made, 0.1, particles, pressure) is None


def test_relative_errors_divided_by_exact_field_norm_in_region():
    """Of three particles, the last of which is outside: volumes 1 and 3."""
    state = {
        "density": np.array([2.5, 4.5, 90.0]),
        "velocity": np.array([[3.0, 0.0, 90.0], [4.0, 1.0, 90.0]]),
        "pressure": np.array([0.5, 0.0, 1.0]),
    }
    exact = {
        "density": np.array([2.0, 5.0, 1.0]),
        "velocity": np.array([[3.0, 0.0, 0.0], [4.0, 2.0, 0.0]]),
        "pressure": np.array([0.0, 0.0, 5.0]),
    }
    volume, inside = np.array([1.0, 3.0, 7.0]), np.array([True, True, False])
    found = errors.by_field(state, exact, volume, inside)
    assert found["density"] == pytest.approx(
        {"L1": 0.5, "L2": 0.5, "Linf": 0.5, "relative_L1": 0.5 / (17.0 / 4.0)}, rel=ROUND_OFF
    )
    # differences of 0 and 1, and speeds of 5 and 2
    assert found["velocity"]["relative_L1"] == pytest.approx(0.75 / (11.0 / 4.0), rel=ROUND_OFF)
    assert found["pressure"]["L1"] == 0.125
    assert found["pressure"]["relative_L1"] is None  # of a field that is zero there
    assert set(found) == set(state)  # internal energy is not in this exact solution


def test_errors_use_particle_volumes_not_exact_volumes(tube):
    made, particles, pressure = tube
    x = particles.position[0]
    inside = (x > -0.2) & (x < 0.3)
    particles.mass = np.linspace(0.01, 0.05, x.size)
    particles.density *= np.linspace(1.0, 2.0, x.size)
    error = np.where(np.arange(x.size) % 2, 0.5, 0.0)
    found = errors.against_exact(made, 0.1, particles, pressure + error)["fields"]["pressure"]
    volume = (particles.mass / particles.density)[inside]
    assert found["L1"] == pytest.approx(np.average(error[inside], weights=volume), rel=ROUND_OFF)
