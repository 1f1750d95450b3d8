"""Period of a plate: formula, linear elasticity, and the limits in which they must agree."""

import math

import numpy as np
import pytest

from sph.exact import plate
from sph.exact.plate import Material

RUBBER = Material(1000.0, 2e6 / (3.0 * (1.0 - 2.0 * 0.3975)), 2e6 / (2.0 * 1.3975))


def test_constants_of_material():
    assert RUBBER.youngs == pytest.approx(2e6, rel=1e-12)
    assert RUBBER.poisson == pytest.approx(0.3975, rel=1e-12)


def test_first_root():
    k = plate.FIRST_ROOT
    assert math.cos(k) * math.cosh(k) == pytest.approx(-1.0, abs=1e-14)


def test_shape_meets_boundary_conditions():
    x = np.array([-0.1, 0.0, 1.0])
    deflection, slope = plate.shape(x)
    np.testing.assert_allclose(deflection, [0.0, 0.0, 1.0], atol=1e-14)
    np.testing.assert_allclose(slope[:2], 0.0, atol=1e-14)
    h = 1e-4
    near = 1.0 - h * np.arange(4)
    w = plate.shape(near)[0]
    # no moment at the free end: the second derivative is 0; differences are accurate to h
    assert abs(w[0] - 2.0 * w[1] + w[2]) / h**2 < 10 * h
    middle, slope = plate.shape(np.array([0.5 - h, 0.5, 0.5 + h]))
    assert (middle[2] - middle[0]) / (2 * h) == pytest.approx(slope[1], rel=1e-7)


def test_thin_period_of_gray_and_others():
    # Gray, Monaghan & Swift (2001), section 4.2, state 0.254 s
    assert plate.thin_period(0.2, 0.02, RUBBER) == pytest.approx(0.25403, abs=1e-5)


def test_slender_plate_is_thin_plate():
    # shear and the clamped section lengthen the period by a few (height/length)^2, here 1e-4
    assert plate.held_period(2.0, 0.02, 0.0, RUBBER) == pytest.approx(
        plate.thin_period(2.0, 0.02, RUBBER), rel=1e-3
    )


def test_periods_by_linear_elasticity():
    # a second code, with elements of equal sides: .25518 and .26232 with 16 across the height, in
    # jaws still rising by half of the last change, .0005, at each doubling
    assert plate.held_period(0.2, 0.02, 0.0, RUBBER) == pytest.approx(0.25523, abs=5e-5)
    assert plate.held_period(0.2, 0.02, 0.05, RUBBER) == pytest.approx(0.26279, abs=5e-5)


def test_period_scales_with_units():
    scaled = Material(7.0 * RUBBER.density, 3.0 * RUBBER.bulk, 3.0 * RUBBER.shear)
    ratio = plate.held_period(0.4, 0.04, 0.1, scaled) / plate.held_period(0.2, 0.02, 0.05, RUBBER)
    assert ratio == pytest.approx(2.0 * math.sqrt(7.0 / 3.0), rel=1e-6)
