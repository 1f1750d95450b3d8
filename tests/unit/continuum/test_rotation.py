"""The stress turns exactly with the material; stretch and rotation together are of order two."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from sph.formulations.continuum.rotation import JAUMANN


def tensors(dimension, seed=1):
    """A symmetric and an antisymmetric tensor."""
    S, W = np.random.default_rng(seed).normal(size=(2, dimension, dimension))
    return S + S.T, W - W.T


def integrated(stress, rates, dt):
    """The stress after a step for each entry but the last of `rates`, which begins with t = 0."""
    D = len(stress)
    value, predicted = stress.reshape(D * D, 1).copy(), np.empty((D * D, 1))
    mass = np.ones(1)
    rows = [rate.reshape(D * D, 1) for rate in rates]
    for before, after in pairwise(rows):
        assert JAUMANN.predict(0, 1, dt, value, before, mass, predicted) == 0.0
        assert JAUMANN.correct(0, 1, dt, value, after, mass) == 0.0
    return value.reshape(D, D), predicted.reshape(D, D)


@pytest.mark.parametrize("steps", [3, 200])
@pytest.mark.parametrize("dimension", [2, 3])
def test_stress_turned_once_is_unchanged(dimension, steps):
    S, W = tensors(dimension)
    W /= np.sqrt(0.5 * np.sum(W * W))  # one radian per unit time
    dt = 2.0 * np.pi / steps
    found, predicted = integrated(S, [W] * (steps + 1), dt)
    # roundings of 1e-16 in each of the steps
    np.testing.assert_allclose(found, S, atol=1e-15 * steps * np.abs(S).max(), rtol=0)
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_array_equal(predicted, predicted.T)
    # part of the way, against the exponential
    half, _ = integrated(S, [W] * (steps // 3 + 1), dt)
    R = expm(W * (steps // 3) * dt)
    np.testing.assert_allclose(half, R @ S @ R.T, atol=1e-12, rtol=0)
    assert np.linalg.norm(half) == pytest.approx(np.linalg.norm(S), rel=1e-13)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_prediction_is_correction_at_constant_rate(dimension):
    S, W = tensors(dimension)
    rate = tensors(dimension, 2)[0] + W
    found, predicted = integrated(S, [rate, rate], 0.3)
    # some roundings of numbers of order one
    np.testing.assert_allclose(predicted, found, atol=1e-14, rtol=0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_tiny_and_zero_spin_are_harmless(dimension):
    S, W = tensors(dimension)
    H = tensors(dimension, 2)[0]
    found, _ = integrated(S, [H + 1e-200 * W] * 2, 0.5)
    np.testing.assert_allclose(found, S + 0.5 * H, atol=1e-14, rtol=0)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_stretch_and_rotation_together_are_of_order_two(dimension):
    S, W = tensors(dimension)
    H = tensors(dimension, 2)[0]

    def error(steps):
        # spin and rate of strain both change in time
        times = np.linspace(0.0, 1.0, steps + 1)
        rates = [np.cos(3.0 * t) * H + (1.0 + t) * W for t in times]
        return integrated(S, rates, 1.0 / steps)[0] - fine

    fine = 0.0
    fine = error(4096)  # its own error is 256 times less than that of 256 steps
    errors = [np.linalg.norm(error(steps)) for steps in (128, 256)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_step_is_symmetric_in_time(dimension):
    S, W = tensors(dimension)
    first, second = tensors(dimension, 2)[0] + W, tensors(dimension, 3)[0] - 0.4 * W
    there, _ = integrated(S, [first, second], 0.4)
    back, _ = integrated(there, [second, first], -0.4)
    # some roundings of numbers of order one
    np.testing.assert_allclose(back, S, atol=2e-14, rtol=0)


def test_order_two_against_exact_solution():
    # constant spin w and shear rate h in 2-D: S_xx + i S_xy turns by -2 w, driven by i h
    w, h, end = 1.3, 0.7, 2.0
    rate = np.array([[0.0, h + w], [h - w, 0.0]])

    def error(steps):
        found, _ = integrated(np.zeros((2, 2)), [rate] * (steps + 1), end / steps)
        exact = h * (1.0 - np.exp(-2j * w * end)) / (2.0 * w)
        return abs(found[0, 0] + 1j * found[0, 1] - exact)

    def exact_is_right():
        # S' = W S + S W^T + H by its series in a small time
        t = 1e-4
        first = np.array([[0.0, h], [h, 0.0]])
        W = np.array([[0.0, w], [-w, 0.0]])
        series = first * t + (W @ first + first @ W.T) * t * t / 2
        return series[0, 0] + 1j * series[0, 1], h * (1.0 - np.exp(-2j * w * t)) / (2.0 * w)

    series, exact = exact_is_right()
    assert series == pytest.approx(exact, rel=1e-7)  # the next term is (2 w t)^2/6
    assert np.log2(error(64) / error(128)) == pytest.approx(2.0, abs=0.02)
