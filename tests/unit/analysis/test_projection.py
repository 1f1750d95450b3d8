"""Projections: against the integral along the line of sight, mass that is kept, and weights."""

import numpy as np
import pytest
from test_interpolate import KERNEL, gas, random_gas, unit_domain

from sph import kernels
from sph.analysis.interpolate import Plane
from sph.analysis.projection import along_sight, columns_of_kernel

WHOLE = np.tile([0.0, 1.0], (3, 1))


def columns(particles, domain, plane):
    return along_sight(np.zeros((0, particles.number)), particles, domain, KERNEL, plane)[1]


@pytest.mark.parametrize("name", ["wendland_c2", "cubic_spline", "quintic_spline"])
def test_columns_of_kernel_hold_its_mass(name):
    table = columns_of_kernel(kernels.make(name))
    q = np.linspace(0.0, 1.0, table.size)
    # the trapezoidal rule on 1000 intervals: second order
    assert np.trapezoid(2.0 * np.pi * q * table, q) == pytest.approx(1.0, abs=2e-6)
    assert table[-1] == 0.0


@pytest.mark.parametrize("third", [0, 1, 2])
def test_column_is_the_integral_along_the_line_of_sight(third):
    """Of one particle, from values on many slices across the axis."""
    position = np.array([[0.4], [0.5], [0.6]])
    particles = gas(position, np.array([0.3]))
    axes = tuple(axis for axis in range(3) if axis != third)
    plane = Plane.through_centre(WHOLE, 9, axes)._replace(height=None)
    found = columns(particles, unit_domain(3, "open"), plane)
    x, y = np.meshgrid(*[(np.arange(9) + 0.5) / 9] * 2)
    z = np.linspace(0.0, 1.0, 2001)
    expected = np.zeros((9, 9))
    for index in np.ndindex(9, 9):
        point = np.empty((3, z.size))
        point[axes[0]], point[axes[1]], point[third] = x[index], y[index], z
        q = np.linalg.norm(point - position, axis=0) / 0.3
        density = kernels.normalisation(KERNEL, (0,) * 3) / 0.3**3 * KERNEL.w((0,) * 3, q)
        expected[index] = particles.mass[0] * np.trapezoid(density, z)
    # quadratures of both sides: the kernel is smooth, and the spacing is 1/600 of it
    np.testing.assert_allclose(found, expected, atol=1e-5 * expected.max())


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("third", [0, 2])
def test_projection_of_closed_box_has_its_mass(boundary, third):
    """Images along the line of sight would count the mass at its ends twice."""
    particles = random_gas(3)
    axes = tuple(axis for axis in range(3) if axis != third)
    plane = Plane.through_centre(WHOLE, 64, axes)._replace(height=None)
    found = columns(particles, unit_domain(3, boundary), plane)
    # the sum over pixels, a fifteenth of H, is a quadrature of second order or better
    assert found.mean() == pytest.approx(particles.mass.sum(), rel=1e-3)


def test_particles_smaller_than_pixels_keep_their_mass():
    particles = random_gas(3)
    particles.support[:] = 1e-3
    plane = Plane.through_centre(WHOLE, 16)._replace(height=None)
    found = columns(particles, unit_domain(3, "periodic"), plane)
    # 150 kernels, each as wide as a pixel: sums over few pixels, which scatter by a third each
    assert found.mean() == pytest.approx(particles.mass.sum(), rel=0.1)


def test_mean_is_weighted_by_mass():
    """Two particles behind each other, three times as heavy behind."""
    particles = gas(np.array([[0.5, 0.5], [0.5, 0.5], [0.2, 0.8]]), np.array([0.2, 0.2]))
    particles.mass[:] = 1.0, 3.0
    particles.density[:] = 1.0, 100.0  # matters not
    plane = Plane.through_centre(WHOLE, 8)._replace(height=None)
    (found,), column = along_sight(
        np.array([[1.0, 2.0]]), particles, unit_domain(3, "open"), KERNEL, plane
    )
    assert np.isfinite(found).any()
    np.testing.assert_allclose(found[column > 0.0], 1.75, rtol=1e-12)
    assert np.isnan(found[column == 0.0]).all()
