"""Equations of state, viscosities, conductivity: formulas by hand, and in compiled code."""

import numpy as np
import pytest
from numba import njit

from sph import eos, registry
from sph.compiled import COMPILED
from sph.formulations.gas import terms
from sph.parts.conductivity._contacts import share
from sph.parts.viscosity import balsara, constant
from sph.parts.viscosity._shocks import alpha_after
from sph.parts.viscosity.switches import cullen_dehnen, morris_monaghan

FEW_ROUNDINGS = 1e-14  # of some operations at 1e-16 each
DENSITY, ENERGY = np.array([0.125, 1.0, 4.0]), np.array([2.0, 0.5, 1e-12])


def test_ideal_gas_matches_by_hand():
    gas = eos.make("ideal_gas", gamma=1.4)
    # Sod's two states: u = 2.5 and 2 give P = 1 and 0.1; c² = 1.4 P / rho
    np.testing.assert_allclose(gas.pressure(np.array([1, 0.125]), np.array([2.5, 2])), [1, 0.1])
    np.testing.assert_allclose(
        gas.sound_speed(np.array([1, 0.125]), np.array([1, 0.1])) ** 2, [1.4, 1.12]
    )


def test_stiffened_gas_matches_by_hand():
    water = eos.make("stiffened_gas", gamma=4.4, p_inf=6e8)
    # u = (1e5 + 4.4 x 6e8)/(3.4 x 1000); c² = 4.4 x 6.001e8/1000
    assert water.internal_energy(1000.0, 1e5) == pytest.approx(776500.0, rel=FEW_ROUNDINGS)
    # a difference of numbers of 2.64e9, each a few roundings of 1e-16 off
    assert water.pressure(1000.0, 776500.0) == pytest.approx(1e5, abs=1e-6)
    assert water.sound_speed(1000.0, 1e5) ** 2 == pytest.approx(2640440.0, rel=FEW_ROUNDINGS)
    # at the lowest energy P = -p_inf, where sound stops
    assert water.pressure(800.0, water.lowest_energy(800.0)) == pytest.approx(-6e8, abs=1e-5)


def test_equations_of_state_with_exact_solutions():
    gas = eos.make("ideal_gas", gamma=1.4)
    assert eos.is_ideal(gas)
    assert eos.is_gamma_law(gas)
    water = eos.make("stiffened_gas", gamma=4.4, p_inf=6e8)
    assert eos.is_gamma_law(water)
    assert not eos.is_ideal(water)
    assert eos.is_ideal(eos.make("stiffened_gas", gamma=1.4, p_inf=0.0))
    assert not eos.is_gamma_law(object())


# Parameters, and u: cold gas where u = 0 is cold; elsewhere a sum would lose such a u
PARAMETERS = {
    "ideal_gas": ({"gamma": 5 / 3}, ENERGY),
    "stiffened_gas": ({"gamma": 4.4, "p_inf": 0.3}, np.array([3.0, 1.0, 0.2])),
    # densities below, at and above rho_0; the largest is below the end of the Hugoniot curve
    "mie_gruneisen": (
        {"rho_0": 2.0, "c_0": 1.5, "slope": 1.4, "gruneisen": 2.0}, np.array([3.0, 1.0, 0.2])
    ),
    "tait": ({"rho_0": 1.0, "c_0": 1.5, "gamma": 2.0}, np.zeros(3)),  # u does not enter
}  # fmt: skip


@pytest.mark.parametrize("name", registry.names("sph.eos"))
def test_energy_inverts_pressure_and_sound_speed_is_consistent(name):
    parameters, energy = PARAMETERS[name]
    gas = eos.make(name, **parameters)
    pressure = gas.pressure(DENSITY, energy)
    np.testing.assert_allclose(gas.internal_energy(DENSITY, pressure), energy, rtol=FEW_ROUNDINGS)
    # c² = dP/drho along du = P drho / rho²; the difference is off by step² and 1e-16/step
    step = 1e-5 * DENSITY
    change = [gas.pressure(DENSITY + s, energy + pressure * s / DENSITY**2) for s in (step, -step)]
    np.testing.assert_allclose(
        gas.sound_speed(DENSITY, pressure) ** 2, (change[0] - change[1]) / (2 * step), rtol=1e-8
    )


def test_constant_alpha_is_one_number():
    model = constant.ConstantAlpha(1.5)
    assert not model.evolves
    assert model.start() == model.pair_alpha(0.0, 9.0) == 1.5


def test_alpha_morris_monaghan_rises_in_compression_and_decays():
    model = morris_monaghan.MorrisMonaghan(0.1, 2.1)
    assert model.evolves
    assert model.start() == 0.1
    assert model.pair_alpha(1.0, 2.0) == 1.5
    alpha, h, sound = np.array([0.1, 1.1, 1.1, 2.1]), 0.2, 4.0
    rate = model.alpha_rate(alpha, h, sound, np.array([-3.0, -3.0, 3.0, -3.0]))
    # by hand: source 3 (2.1 - alpha) where it converges, decay (alpha - 0.1) * 0.25 * 4 / 0.2
    np.testing.assert_allclose(rate, [6, 3 - 5, -5, -10], rtol=FEW_ROUNDINGS)


def test_alpha_cullen_dehnen_jumps_up_and_decays_exactly():
    model = cullen_dehnen.CullenDehnen(0.1, 2.0, ell=0.05)
    assert model.evolves
    assert model.start() == 0.1
    assert model.pair_alpha(1.0, 2.0) == 1.5
    # by hand, with H = 0.5 and v_sig = 2: H^2 A = 4 for a limiter of 1/2 is half of max; the
    # limiter is 1/2 where (2 (1 - R)^4 div)^2 = shear, here (2 (1/2)^4 4)^2 = 1/4
    found = [
        model.alpha_after(alpha, 3.0, 0.5, 2.0, 4.0, rate, shear, 0.5)
        for alpha, rate, shear in [(0.3, -32.0, 0.25), (1.5, -32.0, 0.25), (1.5, 32.0, 0.25)]
    ]
    decay = np.exp(-3.0 * 2 * 0.05 * 2.0 / 0.5)  # dt / tau
    np.testing.assert_allclose(
        found, [1.0, 1.0 + 0.5 * decay, 0.1 + 1.4 * decay], rtol=FEW_ROUNDINGS
    )
    # at rest there is no shock
    assert model.alpha_after(0.1, 1.0, 0.5, 2.0, 0.0, -1.0, 0.0, 0.0) == 0.1


def test_balsara_distinguishes_compression_from_shear():
    model = balsara.Balsara()
    # by hand: |div| / (|div| + curl + 1e-4 c/H), c/H = 20 where it counts
    np.testing.assert_allclose(
        model.balsara_factor(
            np.array([-1.0, 1.0, 0.0, 1.0]), np.array([0.0, 3.0, 5.0, 0.0]), 4.0, 0.2
        ),
        [1 / 1.002, 1 / 4.002, 0, 1 / 1.002],
        rtol=FEW_ROUNDINGS,
    )


@njit(**COMPILED)
def _shares(h, laplacian, energy, signal_speed):
    return share(h, laplacian, energy, signal_speed)


def test_switched_conductivity_acts_where_energy_is_curved():
    # by hand: h^2 |lap u| / (v_sig sqrt(u)) = 0.04 * 30 / (2 * 1.5), and all of it at most
    for laplacian, expected in [(30.0, 0.4), (-30.0, 0.4), (0.0, 0.0), (300.0, 1.0)]:
        assert _shares(0.2, laplacian, 2.25, 2.0) == pytest.approx(expected, rel=FEW_ROUNDINGS)
    # cold gas: none where it is all cold, all beside what is hot
    assert _shares(0.2, 0.0, 0.0, 0.0) == 0.0
    assert _shares(0.2, 1.0, 0.0, 0.0) == 1.0


@njit(**COMPILED)
def _compiled(gas, model, limiter, density, energy, alpha, divergence):
    P = eos.pressure(gas, density, energy)
    c = eos.sound_speed(gas, density, P)
    return (
        P,
        c,
        terms.pair_alpha(model, alpha, 2.0 * alpha),
        terms.alpha_rate(model, alpha, 0.2, c, divergence),
        terms.balsara_factor(limiter, divergence, 0.7, c, 0.2),
    )


@njit(**COMPILED)
def _compiled_shock(model, alpha, dt, support, signal_speed, divergence, rate, shear, signs):
    return alpha_after(model, alpha, dt, support, signal_speed, divergence, rate, shear, signs)


def test_compiled_models_equal_python():
    gas, model, limiter = (
        eos.make("ideal_gas", gamma=1.4),
        morris_monaghan.MorrisMonaghan(0.1, 2.0),
        balsara.Balsara(),
    )
    shocked = (0.4, 0.1, 0.5, 2.0, -1.0, -3.0, 0.7, -0.2)
    switch = cullen_dehnen.CullenDehnen(0.1, 2.0)
    assert _compiled_shock(switch, *shocked) == pytest.approx(switch.alpha_after(*shocked))
    for divergence in (-3.0, 3.0):
        P = gas.pressure(2.0, 0.3)
        c = gas.sound_speed(2.0, P)
        expected = (
            P,
            c,
            model.pair_alpha(0.4, 0.8),
            model.alpha_rate(0.4, 0.2, c, divergence),
            limiter.balsara_factor(divergence, 0.7, c, 0.2),
        )
        found = _compiled(gas, model, limiter, 2.0, 0.3, 0.4, divergence)
        np.testing.assert_allclose(found, expected, rtol=FEW_ROUNDINGS)
