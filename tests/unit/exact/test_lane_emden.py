"""Polytropes and their fundamental radial mode against closed forms and published numbers."""

import numpy as np
import pytest

from sph.exact.lane_emden import Polytrope

NODE, WEIGHT = np.polynomial.legendre.leggauss(200)
MONATOMIC = 5.0 / 3.0
# n, first zero, central over mean density (Chandrasekhar 1939, table 4; 1 to 1e-5)
PUBLISHED = [(0.0, 2.44949, 1.0), (1.0, 3.14159, 3.28987), (1.5, 3.65375, 5.99071),
             (3.0, 6.89685, 54.1825), (4.5, 31.83646, 6189.47)]  # fmt: skip


def integral(star: Polytrope, quantity) -> float:
    """Of quantity(r) over the volume of the sphere."""
    r = 0.5 * star.radius * (NODE + 1.0)
    return float(np.sum(0.5 * star.radius * WEIGHT * 4.0 * np.pi * r * r * quantity(r)))


@pytest.mark.parametrize(("index", "surface", "ratio"), PUBLISHED)
def test_central_density_matches_published(index, surface, ratio):
    star = Polytrope(index, 2.0, 3.0, 0.7)
    assert star.central_density / star.mean_density == pytest.approx(ratio, rel=3e-6)
    # P_c = 4 pi G alpha^2 rho_c^2/(n + 1), alpha = R/surface
    expected = 4.0 * np.pi * 0.7 * (3.0 / surface * star.central_density) ** 2 / (index + 1.0)
    assert star.central_pressure == pytest.approx(expected, rel=1e-5)


def test_index_1_matches_closed_form():
    star = Polytrope(1.0, 2.0, 3.0, 0.7)
    x = np.linspace(0.0, 1.2, 1001)
    inside = x < 1.0
    exact = np.where(inside, np.sinc(x), 0.0)
    # interpolation of the table, 4000 nodes
    np.testing.assert_allclose(star.density(3.0 * x) / star.central_density, exact, atol=1e-11)
    np.testing.assert_allclose(star.pressure(3.0 * x) / star.central_pressure, exact**2, atol=1e-11)
    mass = np.where(inside, np.sin(np.pi * x) / np.pi - x * np.cos(np.pi * x), 1.0)
    np.testing.assert_allclose(star.enclosed_mass(3.0 * x), 2.0 * mass, atol=1e-11)


@pytest.mark.parametrize(("index", "energy"), [(1.0, -0.75), (1.5, -6.0 / 7.0), (3.0, -1.5)])
def test_sphere_has_its_mass_and_obeys_virial_theorem(index, energy):
    star = Polytrope(index, 2.0, 3.0, 0.7)
    # theta^n at the surface is not smooth, and 200 Gauss nodes err by 1e-11
    assert integral(star, star.density) == pytest.approx(2.0, rel=1e-9)
    unit = 0.7 * 2.0**2 / 3.0
    assert star.potential_energy == pytest.approx(energy * unit, rel=1e-14)
    pull = integral(star, lambda r: -0.7 * star.density(r) * star.enclosed_mass(r) / r)
    assert pull == pytest.approx(energy * unit, rel=1e-9)
    assert 3.0 * integral(star, star.pressure) == pytest.approx(-energy * unit, rel=1e-9)


def test_radius_of_mass_inverts_enclosed_mass():
    star = Polytrope(1.5, 2.0, 3.0)
    radius = np.linspace(0.0, 2.9, 30)  # farther out, round-off in the mass moves the radius
    np.testing.assert_allclose(star.radius_of_mass(star.enclosed_mass(radius)), radius, atol=1e-8)
    assert star.radius_of_mass(np.array(2.0)) == pytest.approx(3.0, rel=1e-3)


@pytest.mark.parametrize("index", [-0.1, 5.0, 7.0])
def test_index_without_finite_radius_is_refused(index):
    with pytest.raises(ValueError, match="expected 0 <= index < 5"):
        Polytrope(index).density(np.array([0.5]))


@pytest.mark.parametrize(
    ("index", "gamma", "expected"),
    # 3 gamma - 4 for uniform density (Cox 1980); the others from shooting with other programs
    [(0.0, MONATOMIC, 1.0), (0.0, 1.5, 0.5), (1.0, MONATOMIC, 1.891565),
     (1.5, MONATOMIC, 2.705872)],
)  # fmt: skip
def test_fundamental_frequency_matches_published(index, gamma, expected):
    mode = Polytrope(index, 2.0, 3.0, 0.7).fundamental_mode(gamma)
    unit = 0.7 * 2.0 / 27.0
    assert mode.squared_frequency == pytest.approx(expected * unit, rel=3e-7)  # six decimals
    assert mode.period == pytest.approx(2.0 * np.pi / np.sqrt(expected * unit), rel=3e-7)


@pytest.mark.parametrize("index", [1.0, 1.5, 3.0])
def test_mode_solves_wave_equation(index):
    star = Polytrope(index)
    mode = star.fundamental_mode(MONATOMIC)
    step = 1e-3
    r = np.linspace(0.1, 0.9, 17)

    def slope(function):
        return (function(r + step) - function(r - step)) / (2.0 * step)

    def flux(x):
        derivative = (mode.shape(x + step) - mode.shape(x - step)) / (2.0 * step)
        return MONATOMIC * star.pressure(x) * x**4 * derivative

    inertia = mode.squared_frequency * star.density(r) * r**4 * mode.shape(r)
    force = (3.0 * MONATOMIC - 4.0) * r**3 * slope(star.pressure) * mode.shape(r)
    scale = np.abs(inertia).max()
    # central differences: step^2 times third derivatives, of up to 100
    np.testing.assert_allclose((slope(flux) + force + inertia) / scale, 0.0, atol=3e-4)
    assert mode.shape(np.array([1.0])) == pytest.approx(1.0, rel=1e-12)
    assert np.all(mode.shape(np.linspace(0.0, 1.0, 50)) > 0.0)  # fundamental: no node


@pytest.mark.parametrize("gamma", [4.0 / 3.0 - 1e-6, 1.2])
def test_unstable_polytrope_has_no_period(gamma):
    mode = Polytrope(1.5).fundamental_mode(gamma)
    assert mode.squared_frequency < 0.0
    with pytest.raises(ValueError, match="gamma above 4/3"):
        _ = mode.period


@pytest.mark.parametrize(("index", "gamma"), [(1.0, MONATOMIC), (3.0, MONATOMIC), (1.0, 2.5)])
def test_buoyancy_follows_from_profile(index, gamma):
    star = Polytrope(index, 2.0, 3.0, 0.7)
    r, step = np.linspace(0.3, 2.7, 9), 1e-4

    def slope(function):
        return np.log(function(r + step) / function(r - step)) / (2.0 * step)

    pull = 0.7 * star.enclosed_mass(r) / r**2
    expected = pull * (slope(star.pressure) / gamma - slope(star.density))
    # central differences: step^2 times third derivatives of up to 100
    np.testing.assert_allclose(star.squared_buoyancy(r, gamma), expected, rtol=1e-5)
    assert np.all((expected < 0.0) == (gamma < 1.0 + 1.0 / index))


def test_pressure_of_density_is_that_of_profile():
    star = Polytrope(1.5, 2.0, 3.0, 0.7)
    r = np.linspace(0.0, 2.9, 20)
    np.testing.assert_allclose(star.pressure_of(star.density(r)), star.pressure(r), rtol=1e-12)
