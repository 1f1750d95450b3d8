"""When a run counts as stable, by summaries and states made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph.eos.ideal_gas import IdealGas
from sph.errors import ConfigError, NumericalError
from sph.problems.base import Limit
from sph.stability import criterion
from sph.stability.criterion import Criterion, Judge

EOS = IdealGas(1.4)
LIMITS = {
    "energy_drift": Limit(1e-3, "-"),
    "peak": Limit(2.0, "-"),
    "not_there": Limit(1.0, "-"),
}
FIELDS = ("density", "velocity", "pressure", "internal_energy")


class State:
    """Two particles of volumes 1 and 3, in the order of their IDs or in the other."""

    def __init__(self, limits=None, reverse=False, **changed):
        fields = {
            "density": np.array([1.0, 2.0]),
            "velocity": np.array([[3.0, 0.0], [4.0, 0.0]]),
            "pressure": np.array([1.0, 2.0]) / 1.4,  # a sound speed of 1 in both
            "internal_energy": np.array([1.0, 2.0]),
        } | changed
        order = slice(None, None, -1 if reverse else 1)
        fields = {name: values[..., order] for name, values in fields.items()}
        mass = np.array([1.0, 6.0])[order]
        self.fields, self.ids = fields, np.array([1, 2])[order]
        self.particles = SimpleNamespace(mass=mass, **fields)
        self.pressure = fields["pressure"]
        physics = SimpleNamespace(C=0.05, max_energy_drift=5e-3, eos_model=lambda: EOS)
        self.config = SimpleNamespace(problem=SimpleNamespace(limits=limits or {}), physics=physics)

    def field(self, name):
        return self.fields[name]

    def by_id(self, values):
        return values[..., np.argsort(self.ids)]


@pytest.fixture
def finished_run(tmp_path, monkeypatch):
    """finished_run(name, state, ...): the directory of a run that ended with these figures."""
    states, summaries = {}, {}
    monkeypatch.setattr(
        criterion.RunDirectory, "whole_summary", lambda run: summaries[run.path.name]
    )
    monkeypatch.setattr(criterion, "_last", lambda directory: states[directory.name])

    def made(name, state=None, errors=None, report=None, drift=1e-5, **changed):
        fields = errors and {field: {"L1": error} for field, error in errors.items()}
        summaries[name] = {
            "status": "done", "reason": None, "time": 0.5, "steps": 40,
            "errors": fields and {"fields": fields}, "report": report,
            "conservation": {"energy_drift": 0.0, "energy_drift_max": drift},
            "cost": {"cpu_seconds": 9.0, "session": {"compile_cpu_seconds": 4.0}},
        } | changed  # fmt: skip
        states[name] = state or State()
        return tmp_path / name

    return made


@pytest.mark.parametrize(
    ("own", "limits", "allowed"),
    [
        (1e-5, LIMITS, 1e-3),  # the problem's
        (1e-5, {}, 5e-3),  # the run's own
        (4e-3, LIMITS, 6e-3),  # half more than the reference's
    ],
)
def test_energy_drift_limit_is_problem_limit_or_half_above_reference(
    finished_run, own, limits, allowed
):
    judge = Judge(finished_run("reference", State(limits), drift=own), Criterion())
    assert judge.drift == pytest.approx(allowed, rel=1e-12)
    for share, verdict in ((0.99, "stable"), (1.01, "beyond")):
        trial = judge.trial(0.1, finished_run(f"run{share}", drift=share * allowed))
        assert (trial.verdict, trial.drift) == (verdict, share * allowed)


def test_error_limits_of_problem_do_not_apply(finished_run):
    """They hold for the shipped configuration, not for the same run with small steps."""
    state = State(LIMITS | {"l1.density": Limit(1e-9, "-")})
    judge = Judge(finished_run("reference", state, errors=dict.fromkeys(FIELDS, 0.1)), Criterion())
    assert "l1.density" not in judge.figures
    assert judge.errors["density"] == pytest.approx(0.15, rel=1e-12)


def test_trial_reports_cost_of_run(finished_run):
    judge = Judge(finished_run("reference"), Criterion())
    trial = judge.trial(0.1, finished_run("run"))
    assert (trial.name, trial.value, trial.time, trial.steps, trial.cpu) == (
        "run",
        0.1,
        0.5,
        40,
        9.0,
    )
    failed = finished_run("failed", status="failed", reason="step 3: no\nTry: more")
    trial = judge.trial(0.2, failed)
    assert (trial.verdict, trial.reason, trial.steps) == ("failed", "step 3: no", 40)
    with pytest.raises(NumericalError, match="the reference run failed fails: step 3: no"):
        Judge(failed, Criterion())


EXACT = dict(zip(FIELDS, (0.1, 0.2, 0.3, 1e-30), strict=True))


def test_error_limit_is_half_above_reference(finished_run):
    judge = Judge(finished_run("reference", errors=EXACT), Criterion())
    # round-off does not count: 1e-9 of the mean by volume, (1 + 2 x 3)/4
    largest = (0.15, 0.3, 0.45, 1.75e-9)
    assert list(judge.errors.values()) == pytest.approx(largest, rel=1e-12)
    near = dict(zip(FIELDS, (0.149, 0.2, 0.3, 1.6e-9), strict=True))
    trial = judge.trial(0.1, finished_run("near", errors=near))
    assert (trial.verdict, trial.field) == ("stable", "density")
    assert trial.error == pytest.approx(0.149 / 0.15, rel=1e-12)
    far = near | {"internal_energy": 3.5e-9}
    trial = judge.trial(0.1, finished_run("far", errors=far))
    assert (trial.verdict, trial.field) == ("beyond", "internal_energy")
    assert trial.error == pytest.approx(2.0, rel=1e-12)
    assert "internal energy is 2 of its limit" in trial.reason


def test_states_without_exact_solution_compared_by_volume_and_particle(finished_run):
    judge = Judge(finished_run("reference"), Criterion())
    # a twentieth of the mean size by volume: of velocity, of |v| + c
    assert judge.errors == pytest.approx(
        dict(zip(FIELDS, (0.0875, 0.05 * 9 / 4, 0.0875 / 1.4, 0.0875), strict=True)), rel=1e-12
    )
    same = judge.trial(0.1, finished_run("same", State(reverse=True)))
    assert (same.verdict, same.error) == ("stable", 0.0)
    moved = State(reverse=True, velocity=np.array([[3.0, 0.3], [4.0, 0.4]]))
    trial = judge.trial(0.1, finished_run("moved", moved))
    # 0.5 in three quarters of the volume
    assert (trial.verdict, trial.field) == ("beyond", "velocity")
    assert trial.error == pytest.approx(0.375 / (0.05 * 9 / 4), rel=1e-12)


def test_figure_limit_is_problem_limit_or_half_above_reference(finished_run):
    def judge(name, peak):
        run = finished_run(name, State(LIMITS), report={"peak": peak})
        return Judge(run, Criterion(), holds_report=False)

    keeps, breaks = judge("keeps", 1.9), judge("breaks", 4.0)
    bounds = [{name: limit.bound for name, limit in one.figures.items()} for one in (keeps, breaks)]
    assert bounds == [{"peak": 2.0}, {"peak": 6.0}]
    for one, value, verdict in (
        (keeps, 1.95, "stable"), (keeps, 2.1, "beyond"), (keeps, None, "beyond"),
        (breaks, 5.9, "stable"), (breaks, 6.1, "beyond"),
    ):  # fmt: skip
        run = finished_run(f"{value}", report={} if value is None else {"peak": value})
        assert one.trial(0.1, run).verdict == verdict
    assert "peak at most 2" in keeps.in_words()


@pytest.mark.parametrize(("own", "least"), [(0.75, 0.6), (0.3, 0.2)])
def test_figure_with_lower_bound_has_lower_limit(finished_run, own, least):
    """The growth of the smooth shear layer: 0.6 at least, or two thirds of the reference's."""
    limits = {"growth": Limit(0.6, "-", at_least=True)}
    run = finished_run("reference", State(limits), report={"growth": own})
    judge = Judge(run, Criterion(), holds_report=False)
    assert f"growth at least {least:g}" in judge.in_words()
    for growth, words in ((1.01 * least, ""), (2.0, ""), (0.99 * least, f"less than {least:g}")):
        trial = judge.trial(0.1, finished_run(f"{growth}", report={"growth": growth}))
        assert trial.is_stable == (not words)
        assert words in trial.reason


@pytest.mark.parametrize("own", [2.0, -2.0])
def test_figure_without_exact_solution_within_a_twentieth_of_reference(finished_run, own):
    judge = Judge(finished_run("reference", report={"mode": own, "zero": 0.0}), Criterion())
    for mode, zero, verdict in (
        (1.04 * own, 0.0, "stable"), (0.96 * own, 5e-10, "stable"), (1.06 * own, 0.0, "beyond"),
        (0.94 * own, 0.0, "beyond"), (own, 2e-9, "beyond"),
    ):  # fmt: skip
        run = finished_run(f"{mode},{zero}", report={"mode": mode, "zero": zero})
        assert judge.trial(0.1, run).verdict == verdict
    assert Judge(judge.directory, Criterion(), holds_report=False).report == {}


def test_criterion_factors_above_one_and_fractions_above_zero():
    assert Criterion.of(["error_growth=1.01", "negligible=1e-3"]).error_growth == 1.01
    for wrong in (
        "error_growth=1",
        "resolution=0.9",
        "deviation=0",
        "reference=1.1",
        "negligible=x",
    ):
        with pytest.raises(ConfigError, match=wrong.partition("=")[0]):
            Criterion.of([wrong])
    assert Criterion.of(["reference=1"]).reference == 1.0
