"""The exact implosion: published plateaus, jump conditions, and conservation of mass and energy."""

import math

import numpy as np
import pytest

from sph.exact import noh

SPHERE = {1: 2.0, 2: 2.0 * math.pi, 3: 4.0 * math.pi}
every_case = pytest.mark.parametrize(
    ("gamma", "dimension"), [(g, d) for g in (1.4, 5 / 3, 2.0) for d in (1, 2, 3)]
)


def in_shells(low, high, dimension, quantity):
    """Integral of quantity(r) from low to high: Gauss-Legendre, exact for these powers of r."""
    node, weight = np.polynomial.legendre.leggauss(8)
    r = low + 0.5 * (high - low) * (node + 1.0)
    shell = 0.5 * (high - low) * weight * SPHERE[dimension] * r ** (dimension - 1)
    return float(np.sum(shell * quantity(r)))


@pytest.mark.parametrize(("dimension", "density"), [(1, 4.0), (2, 16.0), (3, 64.0)])
def test_plateaus_match_published(dimension, density):
    # powers of (8/3)/(2/3), which round in the last digits
    assert noh.plateau(5 / 3, dimension) == pytest.approx((density, density / 3), rel=1e-14)
    inside = noh.solve([0.0, 0.19], 0.6, 5 / 3, dimension)
    np.testing.assert_allclose(inside[0], density, rtol=1e-14)
    np.testing.assert_array_equal(inside[1], 0.0)
    assert noh.shock_radius(0.6, 1.0, 5 / 3) == pytest.approx(0.2, rel=1e-15)


def test_gas_ahead_of_shock_is_compressed_by_geometry():
    # (1 + t/r)^(D - 1) at t = 0.6 and r = 0.3, by hand
    for dimension, density in ((1, 1.0), (2, 3.0), (3, 9.0)):
        in_front = noh.solve([0.3], 0.6, 5 / 3, dimension, background_pressure=1e-6)
        assert in_front[0] == pytest.approx(density, rel=1e-14)
        assert in_front[1] == -1.0
        assert in_front[2] == pytest.approx(1e-6 * density ** (5 / 3), rel=1e-14)


@every_case
def test_shock_jump_is_strong_shock_limit(gamma, dimension):
    density, speed, time = 1.7, 2.5, 0.3
    shock_speed = noh.shock_radius(1.0, speed, gamma)
    radius = noh.shock_radius(time, speed, gamma)
    behind = [
        f[0] for f in noh.solve([radius * (1 - 1e-14)], time, gamma, dimension, density, speed)
    ]
    front = [
        f[0] for f in noh.solve([radius * (1 + 1e-14)], time, gamma, dimension, density, speed)
    ]
    # Mass, momentum and energy through the shock, in its frame; cold in front. Round-off only.
    assert behind[0] * shock_speed == pytest.approx(front[0] * (shock_speed + speed), rel=1e-12)
    assert behind[2] == pytest.approx(front[0] * (shock_speed + speed) * speed, rel=1e-12)
    assert behind[2] / ((gamma - 1) * behind[0]) == pytest.approx(0.5 * speed**2, rel=1e-12)
    assert (behind[1], front[1]) == (0.0, -speed)


@every_case
def test_mass_and_energy_inside_equal_inflow(gamma, dimension):
    density, speed, time, edge = 1.7, 2.5, 0.3, 1.1
    shock = noh.shock_radius(time, speed, gamma)

    def of(field):
        return lambda r: noh.solve(r, time, gamma, dimension, density, speed)[field]

    mass = in_shells(0.0, shock, dimension, of(0)) + in_shells(shock, edge, dimension, of(0))
    # what is within `edge` now was within edge + speed x time. (r + vt)^(D-1) is a polynomial
    fallen = density * SPHERE[dimension] / dimension * (edge + speed * time) ** dimension
    assert mass == pytest.approx(fallen, rel=1e-12)
    heat = in_shells(0.0, shock, dimension, of(2)) / (gamma - 1.0)
    motion = in_shells(shock, edge, dimension, lambda r: 0.5 * of(0)(r) * of(1)(r) ** 2)
    assert heat + motion == pytest.approx(0.5 * fallen * speed**2, rel=1e-12)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_state_before_start_is_uniform(dimension):
    density, speed, pressure = noh.solve([0.0, 0.5], 0.0, 5 / 3, dimension, 2.0, 3.0, 1e-6)
    assert density.tolist() == [2.0, 2.0]
    assert speed.tolist() == [-3.0, -3.0]
    assert pressure.tolist() == [1e-6, 1e-6]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gamma": 1.0}, "gamma"),
        ({"gamma": math.nan}, "gamma"),
        ({"dimension": 4}, "dimension"),
        ({"density": 0.0}, "density"),
        ({"speed": -1.0}, "speed"),
        ({"radius": [-0.1]}, "radius and time"),
        ({"time": -1.0}, "radius and time"),
        ({"time": math.nan}, "radius and time"),
    ],
)
def test_invalid_arguments_are_refused(change, message):
    arguments = {"radius": [0.1], "time": 1.0, "gamma": 1.4, "dimension": 3}
    with pytest.raises(ValueError, match=message):
        noh.solve(**(arguments | change))
