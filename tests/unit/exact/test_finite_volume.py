"""The finite-volume code against exact solutions: orders, walls, conservation."""

import numpy as np
import pytest

from sph.eos.ideal_gas import IdealGas
from sph.eos.stiffened_gas import StiffenedGas
from sph.exact import riemann
from sph.exact.finite_volume import Cells, evolve

AIR = IdealGas(1.4)
SOD = riemann.State(1.0, 0.0, 1.0), riemann.State(0.125, 0.0, 0.1)


def tube(left, right, n, low=-0.5, high=0.5):
    faces = np.linspace(low, high, n + 1)
    is_left = 0.5 * (faces[1:] + faces[:-1]) < 0.0
    return Cells(faces, *(np.where(is_left, *pair) for pair in zip(left, right, strict=True)))


def errors(states, eos, time, n):
    """Relative L1 errors of density and pressure at points of the tube."""
    x = np.linspace(-0.45, 0.45, 20001)
    found = evolve(tube(*states, n), eos, time, (False, False)).at(x)
    exact = riemann.solve(*states, eos, x / time)
    return [np.abs(found[k] - exact[k]).mean() / np.abs(exact[k]).mean() for k in (0, 2)]


def order(numbers, error):
    return -np.polyfit(np.log(numbers), np.log(error), 1)[0]


def test_sod_converges_at_first_order():
    numbers = [100, 200, 400, 800]
    by_n = np.array([errors(SOD, AIR, 0.2, n) for n in numbers])
    # a shock allows first order; 1.02 and 1.00 were measured, and 0.0014 for density at 800
    assert order(numbers, by_n[:, 0]) > 0.9
    assert order(numbers, by_n[:, 1]) > 0.9
    assert by_n[-1].max() < 0.003


def test_stiffened_gas_matches_exact_solution():
    water = StiffenedGas(4.4, 6e8)
    states = riemann.State(1000.0, 0.0, 1e9), riemann.State(1000.0, 0.0, 1e5)
    coarse, fine = (errors(states, water, 1.2e-4, n) for n in (100, 400))
    # first order: a quarter, with room for where the shock lies within a cell
    assert fine[0] < 0.4 * coarse[0] < 0.002
    assert fine[1] < 0.4 * coarse[1] < 0.02


def test_sound_between_walls_converges_at_second_order():
    numbers, amplitude, time = [25, 50, 100], 1e-6, 1.1
    error = []
    for n in numbers:
        faces = np.linspace(0.0, 1.0, n + 1)
        mode = np.diff(np.sin(np.pi * faces)) / np.diff(np.pi * faces)  # means over cells
        cells = Cells(faces, 1.0 + amplitude * mode, np.zeros(n), 1.0 + 1.4 * amplitude * mode)
        found = evolve(cells, AIR, time, (True, True))
        expected = amplitude * mode * np.cos(np.pi * np.sqrt(1.4) * time)
        # exact for small amplitudes: the next order is a millionth of this
        error.append(np.abs(found.density - 1.0 - expected).mean() / amplitude)
    assert order(numbers, error) > 1.8
    assert error[-1] < 1e-4


def test_walls_conserve_mass_and_energy():
    start = tube(riemann.State(1.0, 0.0, 1000.0), riemann.State(1.0, 0.0, 0.01), 200)
    end = evolve(start, AIR, 0.05, (True, True))  # the shock has been reflected

    def held(cells):
        mass = np.diff(cells.faces) * cells.density
        heat = AIR.internal_energy(cells.density, cells.pressure)
        return mass.sum(), (mass * (heat + 0.5 * cells.velocity**2)).sum()

    np.testing.assert_allclose(held(end), held(start), rtol=1e-12)  # round-off of 2000 steps
    assert end.faces[[0, -1]] == pytest.approx([-0.5, 0.5], abs=1e-14)
    assert end.pressure.min() > 0.0


def test_contact_at_rest_stays_sharp():
    start = tube(riemann.State(4.0, 3.0, 1.0), riemann.State(1.0, 3.0, 1.0), 50)
    end = evolve(start, AIR, 2.0, (False, False))
    # nothing moves within the gas: round-off
    np.testing.assert_allclose(end.density, start.density, rtol=1e-12)
    np.testing.assert_allclose(end.faces, start.faces + 6.0, rtol=1e-12)


def test_zero_pressure_is_refused():
    with pytest.raises(ValueError, match="expected positive"):
        evolve(tube(SOD[0], riemann.State(1.0, 0.0, 0.0), 10), AIR, 0.1, (True, True))
