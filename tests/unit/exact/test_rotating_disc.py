"""A rotating disc: equilibrium, the free rim, and Hooke's law in plane strain."""

import numpy as np

from sph.exact.plate import Material
from sph.exact.rotating_disc import Disc

STEEL = Material(7850.0, 7850.0 * 3600.0**2, 8e10)
DISC = Disc(0.1, 3000.0, STEEL)


def test_stress_balances_centrifugal_force():
    r, h = np.linspace(0.01, 0.09, 9), 1e-6
    slope = (DISC.stresses(r + h)[0] - DISC.stresses(r - h)[0]) / (2.0 * h)
    radial, azimuthal, _ = DISC.stresses(r)
    force = STEEL.density * DISC.spin**2 * r
    np.testing.assert_allclose(slope + (radial - azimuthal) / r, -force, rtol=1e-6)


def test_rim_is_free_and_centre_isotropic():
    assert abs(DISC.stresses(np.array([0.1]))[0][0]) < 1e-9 * DISC.central_stress
    radial, azimuthal, _ = DISC.stresses(np.zeros(1))
    assert radial == azimuthal == DISC.central_stress


def test_stretch_and_stress_obey_hookes_law():
    r, h = np.linspace(0.01, 0.09, 9), 1e-6
    u = lambda r: r * DISC.stretch(r)  # noqa: E731
    strain = np.array([(u(r + h) - u(r - h)) / (2.0 * h), DISC.stretch(r), np.zeros(9)])
    trace = strain.sum(axis=0)
    expected = STEEL.bulk * trace + 2.0 * STEEL.shear * (strain - trace / 3.0)
    np.testing.assert_allclose(DISC.stresses(r), expected, rtol=1e-6)
    np.testing.assert_allclose(DISC.pressure(r), -STEEL.bulk * trace, rtol=1e-6)


def test_deviator_has_principal_axes_along_radius():
    angle = np.linspace(0.0, 6.0, 7)
    offset = 0.07 * np.array([np.cos(angle), np.sin(angle)])
    S = DISC.deviator(offset)
    radial, azimuthal, axial = (each[0] for each in DISC.stresses(np.array([0.07])))
    mean = (radial + azimuthal + axial) / 3.0
    outward = offset / 0.07
    np.testing.assert_allclose(
        np.einsum("abn,bn->an", S, outward), (radial - mean) * outward, rtol=1e-12, atol=1e-3
    )
    np.testing.assert_allclose(S[0, 0] + S[1, 1], radial + azimuthal - 2 * mean, rtol=1e-9)
    np.testing.assert_allclose(DISC.deviator(np.zeros((2, 1)))[0, 1], 0.0, atol=1e-3)
