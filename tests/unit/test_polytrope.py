"""The polytrope as a problem: settings, particles, figures; and the fit of an oscillation."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph import config as configuration
from sph import eos, kernels
from sph.analysis import truth
from sph.errors import ConfigError
from sph.exact.lane_emden import Polytrope
from sph.problems.polytrope import Problem
from sph.problems.support import densities, lattice, oscillation

MONATOMIC = eos.make("ideal_gas", gamma=5.0 / 3.0)
WENDLAND = kernels.make("wendland_c2")


def made(*overrides):
    return configuration.from_text('[problem]\nname = "polytrope"\nn = 1000\n').override(overrides)


def particles_of(state, **fields):
    known = state._asdict() | {"density": np.ones(state.mass.size)}
    return SimpleNamespace(**known | fields)


def distance(position):
    return np.sqrt((position**2).sum(axis=0))


# --- settings ---------------------------------------------------------------------------------


def test_constant_of_gravity_and_gas_come_from_physics():
    problem = made(
        "physics.gravity.G=0.7", "problem.mass=2.0", "problem.radius=3.0", "problem.index=1.0",
        "problem.domain=[-4.0, 4.0]", "physics.gamma=2.0",
    ).problem  # fmt: skip
    assert problem.star == Polytrope(1.0, 2.0, 3.0, 0.7)
    assert problem.mode.period == Polytrope(1.0, 2.0, 3.0, 0.7).fundamental_mode(2.0).period


def test_polytrope_without_gravity_is_refused():
    physics = SimpleNamespace(gravity=None)
    with pytest.raises(ValueError, match=r"physics\.gravity is missing"):
        Problem().under(physics)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("physics.gamma=1.3", ("physics.gamma", "above 4/3")),
        ("problem.radius=2.5", ("radius = 2.5", "at most 2", "wider domain")),
        ("problem.n=20", ("problem.n", "100")),
        ("problem.index=4.0", ("problem.index", "3")),
        ("problem.boundary=periodic", ("problem.boundary", "open")),
    ],
)
def test_unsuitable_settings_are_refused(override, words):
    with pytest.raises(ConfigError) as caught:
        made(override)
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize(
    ("index", "gamma", "ends"),
    [(1.5, 5 / 3, False), (3.0, 5 / 3, False), (1.0, 5 / 3, True), (1.0, 2.0, False)],
)
def test_convection_ends_exact_solution(index, gamma, ends):
    config = made(f"problem.index={index}", f"physics.gamma={gamma}")
    reason = truth.departure(config, 20.0)
    assert (reason is not None and "convection" in reason) == ends
    assert truth.departure(config, 3.0) is None


# --- particles --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["cubic", "bcc", "relaxed"])
def test_ball_of_lattice_has_volume_of_its_sites(kind):
    for n in (300, 1000):
        radius = distance(lattice.ball(n, kind, 3))
        assert abs(radius.size / n - 1.0) < 0.08  # shells of a cubic lattice have up to 100 sites
        assert radius.max() < 1.0
        for reach in (0.6, 0.8):  # layers are ragged: 1/N^(1/3) of them, less with N
            assert np.mean(radius < reach) == pytest.approx(reach**3, rel=n ** (-1 / 3))
        # to second order: the moment of a ball is 3/5
        assert np.mean(radius**2) == pytest.approx(0.6, rel=0.15 * n ** (-1 / 3))


def test_summed_density_solves_for_support():
    random = np.random.default_rng(3)
    position, mass = random.normal(size=(3, 400)), 0.01
    found = densities.summed(position, mass, WENDLAND, 1.4)
    support = 1.4 * kernels.support_ratio(WENDLAND, 3) * (mass / found) ** (1 / 3)
    apart = np.sqrt(((position[:, :, None] - position[:, None]) ** 2).sum(axis=0))
    q = apart / support[:, None]
    constant = kernels.normalisation(WENDLAND, (0,) * 3)
    expected = mass * constant * WENDLAND.w((0,) * 3, q).sum(axis=1) / support**3
    np.testing.assert_allclose(found, expected, rtol=2e-3)  # after 20 passes


@pytest.mark.parametrize("index", [1.0, 1.5])
def test_particles_sample_polytrope(index):
    config = made(
        f"problem.index={index}", "problem.n=2000", "problem.mass=2.0", "problem.radius=3.0",
        "problem.domain=[-3.0, 5.0]", "physics.gravity.G=0.7",
    )  # fmt: skip
    state = config.problem.initial(MONATOMIC)
    star = Polytrope(index, 2.0, 3.0, 0.7)
    offset = state.position - 1.0
    radius = distance(offset)
    assert state.mass.sum() == pytest.approx(2.0, rel=1e-12)
    for share in (0.25, 0.5, 0.75):
        enclosed = np.quantile(radius, share)
        # a part of a layer of particles, of which a radius has eight
        assert star.enclosed_mass(enclosed) == pytest.approx(2.0 * share, rel=0.03)
    # the virial theorem, 3 int P dV = -W; kernels blur: 1.4 % of it with 2000 particles
    thermal = 2.0 * (state.mass * state.internal_energy).sum()
    assert thermal == pytest.approx(-star.potential_energy, rel=0.03)
    assert not state.velocity.any()
    # one entropy constant P/rho^(1 + 1/n), for the densities of the run
    density = densities.summed(offset, 2.0 / radius.size, WENDLAND, 1.6)
    constant = 2.0 / 3.0 * state.internal_energy / density ** (1.0 / index)
    np.testing.assert_allclose(constant, star.pressure_of(1.0), rtol=1e-12)


def test_kick_has_shape_of_mode():
    config = made("problem.kick=0.05", "physics.gravity.G=0.7")
    problem = config.problem
    state = problem.initial(MONATOMIC)
    radius = distance(state.position)
    speed = (state.velocity * state.position).sum(axis=0) / radius
    expected = 0.05 * np.sqrt(2.0 * 0.7) * radius * problem.mode.shape(radius)
    np.testing.assert_allclose(speed, expected, rtol=1e-12)
    np.testing.assert_allclose(distance(state.velocity), expected, rtol=1e-12)  # radial
    found = problem.diagnostics(particles_of(state))
    assert found["mode_velocity"] == pytest.approx(0.05, rel=1e-3)  # from the centre of mass
    # another motion is orthogonal, up to the granularity of 1000 particles
    turning = np.cross(state.position.T, [0.0, 0.0, 0.1]).T
    turned = problem.diagnostics(particles_of(state, velocity=turning))
    assert abs(turned["mode_velocity"]) < 1e-3
    assert problem.exact(MONATOMIC, 0.0, state.position) is None
    assert set(problem.allowed()) == {"energy_drift", "mode_period_error"}


# --- figures ----------------------------------------------------------------------------------


def test_figures_of_exact_particles_have_no_error():
    config = made("physics.gravity.G=0.7")
    problem = config.problem
    state = problem.initial(MONATOMIC)
    exact = problem.exact(MONATOMIC, 5.0, state.position)
    radius = distance(state.position)
    star = Polytrope(1.5, G=0.7)
    np.testing.assert_allclose(exact["density"], star.density(radius), rtol=1e-12)
    np.testing.assert_allclose(
        exact["internal_energy"], 1.5 * star.pressure(radius) / star.density(radius), rtol=1e-12
    )
    shift = np.array([[0.1], [0.2], [0.3]])
    p = particles_of(state, density=exact["density"], position=state.position + shift)
    found = truth.figures(config, 5.0, p, exact["pressure"])
    # from the centre of mass, which 1000 particles of a glass have within 0.005 of the centre
    middle = state.position.mean(axis=1)[:, None]
    assert found["central_density_error"] < 1e-3
    assert found["half_mass_radius_error"] < 0.02
    assert found["outer_radius"] == pytest.approx(distance(state.position - middle).max())
    assert found["virial_ratio"] == pytest.approx(1.0, abs=0.02)
    p.density = 1.1 * p.density
    thinner = truth.figures(config, 5.0, p, exact["pressure"])
    assert thinner["central_density_error"] == pytest.approx(0.1, abs=2e-3)
    assert thinner["virial_ratio"] == pytest.approx(found["virial_ratio"] / 1.1, rel=1e-12)
    outside = problem.exact(MONATOMIC, 0.0, np.array([[1.5], [0.0], [0.0]]))
    assert outside["density"] == outside["pressure"] == outside["internal_energy"] == 0.0


def test_period_of_mode_is_fitted():
    config = made("problem.kick=0.05")
    problem, mode = config.problem, config.problem.mode
    time = np.cumsum(np.random.default_rng(2).uniform(0.01, 0.05, 400))
    wave = np.exp(-0.05 * time) * np.cos(1.02 * mode.frequency * time)
    found = problem.over_time(MONATOMIC, {"t": time, "mode_velocity": 0.05 * wave + 0.001})
    assert found["mode_period"] == pytest.approx(mode.period / 1.02, rel=1e-6)
    assert found["mode_period_error"] == pytest.approx(1.0 - 1.0 / 1.02, rel=1e-4)
    assert found["mode_damping"] == pytest.approx(0.05 / mode.frequency, rel=1e-4)
    assert found["mode_period_exact"] == mode.period
    theory = problem.theory(MONATOMIC, time)["mode_velocity"]
    np.testing.assert_allclose(theory, 0.05 * np.cos(mode.frequency * time), rtol=1e-12)
    assert made().problem.over_time(MONATOMIC, {}) == made().problem.theory(MONATOMIC, time) == {}


@pytest.mark.parametrize("end", [0.0, 1.4])
def test_oscillation_too_short_is_not_fitted(end):
    time = np.linspace(0.0, end * np.pi, 100)  # periods of pi
    assert oscillation.fit(time, np.cos(2.0 * time), 2.0) is None
    longer = np.linspace(0.0, 1.6 * np.pi, 100)
    assert oscillation.fit(longer, np.cos(2.0 * longer), 2.1).period == pytest.approx(np.pi)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_fit_does_not_depend_on_units(size):
    time = np.linspace(0.0, 2.0 * np.pi, 400)
    value = size * np.exp(-0.05 * time) * np.sin(2.0 * time)
    found = oscillation.fit(time, value, 2.1)
    assert found.frequency == pytest.approx(2.0, rel=1e-6)
    assert found.damping == pytest.approx(0.05, rel=1e-4)
