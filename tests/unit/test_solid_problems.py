"""Waves in solids: initial states, exact solutions and figures, without running any."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph import config
from sph.analysis import truth
from sph.analysis.figures import profiles
from sph.analysis.figures.sources import State
from sph.errors import ConfigError
from sph.problems.support import uniaxial

IMPACTS = ["flyer_plate", "elastic_plastic_shock"]
STEEL = uniaxial.STEEL
C_L = 5152.486  # ((rho_0 c_0^2 + 4 G/3)/rho_0)^(1/2) by hand


def made(problem, *overrides):
    return config.from_text(f'[problem]\nname = "{problem}"\n').override(overrides)


def exactly(what, time, position):
    """The particles of a configuration with the exact solution at `time`, and their pressure."""
    eos = what.physics.eos_model()
    start = what.problem.initial(eos)
    exact = what.problem.exact(eos, time, position)
    dimension = position.shape[0]
    deviatoric = np.zeros((dimension, dimension, position.shape[1]))
    deviatoric[0, 0] = exact["pressure"] - exact["stress"]
    particles = SimpleNamespace(
        position=position, mass=start.mass, velocity=exact["velocity"], density=exact["density"],
        internal_energy=exact["internal_energy"], deviatoric_stress=deviatoric,
    )  # fmt: skip
    return particles, exact["pressure"]


def followed(what, times):
    """The history of the exact solution, on the particles of the initial state."""
    position = what.problem.initial(what.physics.eos_model()).position
    rows = [what.problem.diagnostics(exactly(what, time, position)[0]) for time in times]
    return {"t": times} | {name: np.array([row[name] for row in rows]) for name in rows[0]}


# --- impacts ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", IMPACTS)
@pytest.mark.parametrize(("dimension", "lattice"), [(1, "cubic"), (2, "hexagonal"), (3, "bcc")])
def test_plates_are_symmetric_and_move_towards_each_other(name, dimension, lattice):
    what = made(
        name, f"problem.dimension={dimension}", "problem.n=1000", f"problem.lattice={lattice}"
    )
    start = what.problem.initial(what.physics.eos_model())
    x, speed = start.position[0], what.problem.speed
    np.testing.assert_array_equal(start.velocity[0], -speed * np.sign(x))
    assert np.abs(start.velocity[1:]).max(initial=0.0) == 0.0
    np.testing.assert_allclose(np.sort(x), np.sort(-x), atol=1e-15)
    assert x.min() > -0.05
    widths = what.problem.box[:, 1] - what.problem.box[:, 0]
    assert start.mass.sum() == pytest.approx(7850.0 * np.prod(widths), rel=1e-12)
    assert start.others["density"] == pytest.approx(np.full(x.size, 7850.0))


@pytest.mark.parametrize("name", IMPACTS)
def test_impact_starts_as_exact_solution(name):
    what = made(name)
    eos = what.physics.eos_model()
    start = what.problem.initial(eos)
    exact = what.problem.exact(eos, 0.0, start.position)
    np.testing.assert_array_equal(exact["velocity"], start.velocity)
    np.testing.assert_array_equal(exact["internal_energy"], start.internal_energy)
    assert np.abs(exact["stress"]).max() == 0.0


@pytest.mark.parametrize("name", IMPACTS)
def test_pressure_behind_shock_obeys_equation_of_state(name):
    what = made(name)
    eos = what.physics.eos_model()
    position = np.linspace(-0.049, 0.049, 301)[None]
    exact = what.problem.exact(eos, 7e-6, position)
    # two transcriptions of eq 423: round-off of 1 - rho_0/rho, which is 0.03 here
    np.testing.assert_allclose(
        exact["pressure"], eos.pressure(exact["density"], exact["internal_energy"]), rtol=1e-11,
        atol=1.0,
    )  # fmt: skip
    assert exact["stress"].max() == pytest.approx(
        {"flyer_plate": 1.76625e10, "elastic_plastic_shock": 3.1961e9}[name], rel=2e-5
    )


def test_impact_conserves_mass_and_energy():
    what = made("elastic_plastic_shock")
    cells = 400_000
    time, x = 8e-6, (np.arange(cells) + 0.5) / cells * 0.1 - 0.05
    exact = what.problem.exact(what.physics.eos_model(), time, x[None])
    rear = 0.05 - what.problem.speed * time
    volume = np.where(np.abs(x) < rear, 0.1 / cells, 0.0)
    # the fronts lie anywhere within a cell
    assert (volume * exact["density"]).sum() == pytest.approx(785.0, rel=1e-5)
    energy = exact["internal_energy"] + 0.5 * exact["velocity"][0] ** 2
    total = (volume * exact["density"] * energy).sum()
    assert total == pytest.approx(785.0 * 0.5 * 100.0**2, rel=1e-4)


@pytest.mark.parametrize("name", IMPACTS)
def test_figures_of_exact_impact_have_no_error(name):
    what = made(name, "problem.n=2000")
    eos = what.physics.eos_model()
    time = what.time.end
    history = followed(what, np.linspace(0.0, time, 50))
    position = what.problem.initial(eos).position
    figures = truth.figures(what, time, *exactly(what, time, position), history)
    errors = {key: value for key, value in figures.items() if key.endswith("_error")}
    expected = {"stress", "pressure", "density", "internal_energy", "speed"}
    names = {f"shock_{one}_error" for one in expected}
    if name == "elastic_plastic_shock":
        names |= {"precursor_speed_error", "elastic_limit_error"}
    assert set(errors) == names
    # a front lies anywhere between two particles, 1/500 of its way from each other
    assert max(errors.values()) < 1e-3
    assert max(value for key, value in errors.items() if "speed" not in key) < 1e-12
    assert figures["shock_speed_exact"] == pytest.approx(
        {"flyer_plate": 4500.0, "elastic_plastic_shock": 3811.1}[name], rel=2e-5
    )


def test_figures_show_wrong_states_behind_shock():
    what = made("flyer_plate")
    eos = what.physics.eos_model()
    position = what.problem.initial(eos).position
    particles, pressure = exactly(what, 1e-5, position)
    particles.density = 1.02 * particles.density
    figures = truth.figures(what, 1e-5, particles, 0.95 * pressure)
    assert figures["shock_density_error"] == pytest.approx(0.02, rel=1e-6)
    assert figures["shock_pressure_error"] == pytest.approx(0.05, rel=1e-6)
    late = {"t": np.linspace(0.0, 1e-5, 50), "shock_position": np.linspace(0.0, 0.05, 50)}
    speeds = what.problem.over_time(eos, late)  # 5000 m/s where 4000 are exact, and 500 ahead
    assert speeds["shock_speed"] == pytest.approx(5500.0, rel=1e-9)
    assert speeds["shock_speed_error"] == pytest.approx(1.0 / 4.5, rel=1e-9)


def test_flyer_plate_with_strength_has_precursor():
    strong = 'physics.strength={name="elastic_plastic",shear_modulus=8e10,yield_stress=6e8}'
    speed, slower = made("flyer_plate", strong), made("flyer_plate", strong, "problem.speed=100.0")
    assert len(speed.problem.fronts) == 2
    assert slower.problem.fronts == made("elastic_plastic_shock").problem.fronts
    assert speed.problem.departs(speed.physics) is None


@pytest.mark.parametrize(
    "override",
    [
        'physics.eos={name="tait",rho_0=7850.0,c_0=3600.0}',
        'physics.strength={name="johnson_cook",shear_modulus=8e10,A=6e8,B=1e8,n=0.3,C=0.01,m=1.0,'
        "reference_rate=1.0,specific_heat=450.0,room_temperature=300.0,melting_temperature=1800.0}",
    ],
)
def test_impact_with_other_laws_has_no_exact_solution(override):
    what = made("flyer_plate", override)
    position = what.problem.initial(what.physics.eos_model()).position
    assert "physics.eos mie_gruneisen" in truth.left_out(what, 1e-6, position)
    assert what.problem.diagnostics(SimpleNamespace(position=position, velocity=position)) == {}


# --- the bar ----------------------------------------------------------------------------------


def test_wave_speed_of_bar_is_that_of_uniaxial_strain():
    what = made("elastic_bar")
    assert what.problem.wave_speed(what.physics.eos_model()) == pytest.approx(C_L, rel=1e-6)
    # a linear law of the same bulk modulus has the same speed
    tait = made("elastic_bar", 'physics.eos={name="tait",rho_0=7850.0,c_0=3600.0}')
    assert tait.problem.wave_speed(tait.physics.eos_model()) == pytest.approx(C_L, rel=1e-6)


@pytest.mark.parametrize(("boundary", "mode"), [("open", 1), ("open", 3), ("periodic", 2)])
def test_wave_in_bar_solves_linear_equations(boundary, mode):
    what = made("elastic_bar", f"problem.boundary={boundary}", f"problem.mode={mode}")
    eos = what.physics.eos_model()
    x, time = np.linspace(0.0, 1.0, 201), 3.3e-5

    def at(x, time):
        return what.problem.exact(eos, time, x[None])

    d, dt = 1e-5, 1e-9  # the waves bend by 1e-8 of themselves within them
    slope = (at(x + d, time)["stress"] - at(x - d, time)["stress"]) / (2 * d)
    change = (at(x, time + dt)["velocity"][0] - at(x, time - dt)["velocity"][0]) / (2 * dt)
    np.testing.assert_allclose(7850.0 * change, -slope, atol=1e-6 * np.abs(slope).max())
    flow = (at(x + d, time)["velocity"][0] - at(x - d, time)["velocity"][0]) / (2 * d)
    thinner = (at(x, time + dt)["density"] - at(x, time - dt)["density"]) / (2 * dt)
    # densities of 7850 with round-off 1e-12, over 2e-9
    np.testing.assert_allclose(thinner, -7850.0 * flow, atol=1e-3 * 7850.0 * np.abs(flow).max())
    if boundary == "open":
        assert np.abs(at(np.array([0.0, 1.0]), time)["stress"]).max() < 1e-8 * 2e11 * 1e-4


def test_energy_of_wave_in_bar_is_constant():
    what = made("elastic_bar", "problem.boundary=periodic")
    x = (np.arange(200) + 0.5) / 200
    for time in (0.0, 2e-5, 7e-5):
        exact = what.problem.exact(what.physics.eos_model(), time, x[None])
        energy = exact["internal_energy"] + 0.5 * exact["velocity"][0] ** 2
        assert energy.mean() == pytest.approx(0.25 * (1e-4 * C_L) ** 2, rel=1e-6)


@pytest.mark.parametrize("factor", [1.0, 1.03])
def test_wave_speed_is_measured_from_history(factor):
    what = made("elastic_bar")
    eos = what.physics.eos_model()
    times = np.linspace(0.0, 1e-3, 400)
    omega = factor * what.problem.wavenumber * C_L
    history = {"t": times, "mode_velocity": 0.5 * np.cos(omega * times)}
    figures = what.problem.over_time(eos, history)
    assert figures["wave_speed_error"] == pytest.approx(factor - 1.0, abs=1e-6)
    assert figures["mode_damping"] == pytest.approx(0.0, abs=1e-6)
    assert what.problem.over_time(eos, {name: one[:80] for name, one in history.items()}) == {}


def test_mode_of_initial_state_has_amplitude_and_theory():
    what = made("elastic_bar", "problem.boundary=open", "problem.mode=3")
    eos = what.physics.eos_model()
    start = what.problem.initial(eos)
    found = what.problem.diagnostics(start)["mode_velocity"]
    assert found == pytest.approx(1e-4 * C_L, rel=1e-6)
    assert what.problem.theory(eos, np.zeros(1))["mode_velocity"][0] == pytest.approx(found)


def test_bar_that_yields_has_no_theory():
    strength = 'physics.strength={name="elastic_plastic",shear_modulus=8e10,yield_stress=%g}'
    # the largest equivalent stress of the wave is 2 G times the strain of 1e-4
    assert truth.departure(made("elastic_bar", strength % 1.7e7), 1e-4) is None
    assert "yield stress" in truth.departure(made("elastic_bar", strength % 1.5e7), 1e-4)


def test_periodic_bar_of_odd_mode_is_refused(messages):
    with messages.raised(ConfigError, "mode = 3", "even"):
        made("elastic_bar", "problem.mode=3", "problem.boundary=periodic")


# --- all --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["elastic_bar", *IMPACTS])
@pytest.mark.parametrize(
    "physics",
    ['physics.formulation="gas"', 'physics.eos={name="ideal_gas",gamma=1.4}'],
    ids=["gas", "ideal_gas"],
)
def test_gas_in_problem_of_solids_is_refused(messages, name, physics):
    text = f'[problem]\nname = "{name}"\n[physics]\n' + physics.removeprefix("physics.")
    with messages.raised(ConfigError, "physics"):
        config.from_text(text, "a")


@pytest.mark.parametrize("name", ["elastic_bar", *IMPACTS])
def test_limit_on_speed_allows_for_lattice_at_order_0(name):
    key = "wave_speed_deviation" if name == "elastic_bar" else "shock_speed_error"
    first = made(name).problem
    assert first.allowed() == first.limits
    zeroth = made(name, "physics.correction=0").problem
    assert zeroth.allowed()[key].bound > 0.0205  # the error of the gradients in 1-D
    wide = made(name, "physics.correction=0", "physics.spacing_ratio=2.0").problem
    assert wide.allowed() == wide.limits


@pytest.mark.parametrize("name", ["elastic_bar", *IMPACTS])
def test_profiles_and_errors_of_solids_show_stress(name):
    what = made(name)
    time = 0.5 * what.time.end
    position = what.problem.initial(what.physics.eos_model()).position
    particles, pressure = exactly(what, time, position)
    particles.deviatoric_stress = particles.deviatoric_stress + 1e7
    particles.dimension, particles.number = 1, position.shape[1]
    state = State(SimpleNamespace(particles=particles, config=what, time=time, pressure=pressure))
    found = state.errors()
    assert found["stress"] == pytest.approx(1e7, rel=1e-6)
    assert found["pressure"] < 1.0
    figure = profiles.single(state)
    symbols = [r"$\rho$", "$v$", r"$-\sigma_{xx}$", "$u$"]
    assert len(figure.axes) == len(symbols)
    for axes, symbol in zip(figure.axes, symbols, strict=True):
        assert symbol in axes.get_ylabel()
    dots, line = figure.axes[2].lines[:2]
    exact = what.problem.exact(what.physics.eos_model(), time, position)["stress"]
    np.testing.assert_allclose(dots.get_ydata(), exact - 1e7, rtol=1e-9, atol=1.0)
    assert np.nanmax(line.get_ydata()) == pytest.approx(exact.max(), rel=1e-3)


def test_stress_of_fluid_is_its_pressure():
    fluid = SimpleNamespace()
    assert uniaxial.compressive_stress(fluid, np.array([2.0])) == [2.0]
