"""What a summary says was kept, each figure from a history made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph.analysis.summary import baseline, conservation
from sph.eos.ideal_gas import IdealGas
from sph.totals import Baseline

EOS = IdealGas(1.4)


def history(**columns):
    """Four steps; E_0 = 2 + 6 = 8 without bulk motion."""
    rows = {
        "kinetic_energy": [100.0, 100.0, 100.0, 100.0],
        "kinetic_energy_without_bulk": [2.0, 2.5, 2.0, 2.0],
        "internal_energy": [6.0, 6.0, 6.0, 6.0],
        "total_energy": [106.0, 106.0, 106.0, 106.0],
        "energy_drift": [0.0, 0.02, -0.05, 0.01],
        "energy_injected": [0.0, 0.1, 0.2, 0.4],
        "momentum_x": [5.0, 5.0, 5.0, 5.0],
        "momentum_y": [-1.0, -1.0, -1.0, -1.0],
    } | columns
    return {name: np.array(values) for name, values in rows.items()}


def state(velocity=((3.0, 5.0), (0.0, 0.0)), mass=(1.0, 1.0)):
    """Two particles of density 1.4 and sound speed 2 (P = 4)."""
    n = len(mass)
    density = np.full(n, 1.4)
    return SimpleNamespace(velocity=np.array(velocity), mass=np.array(mass), density=density)


def kept(particles=None, keeps=(1.0, 1.0), **columns):
    formulation = SimpleNamespace(sound_speed=lambda state: EOS.sound_speed(state.density, 4.0))
    scene = SimpleNamespace(keeps_momentum=np.array(keeps), formulation=formulation)
    return conservation(history(**columns), particles or state(), scene, Baseline(1.0, 8.0))


def test_matter_at_rest_without_energy_has_changes_of_zero():
    still = SimpleNamespace(
        velocity=np.zeros((2, 3)), mass=np.ones(3), density=np.ones(3), internal_energy=np.zeros(3)
    )
    columns = {name: [0.0, 0.0] for name in ("momentum_x", "momentum_y", "energy_injected")}
    formulation = SimpleNamespace(sound_speed=lambda state: np.zeros(3))
    scene = SimpleNamespace(keeps_momentum=np.ones(2), formulation=formulation)
    found = conservation(history(**columns), still, scene, Baseline(0.0, 0.0))
    assert found["momentum_change"] == 0.0
    assert found["energy_injected"] == 0.0


def test_energy_drift_reports_last_and_largest():
    found = kept()
    assert found["energy_drift"] == 0.01
    assert found["energy_drift_max"] == 0.05


def test_energy_drift_keeps_its_sign():
    assert kept(energy_drift=[0.0, 0.02, -0.05, -0.01])["energy_drift"] == -0.01


def test_injected_energy_reported_relative_to_initial_energy():
    assert kept()["energy_injected"] == 0.4 / 8.0


def test_energy_baseline_is_first_row_without_bulk_motion():
    assert baseline(history()) == (8.0, 8.0)
    bound = baseline(history(potential_energy=[-7.0, 0.0, 0.0, 0.0]))
    assert bound == (1.0, 8.0)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_momentum_change_is_largest_over_steps_and_axes(axis):
    column = {f"momentum_{axis}": [1.0, 4.0, -2.0, 1.0]}
    # sum m (|v - bulk| + c) of speeds 3 and 5, whose mean is 4: 1 + 1 + 2 + 2
    assert kept(**column)["momentum_change"] == pytest.approx(3.0 / 6.0, rel=1e-14)


def test_momentum_change_with_bulk_velocity_unchanged():
    moved = state(velocity=((1003.0, 1005.0), (-70.0, -70.0)))
    column = {"momentum_x": [0.0, 3.0, 0.0, 0.0]}
    # the difference of 1005 and the mean rounds at 1e-13
    assert kept(moved, **column)["momentum_change"] == pytest.approx(3.0 / 6.0, rel=1e-12)


def test_momentum_change_ignores_axes_with_walls():
    column = {"momentum_x": [1.0, 4.0, 1.0, 1.0], "momentum_y": [0.0, 0.0, 0.0, -1.0]}
    # along x the mean motion of 4 is none that could be taken off: speeds 3 and 5
    found = kept(keeps=(0.0, 1.0), **column)["momentum_change"]
    assert found == pytest.approx(1.0 / (3.0 + 5.0 + 2.0 + 2.0), rel=1e-14)
    assert kept(keeps=(0.0, 0.0), **column)["momentum_change"] is None


@pytest.mark.parametrize(
    ("ratio", "last", "worst"),
    [([1.0, 0.8, 1.1, 0.99], 0.99, 0.8), ([1.0, 0.9, 1.3, 1.01], 1.01, 1.3)],
)
def test_volume_ratio_reports_last_and_farthest_from_one(ratio, last, worst):
    found = kept(volume_ratio=ratio)
    assert (found["volume_ratio"], found["volume_ratio_worst"]) == (last, worst)
    assert kept()["volume_ratio"] is None
