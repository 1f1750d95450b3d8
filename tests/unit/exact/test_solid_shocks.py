"""Shocks in solids: published numbers, conservation across each front, and limits."""

import numpy as np
import pytest

from sph.exact import solid_shocks
from sph.exact.solid_shocks import Material

STEEL = Material(rho_0=7850.0, c_0=3600.0, slope=1.8, gruneisen=1.81)
PLASTIC = STEEL._replace(shear_modulus=8e10, yield_stress=6e8)

# half a unit of the last digit stated in the numbers below
DIGITS = 1.5e-5


def test_flyer_plate_behind_shock():
    # Us = c0 + S up, and the conservation laws by hand
    (shock,) = solid_shocks.fronts(STEEL, 500.0)
    assert shock.speed == pytest.approx(4500.0, rel=1e-12)
    assert shock.behind.velocity == pytest.approx(500.0, rel=1e-12)
    assert shock.behind.pressure == pytest.approx(1.76625e10, rel=1e-12)
    assert shock.behind.density == pytest.approx(8831.25, rel=1e-12)
    assert shock.behind.internal_energy == pytest.approx(1.25e5, rel=1e-12)
    assert shock.behind.deviator == 0.0


@pytest.mark.parametrize("speed", [1.0, 50.0, 3000.0])
def test_shock_without_strength_follows_linear_law(speed):
    (shock,) = solid_shocks.fronts(STEEL, speed)
    # the root of the compression is found to 1e-14 of its range, which is 1/up of it at up = 1
    assert shock.speed == pytest.approx(3600.0 + 1.8 * speed, rel=1e-9)


def test_elastic_plastic_shock_has_two_waves():
    precursor, plastic = solid_shocks.fronts(PLASTIC, 100.0)
    assert precursor.behind.stress == pytest.approx(7.873e8, rel=7e-5)
    assert precursor.behind.deviator == pytest.approx(4e8, rel=1e-12)
    assert precursor.speed == pytest.approx(5176.5, rel=DIGITS)
    assert plastic.speed == pytest.approx(3811.1, rel=DIGITS)
    assert plastic.behind.stress == pytest.approx(3.1961e9, rel=DIGITS)
    assert plastic.behind.velocity == pytest.approx(100.0, rel=1e-12)


def test_longitudinal_speed_of_steel():
    speed = solid_shocks.longitudinal_speed(7850.0 * 3600.0**2, 8e10, 7850.0)
    assert speed == pytest.approx(5152.5, rel=DIGITS)
    # a weak elastic shock is as fast
    weak = solid_shocks.fronts(PLASTIC, 1e-3)
    assert weak[0].speed == pytest.approx(speed, rel=1e-6)


@pytest.mark.parametrize("speed", [10.0, 100.0, 500.0, 1200.0])
def test_fronts_conserve_mass_momentum_and_energy(speed):
    ahead = solid_shocks.at_rest(PLASTIC)
    for front in solid_shocks.fronts(PLASTIC, speed):
        U, after = front.speed, front.behind
        flux = ahead.density * (U - ahead.velocity)
        assert after.density * (U - after.velocity) == pytest.approx(flux, rel=1e-9)
        push = flux * (after.velocity - ahead.velocity)
        assert after.stress - ahead.stress == pytest.approx(push, rel=1e-9)
        gain = after.internal_energy + after.velocity**2 / 2 - ahead.internal_energy
        work = after.stress * after.velocity - ahead.stress * ahead.velocity
        assert flux * (gain - ahead.velocity**2 / 2) == pytest.approx(work, rel=1e-9)
        ahead = after
    assert ahead.velocity == pytest.approx(speed, rel=1e-9)


def test_one_wave_below_elastic_limit_and_one_above_overdriven_speed():
    limit = solid_shocks.elastic_limit(PLASTIC).behind.velocity
    assert [len(solid_shocks.fronts(PLASTIC, speed)) for speed in (0.99 * limit, 1.01 * limit)] == [
        1,
        2,
    ]
    # from about 870 m/s on the plastic shock catches up with the precursor
    slow, fast = solid_shocks.fronts(PLASTIC, 860.0), solid_shocks.fronts(PLASTIC, 900.0)
    assert (len(slow), len(fast)) == (2, 1)
    assert slow[1].speed < slow[0].speed < fast[0].speed


def test_profile_has_state_of_slowest_front_at_contact():
    found = solid_shocks.fronts(PLASTIC, 100.0)
    profile = solid_shocks.at(found, solid_shocks.at_rest(PLASTIC), np.array([0.0, 4500.0, 6000.0]))
    assert profile.stress == pytest.approx([3.1961e9, 7.873e8, 0.0], rel=7e-5)
    assert profile.density[2] == 7850.0


@pytest.mark.parametrize("speed", [0.0, -1.0, np.nan, np.inf])
def test_speed_of_no_shock_is_refused(speed):
    with pytest.raises(ValueError, match="expected a finite positive number"):
        solid_shocks.fronts(STEEL, speed)
