"""The exact point explosion: conservation, jump conditions, the equations, published radii."""

import math

import numpy as np
import pytest

from sph.exact import sedov

SPHERE = {1: 2.0, 2: 2.0 * math.pi, 3: 4.0 * math.pi}
TIME, ENERGY, DENSITY = 0.3, 2.5, 1.7
every_case = pytest.mark.parametrize(
    ("gamma", "dimension"), [(g, d) for g in (1.4, 5 / 3, 2.0) for d in (1, 2, 3)]
)


def blast(radius, gamma, dimension, time=TIME):
    return sedov.solve(radius, time, ENERGY, DENSITY, gamma, dimension)


def radius_of_shock(gamma, dimension, time=TIME):
    return sedov.shock_radius(ENERGY, DENSITY, gamma, dimension, time)


def integral(gamma, dimension, quantity):
    """Of quantity(r, density, velocity, pressure) over the blast: Gauss-Legendre in r."""
    node, weight = np.polynomial.legendre.leggauss(200)
    shock = radius_of_shock(gamma, dimension)
    r = 0.5 * shock * (node + 1.0)
    shell = 0.5 * shock * weight * SPHERE[dimension] * r ** (dimension - 1)
    return float(np.sum(shell * quantity(r, *blast(r, gamma, dimension))))


@pytest.mark.parametrize(("gamma", "xi"), [(5 / 3, 1.152), (1.4, 1.033)])
def test_shock_radius_3d_matches_published(gamma, xi):
    # half a unit of the last digit quoted
    assert sedov.shock_radius(1.0, 1.0, gamma, 3, 1.0) == pytest.approx(xi, abs=5e-4)


@every_case
def test_shock_radius_follows_similarity_scaling(gamma, dimension):
    one = sedov.shock_radius(1.0, 1.0, gamma, dimension, 1.0)
    expected = one * (ENERGY * TIME**2 / DENSITY) ** (1.0 / (dimension + 2))
    assert radius_of_shock(gamma, dimension) == pytest.approx(expected, rel=1e-14)  # round-off


# Tolerance of the three integrals: the profile begins as a power r^(D/(gamma - 1)), not an integer,
# where 200 Gauss nodes err by less than 1e-9; the solution itself is exact to 1e-14.
@every_case
def test_profile_energy_equals_released_energy(gamma, dimension):
    energy = integral(gamma, dimension, lambda r, rho, v, p: 0.5 * rho * v**2 + p / (gamma - 1.0))
    assert energy == pytest.approx(ENERGY, rel=1e-9)


@every_case
def test_profile_mass_equals_swept_mass(gamma, dimension):
    swept = DENSITY * SPHERE[dimension] / dimension * radius_of_shock(gamma, dimension) ** dimension
    assert integral(gamma, dimension, lambda r, rho, v, p: rho) == pytest.approx(swept, rel=1e-9)


@every_case
def test_momentum_weighted_radius_matches_integral(gamma, dimension):
    moment = integral(gamma, dimension, lambda r, rho, v, p: rho * v * r)
    momentum = integral(gamma, dimension, lambda r, rho, v, p: rho * v)
    found = sedov.momentum_weighted_radius(ENERGY, DENSITY, gamma, dimension, TIME)
    assert found == pytest.approx(moment / momentum, rel=1e-9)
    assert found < radius_of_shock(gamma, dimension)


@every_case
def test_shock_jump_is_strong_shock_limit(gamma, dimension):
    shock = radius_of_shock(gamma, dimension)
    # The shock's speed from its path by central difference: error and round-off 1e-10 of it
    step = 1e-5 * TIME
    later, earlier = (radius_of_shock(gamma, dimension, TIME + s * step) for s in (1, -1))
    speed = (later - earlier) / (2 * step)
    density, velocity, pressure = (f[0] for f in blast([shock * (1 - 1e-13)], gamma, dimension))
    # Mass, momentum and energy through the shock, in its frame. 1e-13 inside costs some 1e-12.
    assert density * (speed - velocity) == pytest.approx(DENSITY * speed, rel=1e-9)
    assert pressure == pytest.approx(DENSITY * speed * velocity, rel=1e-9)
    enthalpy = gamma / (gamma - 1.0) * pressure / density
    assert enthalpy + 0.5 * (speed - velocity) ** 2 == pytest.approx(0.5 * speed**2, rel=1e-9)


@every_case
def test_interior_satisfies_euler_equations(gamma, dimension):
    """Continuity, momentum and entropy by central differences of the solution in r and t."""
    shock = radius_of_shock(gamma, dimension)
    r = np.linspace(0.3, 0.95, 14) * shock
    dr, dt = 1e-5 * shock, 1e-5 * TIME
    density, velocity, pressure = blast(r, gamma, dimension)

    def slopes(field):
        by_r = (blast(r + dr, gamma, dimension)[field] - blast(r - dr, gamma, dimension)[field]) / (
            2 * dr
        )
        after, before = (blast(r, gamma, dimension, TIME + s * dt)[field] for s in (1, -1))
        return by_r, (after - before) / (2 * dt)

    (rho_r, rho_t), (v_r, v_t), (p_r, p_t) = (slopes(field) for field in range(3))
    divergence = v_r + (dimension - 1) * velocity / r
    # Error of the differences: (1e-5)^2 times third derivatives (up to 1e3 for the steep density),
    # and round-off 1e-16/1e-5 times some tens.
    equal = {"rtol": 1e-6, "atol": 0.0}
    assert np.allclose(rho_t + velocity * rho_r, -density * divergence, **equal)
    assert np.allclose(
        density * (v_t + velocity * v_r), -p_r, rtol=1e-6, atol=1e-7 * pressure.max() / shock
    )
    assert np.allclose(p_t + velocity * p_r, -gamma * pressure * divergence, **equal)


@every_case
def test_profile_at_centre_is_finite(gamma, dimension):
    with np.errstate(divide="raise", invalid="raise"):
        density, velocity, pressure = blast([0.0, 1e-300, 1e-12, 1e-3], gamma, dimension)
    assert np.all(np.isfinite([density, velocity, pressure]))
    assert velocity[0] == 0.0
    assert np.all(np.diff(density) >= 0.0)
    # density goes as r^(D/(gamma - 1)), so at 1e-12 R it is below 1e-11 even for D = 1, gamma = 2
    assert density[2] < 1e-10
    # the pressure is flat to the power D/(gamma - 1) + 2 >= 3 of 1e-3
    assert pressure[0] > 0.0
    assert pressure[3] == pytest.approx(pressure[0], rel=1e-7)


def test_profile_outside_shock_is_background():
    radius = np.array([1.0 + 1e-12, 2.0]) * radius_of_shock(1.4, 2)
    profile = sedov.solve(radius, TIME, ENERGY, DENSITY, 1.4, 2, background_pressure=1e-6)
    assert [field.tolist() for field in profile] == [[DENSITY] * 2, [0.0] * 2, [1e-6] * 2]


def test_profile_gamma_2_is_regular():
    # The usual closed form divides by gamma - 2. A gamma 1e-9 away must give the same within 1e-8.
    radius = np.linspace(0.0, 0.9, 10) * radius_of_shock(2.0, 3)
    for beside in (2.0 - 1e-9, 2.0 + 1e-9):
        for field, close in zip(blast(radius, 2.0, 3), blast(radius, beside, 3), strict=True):
            assert np.allclose(field, close, rtol=1e-7, atol=0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"energy": 0.0}, "energy"),
        ({"density": -1.0}, "density"),
        ({"time": 0.0}, "time"),
        ({"time": math.nan}, "time"),
        ({"gamma": 1.0}, "gamma"),
        ({"gamma": 7.0}, "below 7"),
        ({"dimension": 4}, "dimension"),
        ({"radius": [-0.1]}, "radius"),
    ],
)
def test_invalid_arguments_are_refused(change, message):
    arguments = {
        "radius": [0.1],
        "time": 1.0,
        "energy": 1.0,
        "density": 1.0,
        "gamma": 1.4,
        "dimension": 3,
    }
    with pytest.raises(ValueError, match=message):
        sedov.solve(**(arguments | change))
