"""Every kernel of the folder: normalised, compact, of its own slope, as in docs/equations.md."""

import math

import numpy as np
import pytest
from numba import njit

from sph import kernels, registry
from sph.compiled import COMPILED

DIMENSIONS = [1, 2, 3]
SPHERE = {1: 2.0, 2: 2 * math.pi, 3: 4 * math.pi}  # surface of the unit sphere


def variants(name):
    """The kernel of that name, and once more for each switch it has, thrown."""
    model = registry.model_class("sph.kernels", name)
    switches = [key for key, value in model._field_defaults.items() if value is False]
    return [model()] + [model(**{switch: True}) for switch in switches]


def label(kernel):
    """E.g. cubic_spline-flattened."""
    name = type(kernel).__module__.rsplit(".", 1)[-1]
    return "-".join([name, *(key for key, value in kernel._asdict().items() if value is True)])


KERNELS = [kernel for name in registry.names("sph.kernels") for kernel in variants(name)]
every_kernel = pytest.mark.parametrize("kernel", KERNELS, ids=label)
every_dimension = pytest.mark.parametrize("dimension", DIMENSIONS)


def quadrature():
    """Nodes and weights on [0, 1], exact for polynomials joined at halves and thirds."""
    nodes, weights = np.polynomial.legendre.leggauss(10)
    sixth = np.arange(6)[:, None]
    return ((nodes + 1) / 2 + sixth).ravel() / 6, np.tile(weights, 6) / 12


def test_common_kernels_are_available():
    assert {"wendland_c2", "cubic_spline"} <= set(registry.names("sph.kernels"))


@every_kernel
@every_dimension
def test_kernel_integral_is_one(kernel, dimension):
    q, weight = quadrature()
    dim = (0,) * dimension
    shells = SPHERE[dimension] * q ** (dimension - 1)
    integral = kernel.normalisation(dim) * np.sum(weight * shells * kernel.w(dim, q))
    # 1e-14: 60 positive terms that add up to 1, 2e-16 each
    assert integral == pytest.approx(1, abs=1e-14)


@every_kernel
@every_dimension
def test_slope_equals_derivative_of_kernel(kernel, dimension):
    dim, step = (0,) * dimension, 1e-6
    q = np.linspace(0.01, 1.1, 110) + 0.001  # off the joints of the pieces
    difference = (kernel.w(dim, q + step) - kernel.w(dim, q - step)) / (2 * step)
    # 1e-9: rounding of w of order one over the step, 1e-16/1e-6; step² w''' is less
    np.testing.assert_allclose(kernel.dw_over_q(dim, q) * q, difference, atol=1e-9)


@every_kernel
@every_dimension
def test_kernel_support_compact_and_slope_not_positive(kernel, dimension):
    dim = (0,) * dimension
    inside = np.append(1e-150, np.linspace(1e-3, 0.999, 1000))  # the passes keep r off zero
    beyond = np.array([1.0, 1.001, 2.0, 1e6])
    for function in (kernel.w, kernel.dw_over_q, kernel.force_over_q):
        assert not function(dim, beyond).any()
    assert np.all(kernel.w(dim, inside) > 0)
    # the passes tell a neighbour from a candidate by the sign of this
    assert np.all(kernel.force_over_q(dim, inside) < 0)
    assert np.all(kernel.dw_over_q(dim, inside) < 0)


@every_kernel
@every_dimension
def test_force_slope_equals_kernel_slope_unless_flattened(kernel, dimension):
    dim = (0,) * dimension
    flat = getattr(kernel, "flattened", False)
    q = np.linspace(1 / 3 + 1e-9 if flat else 0.001, 1.2, 100)
    # equal: the same formula of the same q
    np.testing.assert_array_equal(kernel.force_over_q(dim, q), kernel.dw_over_q(dim, q))


@every_dimension
def test_flattened_slope_constant_within_one_third(dimension):
    kernel, dim = kernels.make("cubic_spline", flattened=True), (0,) * dimension
    at_third = kernels.make("cubic_spline").dw_over_q(dim, np.array(1 / 3)) / 3
    # the least is what an inverse in single precision may have; the kernel has 0 for all below
    q = np.array([1e-29, 1e-8, 0.1, 0.3, 1 / 3 - 1e-12, 1 / 3 + 1e-12])
    # 1e-11: the slope's own change over 1e-12
    np.testing.assert_allclose(kernel.force_over_q(dim, q) * q, at_third, rtol=1e-11)
    assert np.isfinite(kernel.force_over_q(dim, np.array(0.0)))


@every_dimension
def test_wendland_c2_matches_eqs_11_to_14(dimension):
    kernel, dim, q = kernels.make("wendland_c2"), (0,) * dimension, np.linspace(0.001, 1, 50)
    C = {1: 5 / 4, 2: 7 / math.pi, 3: 21 / (2 * math.pi)}[dimension]
    if dimension == 1:
        value, slope = (1 - q) ** 3 * (1 + 3 * q), 3 * ((1 - q) ** 3 - (1 - q) ** 2 * (1 + 3 * q))
    else:
        value, slope = (1 - q) ** 4 * (1 + 4 * q), 4 * ((1 - q) ** 4 - (1 - q) ** 3 * (1 + 4 * q))
    # 1e-15: a few roundings of numbers of order one; the slopes of eqs 12 and 14 subtract such
    np.testing.assert_allclose(kernel.normalisation(dim) * kernel.w(dim, q), C * value, atol=4e-15)
    assert kernel.normalisation(dim) == C
    np.testing.assert_allclose(kernel.dw_over_q(dim, q) * q, slope, atol=4e-15)


@every_dimension
def test_cubic_spline_matches_eqs_115_and_116(dimension):
    kernel, dim, q = kernels.make("cubic_spline"), (0,) * dimension, np.linspace(0.001, 1, 50)
    C = {1: 4 / 3, 2: 40 / (7 * math.pi), 3: 8 / math.pi}[dimension]
    inner = q < 0.5
    value = np.where(inner, 1 - 6 * q**2 + 6 * q**3, 2 * (1 - q) ** 3)
    slope = np.where(inner, -12 * q + 18 * q**2, -6 * (1 - q) ** 2)
    assert kernel.normalisation(dim) == pytest.approx(C, rel=1e-15)  # one rounding
    np.testing.assert_allclose(kernel.w(dim, q), value, atol=4e-15)  # some roundings of order one
    np.testing.assert_allclose(kernel.dw_over_q(dim, q) * q, slope, atol=4e-15)


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("wendland_c2", (1.620185, 1.897367, 1.936492)),
        ("cubic_spline", (1.732051, 1.778002, 1.825742)),
    ],
)
def test_support_over_smoothing_length_matches_known_values(name, printed):
    found = [kernels.support_ratio(kernels.make(name), dimension) for dimension in DIMENSIONS]
    np.testing.assert_allclose(found, printed, rtol=0, atol=5e-7)  # half a unit of the last digit


@every_kernel
@every_dimension
def test_support_over_smoothing_length_follows_from_kernel(kernel, dimension):
    q, weight = quadrature()
    shells = weight * q ** (dimension - 1) * kernel.w((0,) * dimension, q)
    deviation = np.sqrt(np.sum(shells * q**2) / np.sum(shells) / dimension)
    # 1e-10: joints of the pieces elsewhere than at q = 1/2 cost the program's quadrature 5e-11
    assert kernels.support_ratio(kernel, dimension) == pytest.approx(0.5 / deviation, rel=1e-10)


@njit(**COMPILED)
def _compiled(kernel, dim, q):
    return (
        kernels.normalisation(kernel, dim),
        kernels.w(kernel, dim, q),
        kernels.dw_over_q(kernel, dim, q),
        kernels.force_over_q(kernel, dim, q),
    )


@every_kernel
def test_compiled_kernels_equal_python(kernel):
    dim = (0, 0)
    for q in (0.0, 0.2, 0.4, 0.6, 0.999, 1.0, 3.0):
        with_numpy = (
            kernel.normalisation(dim),
            *(f(dim, np.array(q)) for f in (kernel.w, kernel.dw_over_q, kernel.force_over_q)),
        )
        found = _compiled(kernel, dim, q)
        # some roundings of terms up to 12: fused multiply-adds round less often
        np.testing.assert_allclose(found, with_numpy, rtol=1e-14, atol=1e-14)


def test_unknown_kernel_is_named():
    with pytest.raises(KeyError, match=r"gauss.*cubic_spline.*wendland_c2"):
        kernels.make("gauss")
