"""Linear theory of shear layers: known growth rates, and the evolution by its own eigenvalues."""

import numpy as np
import pytest

from sph.exact import kelvin_helmholtz as kh
from sph.problems import kelvin_helmholtz_smooth as smooth

WAVENUMBER = 2.0 * np.pi / smooth.WAVELENGTH


def two_layers(n, period, width, mach=0.01, densities=(1.0, 1.0)):
    """Layers tanh(y/width) a quarter of the period from its ends; speeds of -1 and 1."""
    y = kh.points(period, n)
    inside = np.tanh((y - period / 4) / width) - np.tanh((y - 3 * period / 4) / width) - 1.0
    light, heavy = densities
    density = 0.5 * (light + heavy) + 0.5 * (heavy - light) * inside
    return kh.ShearLayer(period, inside, density, np.full(n, 1.0 / mach**2))


def published(n):
    """The layers of McNally et al. in a monatomic gas."""
    y = kh.points(1.0, n)
    velocity, density = (smooth._ramped(*ends, y) for ends in (smooth.SPEED, smooth.DENSITY))
    return kh.ShearLayer(1.0, velocity, density, np.full(n, 5.0 / 3.0 * smooth.PRESSURE))


@pytest.mark.slow
def test_growth_of_tanh_layer_matches_michalke():
    # Michalke (1964), J. Fluid Mech. 19, 543: the fastest growth of tanh(y), incompressible, is
    # 0.1897 at k = 0.4446. Here the Mach number is 0.01, which enters squared, and the two layers
    # are 20 apart.
    layer = two_layers(128, 40.0, 1.0)
    assert kh.growth_rate(layer, 0.4446) == pytest.approx(0.1897, abs=1e-4)
    for other in (0.40, 0.49):
        assert kh.growth_rate(layer, other) < kh.growth_rate(layer, 0.4446)
    assert kh.growth_rate(layer, 1.0) < 0.01  # k = 1 is neutral


def test_growth_falls_with_mach_number():
    assert kh.growth_rate(two_layers(96, 40.0, 1.0, mach=0.5), 0.4446) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("densities", [(1.0, 2.0), (1.0, 10.0)])
def test_growth_of_thin_layer_matches_vortex_sheet(densities):
    # the width enters at first order in k width, which two widths extrapolate away; what is left is
    # the square of the wider, 0.2^2, and the other layer half a period away, e^(-k/2) = 0.2 %
    k, period = 4.0 * np.pi, 1.0
    wide, thin = (
        kh.growth_rate(two_layers(128, period, width, densities=densities), k)
        for width in (0.016, 0.008)
    )
    sheet = kh.vortex_sheet(k, (-1.0, 1.0), densities)
    assert abs(thin / sheet - 1.0) < abs(wide / sheet - 1.0)
    assert 2.0 * thin - wide == pytest.approx(sheet, rel=0.042)


def test_vortex_sheet_growth_matches_by_hand():
    assert kh.vortex_sheet(3.0, (0.5, -0.5), (1.0, 2.0)) == pytest.approx(2.0**0.5, rel=1e-15)


@pytest.mark.slow
def test_growth_of_published_layers_converges():
    # their slope has kinks, so the order is near 2: each doubling leaves a quarter of the change
    coarse, middle, fine = (kh.growth_rate(published(n), WAVENUMBER) for n in (32, 64, 128))
    assert abs(fine - middle) < 0.4 * abs(middle - coarse)
    assert fine == pytest.approx(2.832, rel=0.002)  # the limit, from 192, 256 and 384 points


@pytest.mark.slow
def test_evolution_approaches_fastest_mode():
    layer = published(64)
    start = np.zeros((3, 64), dtype=complex)
    start[1] = 1.0
    late = kh.evolution(layer, WAVENUMBER, start, np.array([3.0, 4.0]))
    rate = np.log(np.abs(late[1]).sum() / np.abs(late[0]).sum())
    # the second mode of the two layers grows as fast but for e^(-k/2) = 0.2 %; what is left of the
    # start after a factor of e^8 is below that
    assert rate == pytest.approx(kh.growth_rate(layer, WAVENUMBER), rel=0.005)


def test_evolution_of_sound_at_rest_has_exact_frequency():
    # u, p of a wave along x in uniform gas: e^(-ikct), to the tolerance of the steps
    layer = kh.ShearLayer(1.0, np.zeros(8), np.full(8, 2.0), np.full(8, 2.0 * 9.0))
    start = np.zeros((3, 8), dtype=complex)
    start[0], start[2] = 1.0, 2.0 * 3.0
    times = np.array([0.0, 0.7])
    found = kh.evolution(layer, WAVENUMBER, start, times)
    np.testing.assert_allclose(found[1], np.exp(-1j * WAVENUMBER * 3.0 * 0.7) * start, atol=1e-4)
    assert kh.growth_rate(layer, WAVENUMBER) == pytest.approx(0.0, abs=1e-10)  # round-off


def test_evolution_at_start_equals_initial_state():
    start = np.ones((3, 8), dtype=complex)
    found = kh.evolution(two_layers(8, 1.0, 0.1), 1.0, start, np.array([0.0]))
    np.testing.assert_array_equal(found, start[None])


# --- the problem that is held against it ------------------------------------------------------


@pytest.mark.slow
def test_problem_theory_growth_matches_linear_theory():
    from sph.config import from_text

    config = from_text('[problem]\nname = "kelvin_helmholtz_smooth"\nn = 1024\n')
    problem, eos = config.problem, config.physics.eos_model()
    t = np.linspace(0.0, 1.5, 61)
    amplitude = problem.theory(eos, t)["mode_amplitude"]
    assert amplitude[0] == pytest.approx(0.01, rel=1e-12)
    assert amplitude[:20].min() < 0.009  # it is no eigenmode: it falls first
    found = problem.over_time(eos, {"t": t, "mode_amplitude": amplitude})
    assert found["growth_ratio"] == pytest.approx(1.0, rel=1e-5)  # the tolerance of the steps
    slower = problem.over_time(eos, {"t": t, "mode_amplitude": amplitude * np.exp(-t)})
    assert slower["growth_rate"] == pytest.approx(found["growth_rate"] - 1.0, rel=1e-5)
    assert slower["growth_error"] == pytest.approx(1.0 - slower["growth_ratio"], rel=1e-5)
    assert problem.over_time(eos, {"t": t[t < 0.9], "mode_amplitude": amplitude[t < 0.9]}) == {}
