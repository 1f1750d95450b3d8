"""How a run is judged, and figures of two states, without a run."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph.output.checkpoint import Checkpoint
from sph.particles import Particles
from sph.stress.case import ALWAYS, Bound, Case, Failing
from sph.stress.figures import Figures
from sph.stress.verdict import (
    AS_WRITTEN,
    OTHERWISE,
    PASS,
    SHORT,
    UNEXPECTED,
    Check,
    Result,
    _verdict,
)

HOLDS = Check("a", 1.0, Bound(at_most=2.0, why="-"))
BROKEN = Check("b", 3.0, Bound(at_most=2.0, why="-"))
BY_LIMIT = Failing(limit="b", because="so")
BY_EXIT = Failing(exit="energy has changed", because="so")


@pytest.mark.parametrize(
    ("fails", "checks", "ended", "verdict"),
    [
        (None, [HOLDS], "", PASS),
        (None, [HOLDS, BROKEN], "", SHORT),
        (None, [HOLDS], "step 3: energy has changed.", SHORT),
        (BY_LIMIT, [HOLDS, BROKEN], "", AS_WRITTEN),
        (BY_LIMIT, [HOLDS], "", UNEXPECTED),
        # a run that ended early has figures of another time
        (BY_LIMIT, [HOLDS, BROKEN], "step 3: energy has changed.", OTHERWISE),
        (BY_EXIT, [HOLDS], "step 3: energy has changed.\nTry: more", AS_WRITTEN),
        (BY_EXIT, [HOLDS], "step 3: density is nan.", OTHERWISE),
        (BY_EXIT, [HOLDS, BROKEN], "", OTHERWISE),
        (BY_EXIT, [HOLDS], "", UNEXPECTED),
    ],
)
def test_verdicts(fails, checks, ended, verdict):
    assert _verdict(fails, tuple(checks), ended)[0] == verdict


def test_the_worst_check_is_a_broken_one_then_an_error_nearest_to_its_bound():
    nearer = Check("c", 1.9, Bound(at_most=2.0, why="-"))
    least = Check("d", 2.0, Bound(at_least=2.0, why="-"))
    too_little = Check("e", 1.0, Bound(at_least=2.0, why="-"))
    everyone = Check(next(iter(ALWAYS)), 9.0, Bound(at_most=2.0, why="-"))

    def worst(*checks):
        return Result("case", "setting", PASS, "", checks, {}, {}).worst

    assert worst(HOLDS, nearer, least, everyone) is nearer
    assert worst(HOLDS, nearer, too_little) is too_little
    assert worst(everyone) is None


def test_a_setting_goes_before_its_case_and_both_before_what_holds_for_all():
    drift = "conservation.energy_drift_max"
    bounds = [{drift: {"at_most": most, "why": "-"}} for most in (0.1, 0.2)]
    settings = {"own": {"about": "-", "limits": bounds[1]}, "plain": {"about": "-"}}
    case = Case(
        name="-", title="-", hard="-", configuration={}, limits=bounds[0], settings=settings
    )
    assert case.bounds("own")[drift].at_most == 0.2
    assert case.bounds("plain")[drift].at_most == 0.1
    assert "history.min_internal_energy.min" in case.bounds("plain")


def state(velocity, energy, order):
    x = np.zeros((2, 3))
    particles = Particles.at_start(x, np.array(velocity, float), np.ones(3), np.array(energy))
    particles.id[:] = [1, 2, 3]
    for array in particles.arrays().values():
        array[...] = array[..., order].copy()
    return Checkpoint(particles, 0.0, 0, 0.1, x, np.ones(3), 0.1, None, ())


def test_change_is_of_each_particle_and_of_vectors_over_the_longest(tmp_path):
    figures = Figures(tmp_path, {})
    figures._first = state([[3.0, 0.0, 0.0], [4.0, 0.0, 1.0]], [1.0, 2.0, 4.0], [0, 1, 2])
    figures._last = state([[3.0, 0.5, 0.0], [4.0, 0.0, 1.0]], [1.0, 2.5, 4.0], [2, 0, 1])
    assert figures.value("change.velocity") == 0.1  # 0.5 of 5
    assert figures.value("change.internal_energy") == 0.25


def test_relative_errors_are_of_the_region_alone(tmp_path):
    problem = SimpleNamespace(
        exact=lambda *_: {"density": np.array([1.0, 2.0, 4.0])},
        error_region=lambda *_: (np.array([True, True, False]), "but the last"),
        departs=lambda _: None,
        exact_ends=lambda _: (0.5, "it does"),
        undisturbed=lambda *_: np.array([[-np.inf, np.inf]]),
    )
    physics = SimpleNamespace(eos_model=lambda: None)
    density = np.array([1.5, 2.5, 40.0])
    figures = Figures(tmp_path, {})
    figures._last = SimpleNamespace(
        time=0.0, field=lambda _: density, config=SimpleNamespace(problem=problem, physics=physics),
        particles=SimpleNamespace(position=np.zeros((1, 3)), mass=density, density=density),
    )  # fmt: skip
    assert figures.value("relative.density.Linf") == 0.5
    assert figures.value("relative.density.L1") == 0.375  # of volumes that are one
    figures._last.time = 0.6
    assert np.isnan(figures.value("relative.density.L1"))
