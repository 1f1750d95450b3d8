"""How a run is judged, and figures of two states, without a run."""

from types import SimpleNamespace

import numpy as np
import pytest
from columns import as_columns
from states import gas_state

from sph.analysis.report.runs import Row
from sph.output.checkpoint import Checkpoint
from sph.output.history import History
from sph.stress import verdict as verdicts
from sph.stress.case import ALWAYS, Bound, Case, Failing
from sph.stress.figures import Figures
from sph.stress.verdict import (
    EXPECTED_FAILURE,
    PASS,
    SHORT,
    UNEXPECTED_FAILURE,
    UNEXPECTED_PASS,
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
        (BY_LIMIT, [HOLDS, BROKEN], "", EXPECTED_FAILURE),
        (BY_LIMIT, [HOLDS], "", UNEXPECTED_PASS),
        # a run that ended early has figures of another time
        (BY_LIMIT, [HOLDS, BROKEN], "step 3: energy has changed.", UNEXPECTED_FAILURE),
        (BY_EXIT, [HOLDS], "step 3: energy has changed.\nTry: more", EXPECTED_FAILURE),
        (BY_EXIT, [HOLDS], "step 3: density is nan.", UNEXPECTED_FAILURE),
        (BY_EXIT, [HOLDS, BROKEN], "", UNEXPECTED_FAILURE),
        (BY_EXIT, [HOLDS], "", UNEXPECTED_PASS),
    ],
)
def test_verdict_from_checks_and_outcome(fails, checks, ended, verdict):
    assert _verdict(fails, tuple(checks), ended)[0] == verdict


def test_worst_check_is_failed_one_else_nearest_to_bound():
    nearer = Check("c", 1.9, Bound(at_most=2.0, why="-"))
    least = Check("d", 2.0, Bound(at_least=2.0, why="-"))
    too_little = Check("e", 1.0, Bound(at_least=2.0, why="-"))
    everyone = Check(next(iter(ALWAYS)), 9.0, Bound(at_most=2.0, why="-"))

    def worst(*checks):
        return Result("case", "setting", PASS, "", checks, {}, {}).worst

    assert worst(HOLDS, nearer, least, everyone) is nearer
    assert worst(HOLDS, nearer, too_little) is too_little
    assert worst(everyone) is None


def test_bounds_of_setting_override_case_and_suite():
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
    particles = gas_state(x, np.array(velocity, float), np.ones(3), np.array(energy))
    particles.id[:] = [1, 2, 3]
    for array in particles.arrays().values():
        array[...] = array[..., order].copy()
    return Checkpoint(particles, 0.0, 0, 0.1, x, np.ones(3), 0.1, None, ())


def test_change_is_per_particle_relative_to_longest_vector(tmp_path):
    figures = Figures(tmp_path, {})
    figures._first = state([[3.0, 0.0, 0.0], [4.0, 0.0, 1.0]], [1.0, 2.0, 4.0], [0, 1, 2])
    figures._last = state([[3.0, 0.5, 0.0], [4.0, 0.0, 1.0]], [1.0, 2.5, 4.0], [2, 0, 1])
    assert figures.value("change.velocity") == 0.1  # 0.5 of 5
    assert figures.value("change.internal_energy") == 0.25


def test_relative_errors_limited_to_error_region(tmp_path):
    problem = SimpleNamespace(
        exact=lambda *_: {"density": np.array([1.0, 2.0, 4.0])},
        error_region=lambda *_: (np.array([True, True, False]), "but the last"),
        has_exact=True,
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


def test_expected_verdicts_are_pass_and_expected_failure():
    expected = {
        one for one in (PASS, SHORT, EXPECTED_FAILURE, UNEXPECTED_FAILURE, UNEXPECTED_PASS)
        if Result("case", "setting", one, "", (), {}, {}).is_expected
    }  # fmt: skip
    assert expected == {PASS, EXPECTED_FAILURE}


def test_every_failed_check_is_reported():
    missing = Check("c", float("nan"), Bound(at_least=1.0, why="-"))
    said = "b is 3, expected at most 2; c is missing, expected at least 1"
    assert _verdict(None, (BROKEN, HOLDS, missing), "") == (SHORT, said)
    # the first line of why a run ended goes before
    assert _verdict(None, (BROKEN,), "it broke\nTry: more") == (SHORT, "it broke")


HISTORY = {
    "limiter": ["energy", "energy", "support", "growth"],
    "dt": [0.4, 0.1, 0.2, 0.3],
    "min_internal_energy": [3.0, 1.0, 2.0, 4.0],
    "min_density": [5.0, 6.0, 2.0, 3.0],
    "max_density": [9.0, 9.0, 9.0, 9.0],
}


@pytest.fixture
def ended(tmp_path):
    """Figures of a run of four steps, whose first and last states are there."""
    history = History.create(tmp_path / "history.csv", 1)
    for step in range(4):
        row = dict.fromkeys(history.columns, 0.0) | {"step": step}
        history.extend(as_columns(row | {name: values[step] for name, values in HISTORY.items()}))
    history.close()
    warned = [{"kind": "paired"}, {"kind": "limit"}, {"kind": "limit"}]
    summary = {
        "warnings": warned, "steps": 3, "report": {"peak": -2.0}, "time": 0.5, "particles": 3,
        "errors": {"fields": {"density": {"L1": 0.25, "L2": 0.5}}},
        "conservation": {"energy_drift": 1e-5, "energy_drift_max": 2e-5},
        "cost": {"cpu_seconds": 5.0, "wall_seconds": 7.0, "session": {
            "steps": 3, "compile_cpu_seconds": 6.0, "phases_cpu_seconds": {}}},
    }  # fmt: skip
    found = Figures(tmp_path, summary)
    found._first = state([[3.0, 0.0, 1.0], [4.0, 2.0, 0.0]], [1.0, 2.0, 4.0], [0, 1, 2])
    found._last = state([[-3.0, 0.0, 1.0], [4.0, -2.0, 0.0]], [1.0, 1.0, 5.0], [1, 2, 0])
    return found


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("history.dt.first", 0.4),
        ("history.dt.last", 0.3),
        ("history.dt.min", 0.1),
        ("history.dt.max", 0.4),
        ("history.limiter.energy", 0.5),  # of all rows
        ("history.limiter.acceleration", 0.0),
        ("state.velocity.max", 5.0),
        ("state.velocity.min", 1.0),
        ("state.internal_energy.max", 5.0),
        ("state.internal_energy.min", 1.0),
        ("change.internal_energy", 0.5),  # from 2 to 1
        ("change.velocity", 6.0 / 5.0),
        ("warnings.paired", 1.0),
        ("warnings.limit", 1.0),  # a kind is told once
        ("warnings.volume", 0.0),
        ("errors.density.L2", 0.5),
        ("report.peak", -2.0),
        ("steps", 3.0),
        ("report.none", np.nan),
        ("errors.pressure.L1", np.nan),
        ("history.none.min", np.nan),
        ("state.none.min", np.nan),
    ],
)
def test_figure_of_each_kind_is_evaluated(ended, name, value):
    assert ended.value(name) == pytest.approx(value, nan_ok=True, rel=1e-15)


def test_first_and_last_refer_to_checkpoints(tmp_path, monkeypatch):
    found = Figures(tmp_path, {})
    monkeypatch.setattr(type(found.run), "checkpoints", lambda _: ["first", "second", "last"])
    monkeypatch.setattr("sph.output.checkpoint.read", lambda path: path)
    assert (found._first, found._last) == ("first", "last")


def test_figures_keep_sign_and_weigh_by_volume(tmp_path):
    """Relative to the size of what is exact, which may be negative, and weighed by m/rho."""
    problem = SimpleNamespace(
        exact=lambda *_: {"density": np.array([-1.0, 2.0])},
        error_region=lambda *_: (np.array([True, True]), "all"),
        has_exact=True, departs=lambda _: None, exact_ends=lambda _: (0.5, "it does"),
        undisturbed=lambda *_: np.array([[-np.inf, np.inf]]),
    )  # fmt: skip
    physics = SimpleNamespace(eos_model=lambda: None)
    particles = SimpleNamespace(
        position=np.zeros((1, 2)), mass=np.array([3.0, 2.0]), density=np.array([1.0, 2.0])
    )
    figures = Figures(tmp_path, {})
    figures._last = SimpleNamespace(
        time=0.0, field=lambda _: np.array([-1.5, 2.0]), particles=particles,
        config=SimpleNamespace(problem=problem, physics=physics),
    )  # fmt: skip
    assert figures.value("relative.density.Linf") == 0.5
    assert figures.value("relative.density.L1") == 0.5 * 3.0 / 4.0


def test_case_columns_are_worst_of_run(ended, tmp_path):
    row = Row(tmp_path, "a", {"physics.scheme": "grad_h"}, ended.summary, "done")
    assert verdicts._numbers(row, ended) == {
        "scheme": "grad_h",
        "particles": 3,
        "energy_drift": 2e-5,
        "lowest_internal_energy": 1.0,
        "lowest_density": 2.0,
        "steps": 3,
        "smallest_step": 0.1,
        "cpu_seconds": 5.0,
    }
    assert verdicts._numbers(None, ended) == {}
    without = Row(tmp_path, "a", {"physics.formulation": "continuum"}, ended.summary, "done")
    assert verdicts._numbers(without, ended)["scheme"] == "continuum"


def test_run_without_summary_judged_by_its_failure(tmp_path, monkeypatch):
    task = SimpleNamespace(run=SimpleNamespace(path=tmp_path), status=None)
    monkeypatch.setattr(verdicts, "standing", lambda _: SimpleNamespace(reason="the disk is full"))
    case = Case(
        name="case", title="-", hard="-", configuration={},
        settings={"one": {"about": "-", "limits": {"steps": {"at_most": 1.0, "why": "-"}}}},
    )  # fmt: skip
    found = verdicts.judge(case, "one", task)
    assert (found.verdict, found.reason, found.numbers) == (SHORT, "the disk is full", {})
    assert not any(check.holds for check in found.checks)
