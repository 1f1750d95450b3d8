"""The stress turns exactly with the material; stretch and rotation together are of order two."""

import numpy as np
import pytest
from numba import njit

from sph.formulations.continuum.rotation import advance

STIFFNESS = 2.0


@njit
def advanced(dim, stress, velocity_gradient, div_v, dt):
    advance(dim, stress, velocity_gradient, div_v, STIFFNESS, dt, 0)


def step(stress, L, dt):
    """The stress after a step with the velocity gradient L in its middle."""
    found = stress[:, :, None].copy()
    advanced((0,) * len(L), found, L[:, :, None].copy(), np.array([np.trace(L)]), dt)
    return found[:, :, 0]


def tensors(dimension, seed=1):
    """A symmetric tensor of no trace in three dimensions, and an antisymmetric one."""
    S, W = np.random.default_rng(seed).normal(size=(2, dimension, dimension))
    return S + S.T, W - W.T


def rotation(W, angle):
    """The matrix of a rotation by an angle with the axis and the sense of W."""
    values, axes = np.linalg.eigh(1j * W)
    rate = np.abs(values).max()
    return (axes @ np.diag(np.exp(-1j * values * angle / rate)) @ axes.conj().T).real


@pytest.mark.parametrize("steps", [3, 200])
@pytest.mark.parametrize("dimension", [2, 3])
def test_body_turned_once_keeps_its_stress(dimension, steps):
    """Positions move on chords: x_m = (R + 1) x/2 and v = (R - 1) x/dt, so L = 2 tan(t/2)/dt."""
    S, W = tensors(dimension)
    R, unit = rotation(W, 2.0 * np.pi / steps), np.eye(dimension)
    dt = 0.3
    L = 2.0 / dt * (R - unit) @ np.linalg.inv(R + unit)
    found = S
    for k in range(steps):
        found = step(found, L, dt)
        if k == 0:
            # of some roundings of numbers of order one
            np.testing.assert_allclose(found, R @ S @ R.T, atol=1e-14, rtol=0)
            np.testing.assert_array_equal(found, found.T)
    # roundings of 1e-16 in each of the steps
    np.testing.assert_allclose(found, S, atol=2e-15 * steps * np.abs(S).max(), rtol=0)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_stretch_without_spin_is_hookes_law(dimension):
    S, _ = tensors(dimension)
    H, _ = tensors(dimension, 2)
    found = step(S, H, 0.3)
    deviator = H - np.trace(H) / 3.0 * np.eye(dimension)
    # some roundings of numbers of order one
    np.testing.assert_allclose(found, S + STIFFNESS * 0.3 * deviator, atol=1e-14, rtol=0)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_stretch_and_rotation_together_are_of_order_two(dimension):
    S, W = tensors(dimension)
    H = tensors(dimension, 2)[0]

    def after(steps):
        # spin and rate of strain both change in time
        found, dt = S, 1.0 / steps
        for t in (np.arange(steps) + 0.5) * dt:
            found = step(found, np.cos(3.0 * t) * H + (1.0 + t) * W, dt)
        return found

    fine = after(4096)  # its own error is 256 times less than that of 256 steps
    errors = [np.linalg.norm(after(steps) - fine) for steps in (128, 256)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_step_is_symmetric_in_time(dimension):
    S, W = tensors(dimension)
    L = tensors(dimension, 2)[0] + W
    # some roundings of numbers of order one
    np.testing.assert_allclose(step(step(S, L, 0.4), L, -0.4), S, atol=2e-14, rtol=0)


def test_order_two_against_exact_solution():
    # constant spin w and shear rate h in 2-D: S_xx + i S_xy turns by -2 w, driven by 2 G i h
    w, h, end = 1.3, 0.7, 2.0
    L = np.array([[0.0, h + w], [h - w, 0.0]])

    def error(steps):
        found = np.zeros((2, 2))
        for _ in range(steps):
            found = step(found, L, end / steps)
        exact = STIFFNESS * h * (1.0 - np.exp(-2j * w * end)) / (2.0 * w)
        return abs(found[0, 0] + 1j * found[0, 1] - exact)

    assert np.log2(error(64) / error(128)) == pytest.approx(2.0, abs=0.02)
