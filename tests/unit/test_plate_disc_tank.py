"""Plate, disc and tank as problems: settings, particles, and figures of states that are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph import config as configuration
from sph.errors import ConfigError
from sph.exact import plate


def made(name, *overrides):
    return configuration.from_text(f'[problem]\nname = "{name}"\n').override(overrides)


def started(config):
    """The problem, its equation of state, and its particles with pressures, at t = 0."""
    problem, eos = config.problem, config.physics.eos_model()
    state = problem.initial(eos)
    particles = SimpleNamespace(
        position=state.position, velocity=state.velocity, mass=state.mass,
        density=state.others["density"], id=np.arange(1, state.mass.size + 1),
        number=state.mass.size, get=state.others.get,
    )  # fmt: skip
    return problem, eos, particles, eos.pressure(particles.density, state.internal_energy)


# --- settings ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "overrides", "key"),
    [
        ("oscillating_plate", ("physics={formulation='gas'}",), "physics.formulation"),
        ("oscillating_plate", ("physics.eos={name='ideal_gas', gamma=1.4}",), "physics.eos"),
        ("oscillating_plate", ("problem.length=0.03",), "length"),
        ("rotating_disc", ("problem.radius=0.2",), "radius"),
        ("rotating_disc", ("problem.spin=2e4",), "problem.spin"),
        ("hydrostatic_tank", ("physics.strength={name='elastic', shear_modulus=1.0}",),
         "physics.strength"),
        ("hydrostatic_tank", ("physics.external={name='uniform', g=[1.0, -9.81]}",),
         "physics.external"),
        ("hydrostatic_tank", ("problem.depth=1.45",), "depth"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(name, overrides, key):
    with pytest.raises(ConfigError) as error:
        made(name, *overrides)
    assert key in str(error.value)


# --- plate ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "rows", "number"), [(1448, 10, 1448), (5378, 20, 5378)])
def test_plate_has_rows_and_jaws(n, rows, number):
    problem, _, particles, _ = started(made("oscillating_plate", f"problem.n={n}"))
    assert problem.rows == rows
    assert particles.number == number
    clamped = particles.get("clamped") > 0.0
    x, y = particles.position
    step = 0.02 / rows
    # the plate fills its box; the jaws are three layers above, below and behind
    np.testing.assert_allclose(
        [x[~clamped].min(), x[~clamped].max(), y[~clamped].max()],
        [-0.05 + step / 2, 0.2 - step / 2, 0.01 - step / 2],
    )
    np.testing.assert_allclose(
        [x[clamped].min(), x[clamped].max(), y[clamped].max()],
        [-0.05 - 2.5 * step, -step / 2, 0.01 + 2.5 * step],
    )
    np.testing.assert_allclose(particles.mass, 1000.0 * step**2)
    assert (particles.velocity[:, x < 0.0] == 0.0).all()


def test_jaws_are_as_thick_as_supports():
    _, _, particles, _ = started(made("oscillating_plate", "physics.spacing_ratio=2.0"))
    clamped = particles.get("clamped") > 0.0
    above = particles.position[1, clamped & (particles.position[1] > 0.01)]
    assert np.unique(above.round(9)).size == 4  # H = 4 spacings


def test_plate_starts_in_mode_and_its_tip_is_measured():
    problem, _, particles, _ = started(made("oscillating_plate"))
    tip = particles.id > particles.number - problem.rows
    assert (particles.position[0, tip] > 0.198).all()
    # half a spacing from the end, where the slope is 1.377/L
    expected = problem.tip_velocity * (1.0 - 1.3765 * 0.001 / 0.2)
    np.testing.assert_allclose(particles.velocity[1, tip], expected, rtol=1e-4)
    assert problem.diagnostics(particles)["tip_displacement"] == pytest.approx(0.0, abs=1e-15)
    particles.position[1, tip] += 0.003
    assert problem.diagnostics(particles)["tip_displacement"] == pytest.approx(0.003)


def test_period_and_damping_of_a_damped_sine():
    problem, eos, *_ = started(made("oscillating_plate"))
    exact = problem.period
    assert exact == pytest.approx(0.2628, abs=1e-4)
    t = np.linspace(0.0, 0.5, 4000)
    period = 1.02 * exact
    y = 0.004 * np.exp(-0.3 * t) * np.sin(2.0 * np.pi * t / period)
    found = problem.over_time(eos, {"t": t, "tip_displacement": y})
    assert found["period"] == pytest.approx(period, rel=1e-5)
    assert found["period_error"] == pytest.approx(0.02, rel=1e-3)
    assert found["damping"] == pytest.approx(1.0 - np.exp(-0.3 * period), rel=1e-3)
    assert problem.over_time(eos, {"t": t[:2000], "tip_displacement": y[:2000]}) == {}


def test_theory_of_plate_begins_with_its_velocity():
    problem, eos, *_ = started(made("oscillating_plate"))
    y = problem.theory(eos, np.array([0.0, 1e-6, problem.period / 4.0]))["tip_displacement"]
    assert y[1] / 1e-6 == pytest.approx(problem.tip_velocity, rel=1e-6)
    assert y[2] == pytest.approx(problem.tip_velocity * problem.period / (2.0 * np.pi))


def test_plate_takes_its_material():
    config = made("oscillating_plate", "physics.strength={name='elastic', shear_modulus=8e5}")
    material = config.problem._material
    assert material == plate.Material(1000.0, material.bulk, 8e5)
    assert config.problem.period < 0.26


# --- disc -------------------------------------------------------------------------------------


def turned(particles, angle):
    """Turn position, velocity and stress of particles around the origin."""
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    particles.position, particles.velocity = R @ particles.position, R @ particles.velocity
    stress = np.einsum("ac,bd,cdn->abn", R, R, particles.get("deviatoric_stress"))
    particles.get = {"deviatoric_stress": stress}.get
    return particles


def test_disc_starts_stretched_and_rotating():
    problem, eos, particles, pressure = started(made("rotating_disc", "problem.n=400"))
    found = problem.diagnostics(particles)
    mass = np.pi * 0.1**2 * 7850.0
    stretch = problem.disc.stretch(np.array([0.1 / np.sqrt(2.0)]))[0]  # near the rms radius
    assert found["rms_radius"] == pytest.approx(1.0 + stretch, rel=2e-3)  # by the lattice
    spun = 0.5 * mass * 0.1**2 * problem.spin
    assert found["angular_momentum"] == pytest.approx(spun, rel=5e-3)
    # the exact pressure is of first order in the stretch, 4e-4
    exact = problem.exact(eos, 0.0, particles.position)["pressure"]
    np.testing.assert_allclose(pressure, exact, rtol=1e-9, atol=1e-6 * problem.disc.central_stress)


def test_turned_disc_has_no_errors_and_lag_is_measured():
    problem, eos, particles, pressure = started(made("rotating_disc", "problem.n=400"))
    time = 5.3 / problem.spin
    found = problem.compare(eos, time, turned(particles, 5.3), pressure)
    assert abs(found["angle_error"]) < 1e-12
    assert found["shape_error"] < 1e-12
    assert found["stress_error"] < 1e-3  # the stretch, which is of second order
    late = problem.compare(eos, time, turned(particles, -0.2), pressure)
    assert late["angle_error"] == pytest.approx(-0.2 / (2.0 * np.pi))
    assert late["stress_error"] < 1e-3
    particles.position *= 1.01
    assert problem.compare(eos, time, particles, pressure)["shape_error"] > 5e-3
    assert problem.compare(eos, time, particles, 0.0 * pressure)["stress_error"] > 0.1


def test_drift_per_turn_and_radius():
    problem, eos, *_ = started(made("rotating_disc"))
    t = np.linspace(0.0, 4.0 * np.pi / problem.spin, 5)
    history = {
        "t": t,
        "angular_momentum": np.array([2.0, 2.0, 2.0, 2.0, 1.9]),
        "rms_radius": np.array([1.0, 0.97, 1.0, 1.02, 1.01]),
    }
    found = problem.over_time(eos, history)
    assert found["turns"] == pytest.approx(2.0)
    assert found["angular_momentum_drift"] == pytest.approx(0.025)
    assert found["radius_change"] == pytest.approx(0.01)
    assert found["largest_radius_change"] == pytest.approx(0.03)


# --- tank -------------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [1.0, 7.0])
def test_water_starts_in_balance(gamma):
    eos = f"physics.eos={{name='tait', rho_0=1000.0, c_0=31.32, gamma={gamma}}}"
    config = made("hydrostatic_tank", eos)
    problem, eos, particles, pressure = started(config)
    assert problem.compare(eos, 0.0, particles, pressure)["pressure_error"] < 1e-14
    y, h = np.linspace(0.1, 0.9, 9), 1e-5
    at = lambda y: problem.exact(eos, 0.0, np.array([0.0 * y, y]))  # noqa: E731
    slope = (at(y + h)["pressure"] - at(y - h)["pressure"]) / (2.0 * h)
    np.testing.assert_allclose(slope, -9.81 * at(y)["density"], rtol=1e-7)
    assert at(np.array([1.0, 1.2]))["pressure"].tolist() == [0.0, 0.0]


def test_errors_of_water_are_in_units_of_depth():
    problem, eos, particles, pressure = started(made("hydrostatic_tank"))
    bottom = problem.exact(eos, 0.0, np.zeros((2, 1)))["pressure"][0]
    found = problem.compare(eos, 0.0, particles, pressure + 0.01 * bottom)
    assert found["pressure_error"] == pytest.approx(0.01)
    particles.velocity[0] = 0.1
    rms = problem.diagnostics(particles)["rms_velocity"]
    assert rms == pytest.approx(0.1 / np.sqrt(9.81))
    history = {
        "t": np.linspace(0.0, 1.0, 11),
        "rms_velocity": np.array([0.5] * 9 + [0.3, 0.3]),
        "centre_of_mass": np.array([0.5] * 9 + [0.49, 0.47]),
    }
    found = problem.over_time(eos, history)
    assert found["velocity_noise"] == pytest.approx(0.3)
    assert found["settling"] == pytest.approx(0.02)
