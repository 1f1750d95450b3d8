"""Hard geometry and contrasts: initial states, exact answers and figures, without running any."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import quad
from scipy.spatial import cKDTree

from sph import eos
from sph.exact import expanding_ball
from sph.problems.blob import Problem as Blob
from sph.problems.contrast import Problem as Contrast
from sph.problems.expanding_ball import Problem as ExpandingBall
from sph.problems.keplerian_ring import Problem as KeplerianRing
from sph.problems.particles import Problem as Given
from sph.problems.point_explosion import Problem as PointExplosion
from sph.problems.uniform import Problem as Uniform

AIR = eos.make("ideal_gas", gamma=1.4)
MONATOMIC = eos.make("ideal_gas", gamma=5.0 / 3.0)


def particles_of(problem, gas, **fields):
    """The exact particles at t = 0, with IDs in their order."""
    state = problem.initial(gas)
    given = state._asdict() | {"id": np.arange(1, state.mass.size + 1)}
    exact = problem.exact(gas, 0.0, state.position) or {}
    given |= {name: exact[name] for name in ("density", "velocity") if name in exact}
    return SimpleNamespace(**(given | {"support": np.ones(state.mass.size)} | fields))


# --- a ball that expands ----------------------------------------------------------------------


def test_expanding_ball_monatomic_matches_closed_form():
    # D (gamma - 1) = 2: then R^2 = R_0^2 + (final speed)^2 t^2
    for time in (0.1, 1.0, 30.0):
        radius, speed = expanding_ball.radius(time, 2.0, 0.7, 5.0 / 3.0, 3)
        final = 2.0 * 0.7 / (2.0 / 3.0) / np.sqrt(3.0)  # 2 c/(gamma - 1)/sqrt(D)
        expected = np.hypot(2.0, final * time)
        # the integrator's tolerance is 1e-11 a step
        assert radius == pytest.approx(expected, rel=1e-9)
        assert speed == pytest.approx(final**2 * time / expected, rel=1e-9)
    assert expanding_ball.radius(0.0, 2.0, 0.7, 1.4, 2) == (2.0, 0.0)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_expanding_ball_conserves_energy_and_solves_euler(dimension):
    problem = ExpandingBall(dimension=dimension, n=100, domain=[-2.0, 2.0], pressure=0.6)
    surface = (2.0, 2.0 * np.pi, 4.0 * np.pi)[dimension - 1]

    def energy(time):
        radius = problem._radius(AIR, time)[0]

        def density_of_energy(r):
            at = np.zeros((dimension, 1))
            at[0] = r
            gas = problem.exact(AIR, time, at)
            total = 0.5 * gas["velocity"][0, 0] ** 2 + gas["internal_energy"][0]
            return surface * r ** (dimension - 1) * gas["density"][0] * total

        return quad(density_of_energy, 0.0, radius, epsabs=0.0, epsrel=1e-10)[0]

    # pressure does no work on a vacuum: quadrature, and 1e-11 of the radius
    assert energy(3.0) == pytest.approx(energy(0.0), rel=1e-8)
    x, step = np.zeros((dimension, 3)), 1e-4
    x[0] = 1.1 + step * np.array([-1.0, 0.0, 1.0])
    before, now, after = (problem.exact(AIR, 1.0 + shift, x) for shift in (-step, 0.0, step))
    v = now["velocity"][0]
    by_time = (after["velocity"][0, 1] - before["velocity"][0, 1]) / (2 * step)
    slope = (v[2] - v[0]) / (2 * step)
    force = -(now["pressure"][2] - now["pressure"][0]) / (2 * step) / now["density"][1]
    # central differences: step^2 times third derivatives of order one
    assert by_time + v[1] * slope == pytest.approx(force, rel=1e-6)


@pytest.mark.parametrize(
    ("dimension", "n", "lattice"), [(1, 400, "cubic"), (2, 4000, "hexagonal"), (3, 8000, "bcc")]
)
def test_expanding_ball_particles_sample_profile(dimension, n, lattice):
    problem = ExpandingBall(dimension=dimension, n=n, lattice=lattice, domain=[-1.0, 3.0])
    state = problem.initial(MONATOMIC)
    radius = np.linalg.norm(state.position - 1.0, axis=0) / 2.0
    assert radius.max() < 1.0
    total = quad(lambda s: s ** (dimension - 1) * (1 - s * s) ** 1.5, 0.0, 1.0)[0]
    surface = (2.0, 2.0 * np.pi, 4.0 * np.pi)[dimension - 1]
    assert state.mass.sum() == pytest.approx(2.0**dimension * surface * total, rel=1e-9)
    for reach in (0.3, 0.5, 0.8):
        share = quad(lambda s: s ** (dimension - 1) * (1 - s * s) ** 1.5, 0.0, reach)[0] / total
        # a lattice's ball is ragged by a part of its layers, 15 to a radius in 3-D
        assert np.mean(radius < reach) == pytest.approx(share, rel=0.06)
    exact = problem.exact(MONATOMIC, 0.0, state.position)
    np.testing.assert_allclose(exact["internal_energy"], state.internal_energy, rtol=1e-9)
    report = problem.report(MONATOMIC, 0.0, particles_of(problem, MONATOMIC), exact["pressure"])
    assert report["kinetic_share"] == report["front_speed"] == 0.0
    exact = problem.compare(MONATOMIC, 0.0, particles_of(problem, MONATOMIC), exact["pressure"])
    assert exact["radius_exact"] == 2.0


# --- contrast ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("dimension", "n", "layers"), [(1, 200, 200), (3, 4096, 16)])
def test_contrast_equal_spacing_uses_unequal_masses(dimension, n, layers):
    step = Contrast(dimension=dimension, n=n).initial(MONATOMIC)
    assert step.mass.max() / step.mass.min() == pytest.approx(1e6, rel=1e-12)
    assert step.mass.sum() == pytest.approx(0.5 * (1.0 + 1e-6), rel=1e-12)
    graded = Contrast(dimension=dimension, n=n, profile="graded").initial(MONATOMIC)
    # from the middle of the first layer to that of the last
    expected = 1e6 ** (1.0 - 1.0 / layers)
    assert graded.mass.max() / graded.mass.min() == pytest.approx(expected, rel=1e-12)
    np.testing.assert_array_equal(graded.position, step.position)


@pytest.mark.parametrize(("dimension", "n", "ratio"), [(1, 4000, 1e3), (2, 4000, 30), (3, 8000, 8)])
def test_contrast_equal_masses_uses_unequal_spacing(dimension, n, ratio):
    problem = Contrast(dimension=dimension, n=n, ratio=ratio, profile="graded", masses="equal")
    state = problem.initial(MONATOMIC)
    assert state.mass.size == pytest.approx(n, rel=0.02)
    assert np.all((state.position > 0.0) & (state.position < 1.0))
    assert np.ptp(state.mass) == 0.0
    exact = problem.exact(MONATOMIC, 0.0, state.position)
    assert np.ptp(exact["pressure"]) == 0.0
    total = (1.0 - 1.0 / ratio) / np.log(ratio)
    assert state.mass.sum() == pytest.approx(total, rel=1e-12)
    for s in (0.25, 0.5, 0.75):
        below = state.mass[state.position[0] < s].sum() / state.mass.sum()
        # a layer more or less, some 10 of the 8000 particles' layers being thinner than 5 %
        assert below == pytest.approx((1.0 - ratio**-s) / (1.0 - 1.0 / ratio), abs=0.03)
    distance = cKDTree(state.position.T).query(state.position.T, k=2)[0][:, 1]
    spacing = (state.mass / exact["density"]) ** (1.0 / dimension)
    # squares but for whole numbers of particles across, and layers that do not line up
    assert (distance / spacing).min() > 0.6


def test_contrast_step_with_equal_masses_is_refused():
    with pytest.raises(ValidationError, match="shock_tube"):
        Contrast(masses="equal")


def test_contrast_thin_gas_narrower_than_support_is_refused():
    with pytest.raises(ValidationError, match=r"expected 4\."):
        Contrast(dimension=2, n=1000, masses="equal", profile="graded")


def test_contrast_report_measures_motion():
    problem = Contrast()
    n = problem.initial(MONATOMIC).mass.size
    velocity = np.zeros((1, n))
    velocity[0, -1] = 0.1 * np.sqrt(5.0 / 3.0 * 1e6)  # of sound in the thin gas
    pressure = np.ones(n)
    pressure[3] = 0.7
    particles = particles_of(problem, MONATOMIC, velocity=velocity)
    report = problem.report(MONATOMIC, 0.0, particles, pressure)
    assert report["mach_number"] == pytest.approx(0.1)
    beside = problem.compare(MONATOMIC, 0.0, particles, pressure)
    assert beside["pressure_error"] == pytest.approx(0.3)
    assert report["density_ratio"] == pytest.approx(1e6)


# --- blob -------------------------------------------------------------------------------------


def test_blob_without_wind_is_refused():
    with pytest.raises(ValidationError, match="mach"):  # growth times are counted in its speed
        Blob(mach=0.0)


@pytest.mark.parametrize(("dimension", "n"), [(2, 4000), (3, 20000)])
def test_blob_cloud_is_dense_cold_and_at_rest(dimension, n):
    problem = Blob(dimension=dimension, n=n)
    particles = particles_of(problem, MONATOMIC)
    inside = np.linalg.norm(particles.position, axis=0) < 1.0
    assert np.all(particles.velocity[0, inside] == 0.0)
    np.testing.assert_allclose(particles.velocity[0, ~inside], 2.7 * np.sqrt(5 / 3), rtol=1e-14)
    assert np.ptp(particles.mass) == 0.0
    # a ball of a lattice of eight spacings to its radius, or more, is ragged
    assert problem.diagnostics(particles)["cloud_mass_fraction"] == pytest.approx(1.0, abs=0.03)
    volume = 40.0 * 10.0 ** (dimension - 1)
    cloud = (np.pi, 4 / 3 * np.pi)[dimension - 2]
    assert particles.mass.sum() == pytest.approx(volume + 9.0 * cloud, rel=2e-3)
    report = problem.report(MONATOMIC, 0.0, particles, np.ones(inside.size))
    assert report["cloud_velocity"] == report["growth_times"] == 0.0


def test_blob_heated_or_thinned_gas_is_not_cloud():
    problem = Blob(n=4000)
    particles = particles_of(problem, MONATOMIC)
    cloud = np.linalg.norm(particles.position, axis=0) < 1.0
    whole = problem.diagnostics(particles)["cloud_mass_fraction"]
    particles.density = np.where(cloud & (particles.position[0] > 0.0), 6.3, particles.density)
    half = problem.diagnostics(particles)["cloud_mass_fraction"]
    assert half == pytest.approx(whole / 2, rel=0.02)
    particles.internal_energy = np.where(cloud, 0.95 * 1.5, 1.5)
    assert problem.diagnostics(particles)["cloud_mass_fraction"] == 0.0


def test_blob_cloud_too_large_for_box_is_refused():
    with pytest.raises(ValidationError, match="expected a diameter below"):
        Blob(radius=5.0)


# --- ring -------------------------------------------------------------------------------------


def test_ring_is_uniform_and_on_circular_orbits():
    problem = KeplerianRing()
    particles = particles_of(problem, MONATOMIC)
    radius = np.linalg.norm(particles.position, axis=0)
    assert particles.mass.sum() == pytest.approx(2.0 * np.pi, rel=1e-12)
    # whole numbers of some 40 to 160 to a circle
    np.testing.assert_allclose(particles.mass, 2.0 * np.pi / 3000, rtol=0.03)
    speed = np.linalg.norm(particles.velocity, axis=0)
    np.testing.assert_allclose(speed**2 * radius, 1.0, rtol=1e-13)
    assert np.abs((particles.position * particles.velocity).sum(axis=0)).max() < 1e-15
    assert problem.diagnostics(particles) == {
        "density_deviation": 0.0,
        "radial_deviation": pytest.approx(0.0, abs=1e-15),
    }


def test_ring_report_counts_orbits_until_break():
    problem = KeplerianRing()
    t = 2.0 * np.pi * np.linspace(0.0, 4.0, 9)
    whole = {"t": t, "density_deviation": np.full(9, 0.09), "radial_deviation": np.full(9, 0.019)}
    assert problem.over_time(MONATOMIC, whole) == {"orbits": 4.0, "orbits_intact": 4.0}
    spread = whole | {"radial_deviation": np.linspace(0.0, 0.04, 9)}
    assert (
        problem.over_time(MONATOMIC, spread)["orbits_intact"] == 2.5
    )  # 0.02 is not more than 0.02
    displaced = particles_of(problem, MONATOMIC)
    displaced.position = 1.05 * displaced.position
    found = problem.diagnostics(displaced)["radial_deviation"]
    assert found == pytest.approx(0.05, rel=0.1)  # of radii about 1, the width of the ring


# --- particles one by one ---------------------------------------------------------------------


def test_given_particles_are_used():
    problem = Given(
        dimension=2,
        positions=[[0.0, 1.0], [0.5, -1.0], [0.5, -1.0]],
        velocities=[[1.0, 0.0], [0.0, 0.0], [0.0, -1.0]],
        masses=[1.0, 1e-6, 2.0],
        internal_energies=0.5,
    )
    assert problem.n == 3
    state = problem.initial(AIR)
    np.testing.assert_array_equal(state.position, [[0.0, 0.5, 0.5], [1.0, -1.0, -1.0]])
    np.testing.assert_array_equal(state.velocity, [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    np.testing.assert_array_equal(state.mass, [1.0, 1e-6, 2.0])
    np.testing.assert_array_equal(state.internal_energy, [0.5, 0.5, 0.5])


def test_given_particles_report_centre_of_mass_error():
    problem = Given(positions=[[0.0], [1.0]], velocities=[[1.0], [0.0]], masses=[3.0, 1.0])
    particles = particles_of(problem, AIR, density=np.ones(2))
    particles.position = particles.position + 2.0 * problem.initial(AIR).velocity
    particles.velocity = problem.initial(AIR).velocity
    assert problem.compare(AIR, 2.0, particles, np.ones(2))["centre_error"] < 1e-15
    particles.position = particles.position + 0.4
    # over the reach, 2.4, and what the fastest travels, 2
    report = problem.compare(AIR, 2.0, particles, np.ones(2))
    assert report["centre_error"] == pytest.approx(0.4 / 4.4)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"n": 3}, "expected 2, the number of positions"),
        ({"positions": [[0.0, 1.0], [0.0, 0.0]]}, "expected 1 components"),
        ({"velocities": [[0.0]]}, "velocities: 1 values; expected 2"),
        ({"masses": [1.0, 0.0]}, "expected values above 0"),
        ({"internal_energies": -1.0}, "expected values above 0"),
        ({"positions": [[0.0], [1.5]], "boundary": "mirror"}, r"\[1.5\] is outside \[-1.0, 1.0\]"),
        ({"positions": []}, "at least 1 item"),
    ],
)
def test_given_particles_of_wrong_shape_are_refused(keys, message):
    with pytest.raises(ValidationError, match=message):
        Given(**({"positions": [[0.0], [1.0]]} | keys))


# --- further keys of problems there were ------------------------------------------------------


@pytest.mark.parametrize("lattice", ["cubic", "bcc", "relaxed"])
def test_point_explosion_one_particle_releases_energy_at_centre(lattice):
    problem = PointExplosion(n=1000, lattice=lattice, energy_particles=1)
    state = problem.initial(MONATOMIC)
    (hot,) = np.flatnonzero(state.internal_energy > 1.0)
    # one rounding of coordinates of order one
    np.testing.assert_allclose(state.position[:, hot], 0.0, atol=1e-15)
    assert np.all((state.position >= -0.5) & (state.position < 0.5))
    shifted = (state.position + 0.5).T % 1.0
    nearest = cKDTree(shifted, boxsize=1.0).query(shifted, k=2)[0][:, 1]
    unmoved = (PointExplosion(n=1000, lattice=lattice).initial(MONATOMIC).position + 0.5).T
    expected = cKDTree(unmoved, boxsize=1.0).query(unmoved, k=2)[0][:, 1]
    np.testing.assert_allclose(np.sort(nearest), np.sort(expected), atol=1e-12)


def test_uniform_random_placement_has_no_lattice():
    problem = Uniform(dimension=3, n=20000, lattice="random", seed=3)
    position = problem.initial(AIR).position
    assert position.shape == (3, 20000)
    counts = np.histogramdd(position.T, bins=(10, 10, 10), range=[(0, 1)] * 3)[0]
    # 20 a cell with the variance of a Poisson process; 1000 cells know it to 5 %
    assert counts.var() == pytest.approx(20.0, rel=0.2)
    other = Uniform(dimension=3, n=20000, lattice="random", seed=4).initial(AIR).position
    assert not np.any(position == other)


def test_uniform_report_has_spread_and_displacement():
    problem = Uniform(n=16, velocity=[-3.0, 1.0], domain=[0.0, 2.0])
    particles = particles_of(problem, AIR)
    particles.density = np.linspace(1.0, 1.25, 16)
    report = problem.report(AIR, 4.0, particles, np.ones(16))
    assert report["density_spread"] == pytest.approx(0.25)
    assert report["energy_spread"] == 0.0
    assert problem.compare(AIR, 4.0, particles, np.ones(16))["crossings"] == 6.0
