"""Interpolation onto pixels against sums written out, and on fields that it must reproduce."""

import numpy as np
import pytest
from states import gas_state

from sph import kernels
from sph.analysis.interpolate import Plane, at_points, onto_plane
from sph.domain import Domain
from sph.state import State

KERNEL = kernels.make("wendland_c2")
# Sums of some hundred positive terms, in any order.
ROUND_OFF = 1e-12


def gas(position, support, seed=0) -> State:
    """Particles of random mass and density at (D, N) `position`."""
    random = np.random.default_rng(seed)
    n = position.shape[1]
    particles = gas_state(position, np.zeros_like(position), 1.0 + random.random(n), np.ones(n))
    particles.density[:] = 1.0 + random.random(n)
    particles.support[:] = support
    return particles


def random_gas(dimension, n=150, seed=0) -> State:
    """In the unit box, with supports that vary by a factor 2."""
    random = np.random.default_rng(seed)
    return gas(random.random((dimension, n)), 0.2 + 0.2 * random.random(n), seed)


def unit_domain(dimension, boundary) -> Domain:
    return Domain(np.tile([0.0, 1.0], (dimension, 1)), (boundary,) * dimension)


def lattice(spacing, dimension=2) -> np.ndarray:
    ticks = np.arange(spacing / 2, 1.0, spacing)
    return np.stack([axis.ravel() for axis in np.meshgrid(*[ticks] * dimension)])


def pixel_centres(plane) -> tuple[np.ndarray, np.ndarray]:
    """(ny, nx) x and y."""
    (left, right, bottom, top), (nx, ny) = plane.extent, plane.shape
    x = left + (np.arange(nx) + 0.5) * (right - left) / nx
    y = bottom + (np.arange(ny) + 0.5) * (top - bottom) / ny
    return np.meshgrid(x, y)


def written_out(values, particles, separation, kernel, plane) -> np.ndarray:
    """The formula, pixel by pixel; `separation(x, x_j)` gives those of a particle's images."""
    dim = (0,) * particles.dimension
    volume = particles.mass / particles.density
    C = kernels.normalisation(kernel, dim)
    x, y = pixel_centres(plane)
    result = np.empty(x.shape)
    for index in np.ndindex(x.shape):
        point = [x[index], y[index], plane.height][: particles.dimension]
        top = bottom = 0.0
        for j in range(particles.number):
            H = particles.support[j]
            for difference in separation(np.array(point), particles.position[:, j]):
                q = np.linalg.norm(difference) / H
                share = volume[j] * C * H**-particles.dimension * kernel.w(dim, q)
                top, bottom = top + values[j] * share, bottom + share
        result[index] = top / bottom if bottom > 0.0 else np.nan
    return result


def nearest_image(point, x_j):
    difference = point - x_j
    return [difference - np.round(difference)]


def all_reflections(point, x_j):
    """Of a unit box between walls, on every axis alone and together."""
    choices = [(x, -x, 2.0 - x) for x in x_j]
    return [
        point - np.array(image) for image in np.array(np.meshgrid(*choices)).reshape(len(x_j), -1).T
    ]


def itself(point, x_j):
    return [point - x_j]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    ("boundary", "separation"),
    [("periodic", nearest_image), ("mirror", all_reflections), ("open", itself)],
)
def test_interpolation_equals_explicit_sum(dimension, boundary, separation):
    particles = random_gas(dimension, n=40)
    values = np.random.default_rng(5).normal(size=40)
    domain = unit_domain(dimension, boundary)
    plane = Plane.through_centre(domain.box, 6)
    (found,) = onto_plane(values[None], particles, domain, KERNEL, plane)
    expected = written_out(values, particles, separation, KERNEL, plane)
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("boundary", ["periodic", "mirror", "open"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_interpolation_pixels_equal_points(dimension, boundary):
    particles, domain = random_gas(dimension, n=40), unit_domain(dimension, boundary)
    values = np.random.default_rng(5).normal(size=(2, 40))
    plane = Plane.through_centre(domain.box, 6)
    x, y = (centres.ravel() for centres in pixel_centres(plane))
    points = np.stack([x, y, np.full(x.size, plane.height)][:dimension])
    found, _ = at_points(values, particles.velocity, particles, domain, KERNEL, points)
    expected = onto_plane(values, particles, domain, KERNEL, plane).reshape(2, -1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF)


def test_interpolation_uses_given_kernel():
    particles, spline = random_gas(2, n=40), kernels.make("cubic_spline")
    values = np.random.default_rng(5).normal(size=40)
    plane = Plane(np.array([0.2, 0.3]), np.array([0.8, 0.6]), (5, 4))
    (found,) = onto_plane(values[None], particles, unit_domain(2, "open"), spline, plane)
    expected = written_out(values, particles, itself, spline, plane)
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("boundary", ["periodic", "mirror", "open"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_interpolation_constant_field_is_exact(dimension, boundary):
    particles = random_gas(dimension)
    domain = unit_domain(dimension, boundary)
    plane = Plane.through_centre(domain.box, 32)
    (found,) = onto_plane(np.full((1, 150), 3.7), particles, domain, KERNEL, plane)
    covered = np.isfinite(found)
    assert covered.mean() > 0.9
    # numerator and denominator are the same sum but for a factor
    np.testing.assert_allclose(found[covered], 3.7, rtol=ROUND_OFF)


def test_interpolation_linear_field_on_lattice_is_exact():
    # The mean of x_j over a kernel differs from x by the lattice's lack of symmetry about x alone.
    # With H of three spacings the sum differs from the integral by some 1e-3 of a spacing.
    spacing = 1.0 / 20
    particles = gas(lattice(spacing), 3.0 * spacing)
    particles.mass[:] = particles.density[:] = 1.0
    values = particles.position[0] - 2.0 * particles.position[1]
    plane = Plane(np.array([0.3, 0.3]), np.array([0.7, 0.7]), (24, 24))  # farther than H from edges
    (found,) = onto_plane(values[None], particles, unit_domain(2, "open"), KERNEL, plane)
    x, y = pixel_centres(plane)
    worst = np.abs(found - (x - 2.0 * y)).max()
    assert worst < 0.02 * np.sqrt(5.0) * spacing


def test_slice_shows_values_at_its_height():
    # as above: a field of z alone is constant on the slice but for the lattice's asymmetry
    spacing = 1.0 / 12
    particles = gas(lattice(spacing, 3), 3.0 * spacing)
    particles.mass[:] = particles.density[:] = 1.0
    plane = Plane(np.array([0.3, 0.3]), np.array([0.7, 0.7]), (8, 8), height=0.44)
    values = particles.position[2][None]
    (found,) = onto_plane(values, particles, unit_domain(3, "open"), KERNEL, plane)
    np.testing.assert_allclose(found, 0.44, atol=0.02 * spacing)


def test_map_periodic_follows_gas_across_face():
    particles = random_gas(2, seed=3)
    domain, values = unit_domain(2, "periodic"), np.random.default_rng(4).normal(size=(1, 150))
    plane = Plane.through_centre(domain.box, 32)
    before = onto_plane(values, particles, domain, KERNEL, plane)[0]
    particles.position[0] += 0.25
    domain.bring_inside(particles.position, [])
    after = onto_plane(values, particles, domain, KERNEL, plane)[0]
    # a quarter of the box is 8 pixels; positions have moved by round-off at most, and the kernel
    # with its weights is smooth
    np.testing.assert_allclose(after, np.roll(before, 8, axis=1), atol=1e-9)


def test_map_vacuum_is_nan():
    particles = gas(np.array([[0.25], [0.5]]), 0.2)
    plane = Plane(np.zeros(2), np.ones(2), (20, 20))
    (found,) = onto_plane(np.array([[2.0]]), particles, unit_domain(2, "open"), KERNEL, plane)
    x, y = pixel_centres(plane)
    inside = np.hypot(x - 0.25, y - 0.5) < 0.2
    np.testing.assert_array_equal(np.isfinite(found), inside)
    np.testing.assert_allclose(found[inside], 2.0, rtol=ROUND_OFF)


def test_interpolation_of_several_fields_equals_one_by_one():
    particles, domain = random_gas(2), unit_domain(2, "periodic")
    values = np.random.default_rng(6).normal(size=(3, 150))
    plane = Plane.through_centre(domain.box, 16)
    together = onto_plane(values, particles, domain, KERNEL, plane)
    for f in range(3):
        alone = onto_plane(values[f : f + 1], particles, domain, KERNEL, plane)[0]
        # the compiler may order the sums of three fields differently from those of one
        np.testing.assert_allclose(together[f], alone, atol=ROUND_OFF)


def test_plane_has_square_pixels_and_central_slice():
    plane = Plane.through_centre(np.array([[-1.0, 1.0], [0.0, 0.5], [2.0, 5.0]]), 64)
    assert plane.shape == (64, 16)
    assert plane.height == 3.5
    assert plane.extent == (-1.0, 1.0, 0.0, 0.5)
