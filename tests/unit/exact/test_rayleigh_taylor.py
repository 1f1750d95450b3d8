"""Linear theory of stratified gas: known growth rates, and an integration along y."""

import numpy as np
import pytest

from sph.exact import rayleigh_taylor as rt

K, G = 4.0 * np.pi, 0.5
STIFF = 1e6  # sound crosses a layer in 1e-3 of the growth time, which enters squared


def layers(n, density, stiffness=lambda y: np.full(y.size, STIFF), depth=0.5):
    faces = np.linspace(-depth, depth, n + 1)
    y = 0.5 * (faces[1:] + faces[:-1])
    return rt.Layers(faces, density(y), stiffness(y))


def step(below, above):
    return lambda y: np.where(y < 0.0, below, above)


@pytest.mark.parametrize("densities", [(1.0, 2.0), (1.0, 10.0)])
@pytest.mark.parametrize("depth", [0.5, 0.05])
def test_growth_of_sharp_interface_matches_two_layers(densities, depth):
    found = rt.fastest_mode(layers(128, step(*densities), depth=depth), K, G)
    # second order in k times the width of a cell: (0.1)^2/12
    assert found.rate == pytest.approx(rt.two_layers(K, G, densities, depth), rel=1e-3)


def test_growth_of_deep_layers_matches_by_hand():
    # A = 1/3 and tanh(k depth) = 1 - e^(-2 k depth) = 1 - 7e-6
    assert rt.two_layers(6.0, 0.5, (1.0, 2.0), 1.0) == pytest.approx(1.0, rel=1e-5)


def test_growth_of_exponential_density_matches_rayleigh():
    # (R v')' = k^2 (1 - g/(s^2 L)) R v has v = e^(-y/2L) cos(pi y) for R = e^(y/L)
    length = 0.3
    found = rt.fastest_mode(layers(128, lambda y: np.exp(y / length)), K, G)
    exact = np.sqrt(G / length * K**2 / (K**2 + np.pi**2 + 0.25 / length**2))
    assert found.rate == pytest.approx(exact, rel=1e-4)
    y = np.linspace(-0.5, 0.5, 129)
    shape = np.exp(-0.5 * y / length) * np.cos(np.pi * y)
    np.testing.assert_allclose(found.upward, shape / shape.max(), atol=2e-3)


def test_density_that_falls_upward_does_not_grow():
    assert rt.fastest_mode(layers(64, lambda y: np.exp(-y)), K, G).rate == 0.0


def test_growth_of_light_gas_on_heavy_gas_is_convection():
    # uniform gas has entropy that falls upward, and grows at up to g/c
    found = rt.fastest_mode(layers(64, step(2.0, 1.0), lambda y: np.full(y.size, 100.0)), K, G)
    assert 0.0 < found.rate < G / np.sqrt(100.0 / 2.0)


def smooth(y):
    return 1.0 + 1.0 / (1.0 + np.exp(-y / 0.05))


def soft(y):
    """gamma P of that gas: the speed of sound is near 1."""
    extra = 0.05 * (np.logaddexp(0.0, y / 0.05) - np.log(2.0))
    return 1.4 * (10.0 / 7.0 - G * (y + extra))


def test_compressible_mode_solves_equations_along_y():
    """From the wall below, v' and q' of the linearised equations (q = s p) reach v = 0 above."""
    from scipy.integrate import solve_ivp

    mode = rt.fastest_mode(layers(256, smooth, soft), K, G)
    rigid = rt.fastest_mode(layers(256, smooth), K, G)
    assert mode.rate > 1.03 * rigid.rate  # the test is of compression

    def slopes(y, state, s):
        v, q = state
        density, stiffness = smooth(np.array([y]))[0], soft(np.array([y]))[0]
        share = (density - 1.0) * (2.0 - density)
        squared = stiffness / density
        strain = (G * v - q * (s**2 + squared * K**2) / (s**2 * density)) / squared
        weight = G * share / 0.05 + density * G**2 / squared - s**2 * density
        return strain, weight * v - G / squared * q

    def at_top(s):
        found = solve_ivp(slopes, (-0.5, 0.5), (0.0, 1e-3), args=(s,), rtol=1e-8, atol=1e-12)
        return found.y[0, -1] / np.abs(found.y[0]).max()

    # v at the wall changes sign within the error of the mode, some (k dy)^2/12 = 2e-4
    assert at_top(mode.rate * 0.9995) * at_top(mode.rate * 1.0005) < 0.0


def test_mode_converges_at_second_order():
    rates = [rt.fastest_mode(layers(n, smooth, soft), K, G).rate for n in (32, 64, 128)]
    # a quarter with each doubling, less 5 % for the next order
    assert (rates[0] - rates[1]) / (rates[1] - rates[2]) == pytest.approx(4.0, rel=0.05)


def test_mode_of_rigid_gas_has_no_divergence_and_stops_at_walls():
    mode = rt.fastest_mode(layers(64, smooth), K, G)
    divergence = K * mode.across + np.diff(mode.upward) * 64.0
    assert np.abs(divergence).max() < 1e-4  # of k, by the ratio of g R/k to the stiffness
    assert mode.upward[0] == mode.upward[-1] == 0.0
    assert mode.upward.max() == 1.0
