"""Tait and Mie-Grueneisen: states by hand, the exact Hugoniot curve, and their limits."""

import numpy as np
import pytest

from sph import config, eos
from sph.errors import ConfigError

FEW_ROUNDINGS = 1e-14  # of some operations at 1e-16 each
STEEL = {"rho_0": 7850.0, "c_0": 3600.0, "slope": 1.8, "gruneisen": 1.81}


def steel():
    return eos.make("mie_gruneisen", **STEEL)


def test_linear_tait_matches_by_hand():
    rubber = eos.make("tait", rho_0=1000.0, c_0=20.0)
    density = np.array([990.0, 1000.0, 1010.0])
    np.testing.assert_allclose(rubber.pressure(density, 7.0), [-4000.0, 0.0, 4000.0], rtol=1e-12)
    np.testing.assert_array_equal(rubber.sound_speed(density, density), 20.0)
    np.testing.assert_array_equal(rubber.internal_energy(density, 0.0), 0.0)
    own = rubber.pressure(density, 0.0)
    np.testing.assert_array_equal(rubber.internal_energy(density, own), 0.0)


def test_tait_refuses_initial_pressure_that_density_does_not_give():
    rubber = eos.make("tait", rho_0=1000.0, c_0=20.0)
    with pytest.raises(ConfigError, match=r"pressure 1 at density 1010, but .* gives 4000 there"):
        rubber.internal_energy(np.array([1000.0, 1010.0]), np.array([0.0, 1.0]))
    with pytest.raises(ConfigError, match="pressure 5 at density 1000"):
        rubber.internal_energy(1000.0, 5.0)


def test_tait_with_gamma_7_matches_by_hand():
    water = eos.make("tait", rho_0=1000.0, c_0=1500.0, gamma=7.0)
    # 1000 x 1500²/7 (1.1^7 - 1), and 1500 x 1.1³; 1.1^7 = 1.9487171
    assert water.pressure(1100.0, 0.0) == pytest.approx(304944782.142857, rel=1e-12)
    assert water.sound_speed(1100.0, 0.0) == pytest.approx(1996.5, rel=FEW_ROUNDINGS)


def test_mie_gruneisen_shock_of_flyer_plates():
    # both plates at 500 m/s: Us = 3600 + 1.8 x 500 = 4500, p = rho_0 Us v, rho = rho_0 Us/(Us - v)
    assert steel().pressure(8831.25, 1.25e5) == pytest.approx(1.76625e10, rel=FEW_ROUNDINGS)
    assert steel().internal_energy(8831.25, 1.76625e10) == pytest.approx(1.25e5, rel=1e-13)


@pytest.mark.parametrize("gruneisen", [0.5, 1.81, 4.0])
def test_mie_gruneisen_contains_its_hugoniot_curve(gruneisen):
    solid = eos.make("mie_gruneisen", **STEEL | {"gruneisen": gruneisen})
    jump = np.array([1e-3, 1.0, 100.0, 2000.0, 2e4])
    shock = 3600.0 + 1.8 * jump
    density = 7850.0 * shock / (shock - jump)
    pressure = solid.pressure(density, 0.5 * jump**2)
    # rho/rho_0 - 1 has roundings of 1e-16, which are 1e-9 of the jump 1e-3/3600
    np.testing.assert_allclose(pressure, 7850.0 * shock * jump, rtol=1e-9)


def test_mie_gruneisen_is_smooth_at_rest():
    below, above = 7850.0 * (1 - 1e-7), 7850.0 * (1 + 1e-7)
    at_rest = 7850.0 * 3600.0**2 * 1e-7
    # pressure is -K and +K times 1e-7, where the slope changes by a few parts in 1e7
    np.testing.assert_allclose(
        steel().pressure(np.array([below, above]), 0.0), [-at_rest, at_rest], rtol=1e-6
    )
    np.testing.assert_allclose(
        steel().sound_speed(np.array([below, above]), 0.0), 3600.0, rtol=1e-6
    )


def test_mie_gruneisen_is_nan_beyond_end_of_hugoniot_curve():
    end = 7850.0 / (1.0 - 1.0 / 1.8)
    solid = steel()
    assert np.isfinite(solid.pressure(0.999 * end, 0.0))
    beyond = np.array([1.001 * end, 3.0 * end])
    assert np.isnan(solid.pressure(beyond, 1e5)).all()
    assert np.isnan(solid.sound_speed(beyond, 1e12)).all()
    # without a slope the curve has no end
    assert np.isfinite(eos.make("mie_gruneisen", **STEEL | {"slope": 0.0}).pressure(1e6, 0.0))


@pytest.mark.parametrize("density", [6000.0, 8500.0])
def test_sound_of_mie_gruneisen_stops_at_lowest_energy(density):
    solid = steel()
    lowest = solid.lowest_energy(density)
    above, below = lowest + 1e-9 * abs(lowest), lowest - 1e-9 * abs(lowest)
    assert solid.sound_speed(density, solid.pressure(density, above)) >= 0.0
    assert np.isnan(solid.sound_speed(density, solid.pressure(density, below)))


@pytest.mark.parametrize("table", [
    '{ name = "tait", rho_0 = 1.0, c_0 = 1.0 }',
    '{ name = "mie_gruneisen", rho_0 = 1.0, c_0 = 1.0, slope = 1.5, gruneisen = 2.0 }',
])  # fmt: skip
def test_gas_formulation_refuses_equations_of_solids(table):
    text = f'[problem]\nname = "uniform"\n[physics]\neos = {table}\n'
    with pytest.raises(ConfigError, match=r'physics\.eos.*physics\.formulation = "continuum"'):
        config.from_text(text, "a test")
