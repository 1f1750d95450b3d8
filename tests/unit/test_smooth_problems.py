"""Sound wave and vortices: initial states, exact solutions and reports, without running any."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError

from sph import eos
from sph.problems.gresho import Problem as Gresho
from sph.problems.gresho import profile
from sph.problems.sound_wave import Problem as SoundWave
from sph.problems.yee import Problem as Yee

MONATOMIC = eos.make("ideal_gas", gamma=5.0 / 3.0)
AIR = eos.make("ideal_gas", gamma=1.4)
VORTICES = [Gresho(), Yee()]


def particles_of(state, density, velocity):
    return SimpleNamespace(
        position=state.position, velocity=velocity, mass=state.mass, density=density
    )


# --- sound wave -------------------------------------------------------------------------------


def lagrangian_density(state, length=1.0):
    """Mass over the distance of the neighbours' midpoints: a density with no kernel's smoothing."""
    x = state.position[0]
    after = np.roll(x, -1) + length * (np.arange(x.size) == x.size - 1)
    before = np.roll(x, 1) - length * (np.arange(x.size) == 0)
    return 2.0 * state.mass / (after - before)


@pytest.mark.parametrize("amplitude", [1e-6, 1e-2, 0.1])
@pytest.mark.parametrize("gas", [MONATOMIC, AIR])
def test_sound_wave_positions_sample_density(amplitude, gas):
    problem = SoundWave(n=400, amplitude=amplitude)
    state = problem.initial(gas)
    exact = problem.exact(gas, 0.0, state.position)
    error = lagrangian_density(state) - exact["density"]
    # Error of the central difference, (2 pi/n)^2/6 = 4e-5 of the wave, and harmonics of it. To
    # first order only, positions would be wrong by the amplitude itself: 10 % at 0.1.
    assert np.abs(error).max() < 3e-4 * amplitude + 1e-12
    assert np.all(state.mass == state.mass[0])
    wave = exact["density"] - 1.0
    assert wave.max() == pytest.approx(amplitude, rel=2 * amplitude + 1e-4)  # to first order


def test_sound_wave_mass_matches_density():
    problem = SoundWave(amplitude=0.1)
    # <(1 + a sin/3)^3> = 1 + a^2/6 for gamma = 5/3
    assert problem.initial(MONATOMIC).mass.sum() == pytest.approx(1 + 0.01 / 6, rel=1e-13)


def test_sound_wave_initial_state_adiabatic_and_one_directional():
    state = SoundWave(amplitude=0.05).initial(MONATOMIC)
    v = state.velocity[0]
    c = np.sqrt(MONATOMIC.gamma * (MONATOMIC.gamma - 1.0) * state.internal_energy)
    # the invariant of waves that go left is uniform: round-off
    np.testing.assert_allclose(c - v / 3.0, 1.0, rtol=1e-14)
    exact = SoundWave(amplitude=0.05).exact(MONATOMIC, 0.0, state.position)
    entropy = exact["pressure"] / exact["density"] ** MONATOMIC.gamma
    np.testing.assert_allclose(entropy, 0.6, rtol=1e-14)


@pytest.mark.parametrize("amplitude", [1e-6, 0.05])
def test_sound_wave_exact_solution_solves_equations(amplitude):
    problem = SoundWave(amplitude=amplitude)
    x = np.linspace(0.0, 1.0, 50, endpoint=False)
    t, step = 0.7, 1e-4

    def at(time, shift=0.0):
        return problem.exact(MONATOMIC, time, (x + shift)[None])

    def slopes(name):
        by_x = (at(t, step)[name] - at(t, -step)[name]) / (2 * step)
        return by_x, (at(t + step)[name] - at(t - step)[name]) / (2 * step)

    here = at(t)
    rho, v, P = here["density"], here["velocity"][0], here["pressure"]
    (rho_x, rho_t), (v_x, v_t), (P_x, P_t) = map(slopes, ("density", "velocity", "pressure"))
    # central differences: (2 pi)^3 step^2/6 = 4e-7 of the slopes, a hundred times more where a
    # wave of 5 % has steepened; round-off 1e-16/step = 1e-12
    allowed = 1e-4 * amplitude + 1e-11
    assert np.abs(rho_t + v * rho_x + rho * v_x).max() < allowed
    assert np.abs(v_t + v * v_x + P_x / rho).max() < allowed
    assert np.abs(P_t + v * P_x + 5.0 / 3.0 * P * v_x).max() < allowed


def test_sound_wave_small_returns_after_period_and_steep_breaks():
    x = np.linspace(0.0, 1.0, 100)[None]
    small = SoundWave(amplitude=1e-6)
    moved = small.exact(MONATOMIC, 1.0, x)["velocity"] - small.exact(MONATOMIC, 0.0, x)["velocity"]
    # crests are faster by (gamma + 1)/2 of the amplitude: 2 pi x 1.33e-6 of it in a period
    assert np.abs(moved).max() < 1e-11
    steep = SoundWave(amplitude=0.1)
    breaks = 0.1**-1 / (2 * np.pi * (5 / 3 + 1) / 2)
    assert steep.exact(MONATOMIC, 0.999 * breaks, x) is not None
    assert steep.exact(MONATOMIC, 1.001 * breaks, x) is None
    assert (
        steep.compare(MONATOMIC, 2.0, particles_of(steep.initial(MONATOMIC), 1.0, 0.0), None) == {}
    )


def test_sound_wave_just_before_breaking_has_exact_solution():
    problem = SoundWave(amplitude=0.1)
    time = 0.999 * 10 / (2 * np.pi * 4 / 3)
    x = np.linspace(0.0, 1.0, 1001)[None]
    v = problem.exact(MONATOMIC, time, x)["velocity"][0]
    # each value was at x - (1 + 4 v/3) t at the start; the sine there multiplies round-off by 2 pi
    start = x[0] - (1.0 + 4.0 * v / 3.0) * time
    np.testing.assert_allclose(0.1 * np.sin(2 * np.pi * start), v, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("dimension", "kind"), [(2, "cubic"), (2, "hexagonal"), (3, "bcc")])
def test_sound_wave_uniform_across(dimension, kind):
    problem = SoundWave(dimension=dimension, n=4000, lattice=kind, amplitude=1e-2)
    np.testing.assert_array_equal(problem.box[1:], [[-0.0625, 0.0625]] * (dimension - 1))
    state = problem.initial(MONATOMIC)
    assert np.all(state.velocity[1:] == 0.0)
    assert state.mass.sum() == pytest.approx((1 + 1e-4 / 6) / 8 ** (dimension - 1), rel=1e-12)


def test_sound_wave_report_separates_floor_damping_and_phase():
    problem = SoundWave(n=1000)
    state = problem.initial(MONATOMIC)
    time = 0.5

    def report(raised=1.0, damped=1.0, late=0.0):
        true = problem.exact(MONATOMIC, time, state.position)["density"]
        velocity = problem.exact(MONATOMIC, time - late, state.position)["velocity"]
        particles = particles_of(state, raised * true, damped * velocity)
        return problem.compare(MONATOMIC, time, particles, None)

    # A density high everywhere is no error of the wave. Particles of t = 0 are not quite where the
    # wave of t = 0.5 would have them: second order in the amplitude 1e-6
    assert all(abs(value) < 4e-6 for value in report(raised=1.0025).values())
    damped = report(damped=0.9)
    assert damped["wave_amplitude_error"] == pytest.approx(-0.1, abs=4e-6)
    assert damped["phase_speed_error"] == pytest.approx(0.0, abs=4e-6)
    assert damped["error_velocity_relative"] == pytest.approx(0.1 * 2 / np.pi, rel=1e-4)  # <|sin|>
    late = report(late=0.01)
    # 0.01 too late in 0.5; the crests' own shift is 1e-6
    assert late["phase_speed_error"] == pytest.approx(-0.02, rel=1e-4)
    assert late["wave_amplitude_error"] == pytest.approx(0.0, abs=4e-6)
    flat = particles_of(state, 1.0 + 0 * state.mass, state.velocity)
    missing = problem.compare(MONATOMIC, 0.0, flat, None)
    assert missing["error_density_relative"] == pytest.approx(2 / np.pi, rel=1e-4)


@pytest.mark.parametrize("keys", [{"amplitude": 0.2}, {"amplitude": 0.0}, {"boundary": "mirror"}])
def test_sound_wave_invalid_keys_are_refused(keys):
    with pytest.raises(ValidationError):
        SoundWave(**keys)


# --- vortices ---------------------------------------------------------------------------------


@pytest.mark.parametrize("problem", VORTICES)
def test_vortex_initial_state_in_balance(problem):
    radius = np.linspace(0.021, 0.449, 44) * np.diff(problem.box)[0]
    along = np.array([0.6, 0.8])[:, None]
    step = 1e-5

    def at(r):
        return problem.exact(AIR, 0.0, r * along)

    here = at(radius)
    # the velocity is across, so its square is v_phi^2
    assert np.abs((here["velocity"] * along).sum(axis=0)).max() < 1e-15
    needed = here["density"] * (here["velocity"] ** 2).sum(axis=0) / radius
    slope = (at(radius + step)["pressure"] - at(radius - step)["pressure"]) / (2 * step)
    # difference: step^2 times third derivatives of some 1e3; a kink within a step would show
    np.testing.assert_allclose(slope, needed, rtol=0, atol=1e-6)
    assert needed.max() > 0.1


@pytest.mark.parametrize("problem", VORTICES)
def test_vortex_turns_anticlockwise(problem):
    velocity = problem.exact(AIR, 0.0, np.array([[0.2], [0.0]]))["velocity"]
    assert velocity[0] == 0.0
    assert velocity[1] > 0.2


def test_gresho_matches_published_points():
    speed, rise = profile(np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.6]))
    np.testing.assert_allclose(speed, [0.0, 0.5, 1.0, 0.5, 0.0, 0.0], atol=1e-15)
    outside = 4 * np.log(2) - 2  # 3 + 4 ln 2 less the 5 of the centre
    expected = [0.0, 0.125, 0.5, 1.125 - 6 + 4 + 4 * np.log(1.5), outside, outside]
    np.testing.assert_allclose(rise, expected, rtol=0, atol=1e-14)
    centre = Gresho().exact(AIR, 0.0, np.zeros((2, 1)))
    assert centre["pressure"] == 5.0
    assert np.all(centre["velocity"] == 0.0)


def test_yee_isentropic_with_published_depth():
    problem = Yee()
    state = problem.initial(AIR)
    exact = problem.exact(AIR, 0.0, state.position)
    np.testing.assert_allclose(exact["pressure"], exact["density"] ** 1.4, rtol=1e-14)
    # T = 1 - (gamma - 1) beta^2 e/(8 gamma pi^2) at the centre, by hand
    centre = problem.exact(AIR, 0.0, np.zeros((2, 1)))
    depth = 0.4 * 25 * np.e / (8 * 1.4 * np.pi**2)
    assert centre["density"] == pytest.approx((1 - depth) ** 2.5, rel=1e-14)
    # masses by the density on cells of (10/64)^2: a quadrature that is exact for smooth functions,
    # up to the 1e-5 at the edge
    np.testing.assert_allclose(state.mass / (10 / 64) ** 2, exact["density"], rtol=1e-12)


def test_gresho_mach_number_of_fastest_gas():
    for mach in (0.1, 0.01):
        fastest = Gresho(mach=mach).exact(AIR, 0.0, np.array([[0.2], [0.0]]))
        speed = np.linalg.norm(fastest["velocity"])
        sound = AIR.sound_speed(fastest["density"], fastest["pressure"])
        assert speed / sound == pytest.approx(mach, rel=1e-12)
    as_published = Gresho().exact(AIR, 0.0, np.array([[0.2], [0.0]]))
    # the figure of the key's description
    assert 1 / AIR.sound_speed(1.0, as_published["pressure"]) == pytest.approx(0.36, abs=5e-3)


@pytest.mark.parametrize("vortex", [Gresho, Yee])
def test_vortex_with_bulk_velocity_crosses_faces(vortex):
    carried = vortex(velocity=[1.0, -0.5])
    at_rest = vortex()
    length = np.diff(carried.box)[0, 0]
    time = 0.7 * length
    position = at_rest.initial(AIR).position
    moved = position + np.array([[1.0], [-0.5]]) * time
    moved = (moved + length / 2) % length - length / 2
    here, there = at_rest.exact(AIR, 0.0, position), carried.exact(AIR, time, moved)
    # positions lose some digits to the wrapping
    np.testing.assert_allclose(there["pressure"], here["pressure"], rtol=1e-12)
    velocity = here["velocity"] + np.array([[1.0], [-0.5]])
    np.testing.assert_allclose(there["velocity"], velocity, atol=1e-12)


@pytest.mark.parametrize("bulk", [[0.0, 0.0], [1.0, 0.5]])
def test_gresho_report_exact_profile_has_no_error(bulk):
    problem = Gresho(velocity=bulk)
    state = problem.initial(AIR)
    time = 0.3
    exact = problem.exact(AIR, time, state.position)
    particles = particles_of(state, exact["density"], exact["velocity"])
    report = problem.compare(AIR, time, particles, None)
    assert report["error_v_phi"] < 1e-14  # round-off of a few operations
    assert report["peak_v_phi"] == pytest.approx(report["peak_v_phi_exact"], rel=1e-13)
    # a ring one spacing wide misses at most its width times the slope 5 of the peak of 1
    assert 1 - 5 / 64 < report["peak_v_phi"] < 1.0
    still = np.repeat(np.array(bulk)[:, None], state.mass.size, axis=1)
    lost = problem.compare(AIR, time, particles_of(state, exact["density"], still), None)
    # mean v_phi of the box: 2 pi (5/3 0.2^3 + [r^2 - 5/3 r^3] from 0.2 to 0.4), by hand
    # 0.04 x 2 pi; the lattice samples its kinks to second order
    assert lost["error_v_phi"] == pytest.approx(0.08 * np.pi, rel=1e-3)
    assert abs(lost["peak_v_phi"]) < 1e-14


def test_vortex_larger_than_box_is_refused():
    with pytest.raises(ValidationError, match=r"expected at least 0\.8 "):
        Gresho(domain=[0.0, 0.7])
    with pytest.raises(ValidationError, match="expected at least 10 "):
        Yee(domain=[[-5.0, 5.0], [-4.0, 4.0]])
    assert Gresho(domain=[0.0, 1.0]).initial(AIR).mass.size == 4096
    with pytest.raises(ValidationError):
        Gresho(velocity=[1.0])
