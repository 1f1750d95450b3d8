"""The tensor of the tensile correction, against NumPy's eigenvalues."""

import numpy as np
import pytest
from numba import njit

from sph.compiled import FLAGS
from sph.formulations.continuum.tension import tensile


@njit(**FLAGS)
def _tensors(dim, strength, stress, scratch, tensor):
    for i in range(stress.shape[2]):
        tensile(dim, strength, stress, i, scratch, tensor)


def found(stress, strength=0.3):
    """The tensors (D, D, N) of stresses (N, D, D)."""
    stress = np.ascontiguousarray(np.moveaxis(np.asarray(stress, float), 0, -1))
    tensor = np.full_like(stress, np.nan)
    _tensors((0,) * len(stress), strength, stress, np.empty((2, 3, 3)), tensor)
    return np.moveaxis(tensor, -1, 0)


def turned(values, seed):
    """Symmetric matrices (N, D, D) with these eigenvalues (N, D), in random directions."""
    D = values.shape[1]
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(values), D, D)))[0]
    return axes @ (values[:, :, None] * np.swapaxes(axes, 1, 2))


@pytest.mark.parametrize("scale", [1.0, 1e10])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_tensor_of_random_stresses(dimension, scale):
    values = scale * np.random.default_rng(2).normal(size=(500, dimension))
    stress = turned(values, 3)
    principal, axes = np.linalg.eigh(stress)
    expected = -0.3 * axes @ (np.maximum(principal, 0.0)[:, :, None] * np.swapaxes(axes, 1, 2))
    result = found(stress)
    # some tens of roundings of stresses up to 4 times the scale
    np.testing.assert_allclose(result, expected, atol=2e-14 * scale, rtol=0)
    np.testing.assert_array_equal(result, np.swapaxes(result, 1, 2))


# Repeated principal stresses, where directions are not defined but the tensor is; a trace of
# mixed stress; eigenvalues of very different size.
CASES = {
    2: [(1, 1), (-1, -1), (0, 0), (1, 0), (-1, 0), (1, 1 + 1e-15), (1, -1), (1e-8, -1)],
    3: [
        (1, 1, 1), (-1, -1, -1), (0, 0, 0), (1, 1, -2), (1, -2, -2), (1, 1, 1 + 1e-15),
        (1, 0, 0), (1e-9, 1, -1e9), (1, 1 + 1e-9, -1),
    ],
}  # fmt: skip


@pytest.mark.parametrize("dimension", CASES)
def test_tensor_of_repeated_principal_stresses(dimension):
    values = np.array(CASES[dimension], float)
    for seed in range(20):
        axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(dimension, dimension)))[0]
        stress = axes @ (values[:, :, None] * axes.T)
        expected = -0.3 * axes @ (np.maximum(values, 0.0)[:, :, None] * axes.T)
        # roundings of the largest stress of each case
        error = np.abs(found(stress) - expected).max(axis=(1, 2)) / (1e-300 + np.abs(values).max(1))
        assert error.max() < 5e-15


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_diagonal_stress_is_exact(dimension):
    values = np.array([3.0, -2.0, 5.0])[:dimension]
    expected = np.diag(-0.5 * np.maximum(values, 0.0))
    np.testing.assert_array_equal(found([np.diag(values)], 0.5), [expected])
