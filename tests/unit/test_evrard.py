"""Evrard's collapse: initial state, reference, units and figures, without running any."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError

from sph import config, eos
from sph.analysis import truth
from sph.exact import evrard
from sph.problems.evrard import Problem

MONATOMIC = eos.make("ideal_gas", gamma=5.0 / 3.0)
KEYS = '[problem]\nname = "evrard"\nn = 500\n'
# The same sphere in units in which G = 4, M = 3 and R = 2: speeds sqrt(6), times 2/sqrt(6)
OTHER = (
    "physics.gravity.G=4.0", "problem.mass=3.0", "problem.radius=2.0", "problem.energy=0.3",
    "problem.domain=[-1.0, 3.0]",
)  # fmt: skip
SPEED, TIME = np.sqrt(6.0), 2.0 / np.sqrt(6.0)


def problem(*overrides):
    return config.from_text(KEYS).override(overrides).problem


def ideal(shells, n):
    """Particles that follow the reference: n directions on equal shares of the mass."""
    share = (np.arange(n) + 0.5) / n
    radius = evrard.radius_of_mass(shells, share)
    direction = np.random.default_rng(1).normal(size=(3, n))
    direction /= np.linalg.norm(direction, axis=0)
    density, speed, _ = shells.at(radius)
    return SimpleNamespace(position=radius * direction, velocity=speed * direction, density=density)


# --- initial state ----------------------------------------------------------------------------


@pytest.mark.parametrize(("lattice", "n"), [("cubic", 4000), ("bcc", 4000), ("relaxed", 1000)])
def test_particles_have_density_inverse_to_radius(lattice, n):
    state = Problem(n=n, lattice=lattice, mass=2.0, domain=[0.0, 2.0]).initial(MONATOMIC)
    radius = np.linalg.norm(state.position - 1.0, axis=0)
    assert state.mass.sum() == pytest.approx(2.0, rel=1e-12)
    assert np.ptp(state.mass) == 0.0
    # no particle at the centre, where the density is infinite, and the outermost at the surface
    assert radius.min() > 0.3 * n**-0.5
    assert 0.99 < radius.max() < 1.001
    for reach in (0.3, 0.5, 0.8):
        # the ball of a lattice is ragged by part of a layer, of 12 to 20 along the diameter
        assert np.mean(radius < reach) == pytest.approx(reach**2, rel=0.08)
    assert np.all(state.internal_energy == 0.05)
    assert np.all(state.velocity == 0.0)


def test_sphere_outside_domain_is_refused():
    with pytest.raises(ValidationError, match="expected at most 1, half the shortest side"):
        Problem(radius=1.5)


# --- reference --------------------------------------------------------------------------------


def test_reference_scales_with_units():
    plain, scaled = problem(), problem(*OTHER)
    x = np.array([[0.1, 0.4, -0.3], [0.2, 0.1, 0.0], [0.0, -0.4, 0.0]])
    expected = plain.exact(MONATOMIC, 0.9, x)
    found = scaled.exact(MONATOMIC, 0.9 * TIME, 1.0 + 2.0 * x)
    unit = {"density": 3.0 / 8.0, "velocity": SPEED, "pressure": 6.0 * 3.0 / 8.0}
    for name, values in (unit | {"internal_energy": 6.0}).items():
        # round-off of the time, times the slopes at the shock
        np.testing.assert_allclose(found[name], values * expected[name], rtol=1e-6)
    times = np.array([0.0, 0.5, 1.1])
    for name, energy in scaled.theory(MONATOMIC, TIME * times).items():
        expected = 18.0 * plain.theory(MONATOMIC, times)[name]
        np.testing.assert_allclose(energy, expected, rtol=1e-6, atol=1e-12)


def test_reference_is_sphere_at_start_and_ends_at_surface():
    x = np.array([[0.3, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 1.2]]).T
    found = problem().exact(MONATOMIC, 0.0, x)
    expected = 1.0 / (2.0 * np.pi * np.array([0.3, 0.7]))
    # linear between shells of 3e-3 and 7e-4 of the radius
    np.testing.assert_allclose(found["density"][:2], expected, rtol=1e-4)
    np.testing.assert_allclose(found["internal_energy"][:2], 0.05, rtol=1e-12)
    assert found["density"][2] == found["pressure"][2] == found["internal_energy"][2] == 0.0
    falling = problem().exact(MONATOMIC, 0.3, x[:, :2])
    assert falling["velocity"][0, 0] < -0.2 > falling["velocity"][1, 1]
    assert falling["velocity"][1, 0] == 0.0


def test_errors_leave_out_centre_and_surface():
    there = problem("problem.domain=[0.0, 2.0]")
    x = 1.0 + np.outer([1.0, 0.0, 0.0], [0.2, 0.25, 0.94, 0.96])
    inside, words = there.error_region(MONATOMIC, 0.0, x)
    # 5 % and 90 % of the mass, r^2
    assert inside.tolist() == [False, True, True, False]
    assert words == "0.2236 < r < 0.9487 around the centre"


def test_other_physics_than_gravity_departs():
    heated = 'physics.heating={ name = "relaxation", energy = 1.0, time = 0.1 }'
    assert truth.departure(config.from_text(KEYS), 1.0) is None
    assert "physics.heating" in truth.departure(config.from_text(KEYS).override([heated]), 1.0)


def test_reference_is_left_out_for_gas_that_collapses_too_far():
    soft = config.from_text(KEYS).override(["physics.gamma=1.4"])
    assert "gamma of at least 1.6" in truth.departure(soft, 1.0)
    gas = soft.physics.eos_model()
    x = np.zeros((3, 2))
    for there, time in ((gas, 1.0), (MONATOMIC, 10.1)):
        assert soft.problem.error_region(there, time, x)[1] == "the whole domain"


def test_theory_ends_with_reference(monkeypatch):
    monkeypatch.setattr(evrard, "LAST_TIME", 0.5)
    theory = problem().theory(MONATOMIC, np.array([0.0, 0.4, 0.6]))
    for energies in theory.values():
        assert np.isfinite(energies).tolist() == [True, True, False]


# --- figures ----------------------------------------------------------------------------------


@pytest.mark.parametrize("time", [0.77, 0.8, 1.17])
def test_shock_radius_of_particles_on_reference_is_that_of_reference(time):
    shells, _ = evrard.solve(MONATOMIC.gamma, 0.05, time)
    found = problem().compare(MONATOMIC, time, ideal(shells, 10000), None)
    published = {0.77: 0.1256, 0.8: 0.136, 1.17: 0.4255}[time]
    # a shell has 0.3 % of the radius there
    assert found["shock_radius_reference"] == pytest.approx(published, rel=4e-3)
    # slopes over 10 % of the radius to either side; 0.012, 0.004 and 0.003 were measured
    assert found["shock_radius_error"] < 0.02
    assert found["half_mass_radius_error"] < 1e-3


def test_shock_radius_of_few_particles_is_missing():
    shells, _ = evrard.solve(MONATOMIC.gamma, 0.05, 0.77)
    assert np.isnan(problem().compare(MONATOMIC, 0.77, ideal(shells, 10), None)["shock_radius"])


@pytest.mark.parametrize("time", [0.0, 0.39, 1.56, 3.0])
def test_shock_radius_is_left_out_without_strong_shock(time):
    shells, _ = evrard.solve(MONATOMIC.gamma, 0.05, time)
    found = problem().compare(MONATOMIC, time, ideal(shells, 100), None)
    assert set(found) == {f"half_mass_radius{end}" for end in ("", "_reference", "_error")}


def test_extremes_of_energies_agree_with_published_values():
    times = np.linspace(0.0, 1.3, 131)
    history = problem().theory(MONATOMIC, times) | {"t": times}
    found = problem().over_time(MONATOMIC, history)
    published = {
        "potential_minimum": -2.550, "potential_minimum_time": 1.046,
        "internal_maximum": 1.763, "internal_maximum_time": 1.065,
        "kinetic_maximum": 0.452, "kinetic_maximum_time": 0.876,
    }  # fmt: skip
    for name, value in published.items():
        # 0.1 % of 1600 shells, and the last digit
        assert found[f"{name}_reference"] == pytest.approx(value, rel=1.5e-3)
        # between rows 0.01 apart the parabola is exact to the fourth power of that
        assert found[f"{name}_error"] < 1e-4
    assert len(found) == 3 * len(published)
    stretched = problem().over_time(MONATOMIC, history | {"t": 1.02 * times})
    assert stretched["potential_minimum_time_error"] == pytest.approx(0.02, abs=1e-4)


def test_extremes_are_left_out_before_bounce():
    times = np.linspace(0.0, 1.0, 101)
    theory = problem().theory(MONATOMIC, times)
    history = theory | {"t": times}
    assert problem().over_time(MONATOMIC, history) == {}
