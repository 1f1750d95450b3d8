"""Yield stresses by hand, and the radial return to them."""

import numpy as np
import pytest
from numba import njit

from sph import registry
from sph.compiled import FLAGS
from sph.formulations.continuum.radial_return import equivalent_stress, returned
from sph.formulations.continuum.strength import yield_stress_of

FOLDER = "sph.formulations.continuum.strength"
FEW_ROUNDINGS = 1e-14  # of some operations at 1e-16 each
G = 8e10
# 4340 steel of Johnson & Cook (1983), without softening in most cases below
STEEL = {
    "shear_modulus": G, "A": 7.92e8, "B": 5.1e8, "n": 0.26, "C": 0.014, "m": 1.03,
    "reference_rate": 1.0, "specific_heat": 477.0, "room_temperature": 293.0,
    "melting_temperature": 1793.0,
}  # fmt: skip


def make(name, **parameters):
    return registry.model(FOLDER, {"name": name, **parameters})


@njit(**FLAGS)
def _returned(strength, *state):
    return returned(strength, *state)


@njit(**FLAGS)
def _yield_stress(strength, *state):
    return yield_stress_of(strength, *state)


@njit(**FLAGS)
def _equivalent(dim, stress):
    return equivalent_stress(dim, stress, 0)


def test_which_models_yield():
    kinds = {name: registry.model_class(FOLDER, name).yields for name in registry.names(FOLDER)}
    assert kinds == {"elastic": False, "elastic_plastic": True, "johnson_cook": True}


def test_johnson_cook_matches_by_hand():
    steel = make("johnson_cook", **STEEL)
    strain = np.array([0.0, 0.0, 0.5, 0.5, 0.5])
    rate = np.array([0.0, np.e, 1e-3, np.e**2, 1.0])
    energy = np.array([0.0, 0.0, -1e6, 0.0, 750.0 * 477.0])  # half way to melting
    hard = 7.92e8 + 5.1e8 * 0.5**0.26
    expected = [7.92e8, 7.92e8 * 1.014, hard, hard * 1.028, hard * (1 - 0.5**1.03)]
    found = steel.yield_stress_of(strain, rate, energy)
    np.testing.assert_allclose(found, expected, rtol=FEW_ROUNDINGS)
    assert steel.yield_stress_of(0.5, 1.0, 1500.0 * 477.0) == 0.0
    assert steel.yield_stress_of(0.5, 1.0, 1e9) == 0.0


def test_johnson_cook_refuses_melting_below_room_temperature():
    kind = registry.model_class(FOLDER, "johnson_cook")
    assert kind(**STEEL).issues() == []
    ((key, text),) = kind(**STEEL | {"melting_temperature": 293.0}).issues()
    assert key == "melting_temperature"
    assert "above room_temperature" in text


@pytest.mark.parametrize(("stress", "expected"), [
    # uniaxial strain: S_yy = S_zz = -S_xx/2
    ([[2.0]], 3.0),
    # simple shear: sqrt(3) of the shear stress
    ([[0.0, 2.0], [2.0, 0.0]], 2.0 * np.sqrt(3.0)),
    # plane strain with S_zz = -4: the difference of S_xx = S_yy and S_zz
    ([[2.0, 0.0], [0.0, 2.0]], 6.0),
    # uniaxial stress of 3: S = (2, -1, -1)
    (np.diag([2.0, -1.0, -1.0]), 3.0),
])  # fmt: skip
def test_equivalent_stress_counts_all_normal_components(stress, expected):
    tensor = np.array(stress)[:, :, None]
    dim = (0,) * tensor.shape[0]
    assert _equivalent(dim, tensor) == pytest.approx(expected, rel=FEW_ROUNDINGS)


def test_return_leaves_elastic_stress():
    steel = make("elastic_plastic", shear_modulus=G, yield_stress=6e8)
    assert _returned(steel, 6e8, 0.1, 1.0, 0.0) == (1.0, 0.0)
    assert _returned(make("elastic", shear_modulus=G), 1e300, 0.0, 1.0, 0.0) == (1.0, 0.0)
    assert _returned(steel, np.nan, 0.1, 1.0, 0.0) == (1.0, 0.0)


def test_return_of_perfect_plasticity_matches_by_hand():
    steel = make("elastic_plastic", shear_modulus=G, yield_stress=6e8)
    factor, increment = _returned(steel, 8e8, 0.1, 1.0, 0.0)
    assert factor == pytest.approx(0.75, rel=FEW_ROUNDINGS)
    assert increment == pytest.approx(2e8 / (3 * G), rel=1e-13)


@pytest.mark.parametrize("excess", [1e-9, 1e-3, 1.0, 1e5])
@pytest.mark.parametrize("strain", [0.0, 1e-12, 0.3])
@pytest.mark.parametrize("n", [0.05, 0.26, 1.0, 2.0])
def test_return_is_consistent_with_hardening(n, strain, excess):
    steel = make("johnson_cook", **STEEL | {"n": n})
    state = 1e4, 1e5
    before = _yield_stress(steel, strain, *state) * (1.0 + excess)
    factor, increment = _returned(steel, before, strain, *state)
    after = _yield_stress(steel, strain + increment, *state)
    assert 0.0 < increment < before / (3 * G)
    assert 0.0 < factor <= 1.0  # 1 where hardening is so steep that no stress is lost
    # TOLERANCE of the return, and the roundings of the factor, each relative to the stress before
    assert factor * before == pytest.approx(after, abs=3e-14 * before)
    # the loss of stress is 3 G times the increment
    assert (1.0 - factor) * before == pytest.approx(3 * G * increment, abs=1e-15 * before)


@pytest.mark.parametrize("model", [
    make("johnson_cook", **STEEL), make("elastic_plastic", shear_modulus=G, yield_stress=0.0),
], ids=["molten", "no_yield_stress"])  # fmt: skip
def test_return_without_yield_stress_leaves_no_stress(model):
    factor, increment = _returned(model, 3e8, 0.2, 1e4, 1e9)
    assert factor == 0.0
    assert increment == pytest.approx(3e8 / (3 * G), rel=FEW_ROUNDINGS)
