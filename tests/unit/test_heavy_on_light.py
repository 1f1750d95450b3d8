"""The Rayleigh-Taylor problem: its equilibrium, its mode and its figures."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph import config
from sph.eos.ideal_gas import IdealGas
from sph.errors import ConfigError
from sph.problems import rayleigh_taylor as rt

GAS = IdealGas(1.4)


@pytest.mark.parametrize("width", [0.0, 0.025])
def test_pressure_balances_weight_of_gas(width):
    y = np.linspace(-0.5, 0.5, 2001)
    density, pressure = rt._hydrostatic(y, width)
    middle, _ = rt._hydrostatic(0.5 * (y[1:] + y[:-1]), width)
    # central differences: dy^2/24 of the curvature of the density, 1/w^2
    np.testing.assert_allclose(np.diff(pressure) / np.diff(y), -rt.GRAVITY * middle, rtol=1e-4)
    assert density[[0, -1]] == pytest.approx([1.0, 2.0], rel=1e-8)
    assert np.interp(0.0, y, pressure) == pytest.approx(10.0 / 7.0, rel=1e-3)


@pytest.mark.parametrize("lattice", ["cubic", "hexagonal"])
def test_initial_masses_and_energies_follow_hydrostatic_gas(lattice):
    problem = rt.Problem(n=800, lattice=lattice)
    state = problem.initial(GAS)
    density, pressure = rt._hydrostatic(state.position[1], problem.width)
    np.testing.assert_allclose(state.mass, 0.5 * density / state.mass.size, rtol=1e-12)
    np.testing.assert_allclose(0.4 * density * state.internal_energy, pressure, rtol=1e-12)
    assert state.mass.sum() == pytest.approx(0.75, rel=1e-3)  # the mean of 1 and 2, by symmetry


def particles_of(problem):
    state = problem.initial(GAS)
    volume = 0.5 / state.mass.size
    return SimpleNamespace(**state._asdict(), density=state.mass / volume)


def test_initial_velocity_is_mode_of_theory():
    problem = rt.Problem(n=5000)
    particles = particles_of(problem)
    theory = problem.theory(GAS, np.array([0.0, 1.0]))["mode_amplitude"]
    # sums over 50 rows in place of the integral over y, whose weight has a kink at y = 0
    assert problem.diagnostics(particles)["mode_amplitude"] == pytest.approx(theory[0], rel=0.01)
    assert theory[1] / theory[0] == pytest.approx(np.cosh(rt._fastest_mode(0.025, GAS)[1].rate))
    x, y = particles.position
    down = particles.velocity[1]
    near = np.abs(y) < 0.05
    assert down[near & (np.abs(x) < 0.05)].max() < 0.0 < down[near & (np.abs(x) > 0.2)].min()
    assert np.abs(down).max() == pytest.approx(problem.perturbation, rel=0.01)


def test_mode_amplitude_weighs_volume_and_distance():
    random = np.random.default_rng(3)
    position = np.array([random.uniform(-0.25, 0.25, 9), random.uniform(-0.5, 0.5, 9)])
    mass, density = random.uniform(1.0, 2.0, (2, 9))
    velocity = random.normal(size=(2, 9))
    particles = SimpleNamespace(position=position, velocity=velocity, mass=mass, density=density)
    weight = mass / density * np.exp(-4.0 * np.pi * np.abs(position[1]))
    projected = (weight * velocity[1] * np.cos(4.0 * np.pi * position[0])).sum()
    found = rt.Problem().diagnostics(particles)
    assert found == pytest.approx({"mode_amplitude": -2.0 * projected / weight.sum()}, rel=1e-12)


def test_growth_fitted_while_linear_and_compared_with_theory():
    problem, t = rt.Problem(), np.linspace(0.0, 3.0, 31)
    exact = problem.theory(GAS, t)["mode_amplitude"]
    # outside 1 to 2 the amplitude does something else
    history = {"t": t, "mode_amplitude": np.where((t < 0.95) | (t > 2.05), 1.0, exact)}
    found = problem.over_time(GAS, history)
    assert found["growth_ratio"] == pytest.approx(1.0, rel=1e-9)
    assert found["mode_growth_rate"] == pytest.approx(1.197, rel=1e-3)
    assert found["linear_growth_rate"] < found["mode_growth_rate"]  # it grows as a cosh
    history["mode_amplitude"] = exact * np.exp(-0.5 * t)
    slower = problem.over_time(GAS, history)
    assert slower["growth_rate"] == pytest.approx(found["growth_rate"] - 0.5, rel=1e-6)


@pytest.mark.parametrize(
    ("times", "sign", "perturbation"),
    [
        ([0.5, 1.0, 1.5], 1.0, 0.01),
        ([1.1, 1.5, 2.0], 1.0, 0.01),
        ([0.0, 1.0, 2.0], -1.0, 0.01),
        ([0.0, 1.0, 2.0], 1.0, 0.0),
    ],
)
def test_growth_of_short_or_lost_mode_is_missing(times, sign, perturbation):
    t = np.array(times)
    problem = rt.Problem(perturbation=perturbation)
    assert problem.over_time(GAS, {"t": t, "mode_amplitude": sign * np.exp(t)}) == {}


def test_other_domain_is_refused(messages):
    text = '[problem]\nname = "rayleigh_taylor"\ndomain = [[0.0, 0.5], [0.0, 1.0]]\n'
    with messages.raised(ConfigError, "line 3: problem.domain"):
        config.from_text(text, "a")


@pytest.mark.parametrize(
    "field", ['{ name = "uniform", g = [0.0, -1.0] }', '{ name = "uniform", g = [0.0, 0.0] }']
)
def test_other_field_has_no_theory(field):
    text = f'[problem]\nname = "rayleigh_taylor"\n[physics]\nexternal = {field}\n'
    other = config.from_text(text)
    assert "another field" in other.problem.departs(other.physics)
    own = config.from_text('[problem]\nname = "rayleigh_taylor"\n')
    assert own.problem.departs(own.physics) is None
