"""A tiny search on real runs, verdicts, and what the command says and exits with."""

import csv
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from sph.cli import main
from sph.errors import ConfigError
from sph.output import checkpoint as checkpoints
from sph.output.run_directory import RunDirectory
from sph.problems import base
from sph.stability import command, table
from sph.stability.criterion import Criterion, Judge
from sph.stability.search import Edge
from sph.stability.trials import Trials

# Sod's tube, with so few particles that a run takes no longer than its process takes to start.
TUBE = """\
[problem]
name = "shock_tube"
n = 40
[physics]
max_energy_drift = 0.0002
[time]
end = 0.06
[output]
interval = 0.06
"""


@pytest.fixture(scope="module")
def tube(tmp_path_factory):
    path = tmp_path_factory.mktemp("stability") / "tube.toml"
    path.write_text(TUBE)
    return path


def called(config, target, *arguments):
    return CliRunner().invoke(
        main, ["stability", str(config), "-o", str(target), "--limit", "resolution=1.5", *arguments]
    )


@pytest.fixture(scope="module")
def first_search(tube):
    """The first search, and its directory."""
    target = tube.parent / "found"
    return called(tube, target, "--jobs", "2"), target


@pytest.mark.slow
def test_search_finds_largest_stable_courant_number(first_search):
    result, target = first_search
    assert result.exit_code == 0, result.output
    found = json.loads((target / "physics.C.json").read_text())
    end = found["ends"]["largest"]
    assert found["default"] == 0.15
    assert end["stable"] < end["unstable"] <= 1.5 * 1.001 * end["stable"]  # of four digits
    assert end["over_default"] == pytest.approx(end["stable"] / 0.15)
    verdicts = {trial["value"]: trial["verdict"] for trial in found["trials"]}
    assert verdicts[end["stable"]] == "stable"
    assert verdicts[end["unstable"]] in ("beyond", "failed")
    assert max(verdicts) <= 64 * 0.15
    assert f"physics.C: stable up to {end['stable']:g}" in result.output
    steps = next(one["steps"] for one in found["trials"] if one["value"] == end["stable"])
    assert steps < table.FEW_STEPS  # of so short a run
    assert f"took {steps} steps, fewer than the 30" in result.output
    assert "runs to t = 0.06. A run is stable if it ends" in result.output  # the whole of it
    assert found["whole_end"] == found["end"] == 0.06
    assert {trial["time"] for trial in found["trials"] if trial["verdict"] != "failed"} == {0.06}
    assert (target / "physics.C.png").stat().st_size > 10_000
    with (target / "physics.C.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [float(line["value"]) for line in lines] == sorted(verdicts)


@pytest.mark.slow
def test_failed_run_is_unstable_with_reason(first_search):
    _, target = first_search
    trials = json.loads((target / "physics.C.json").read_text())["trials"]
    failed = [trial for trial in trials if trial["verdict"] == "failed"]
    assert failed, "the drift that is allowed is too large for this test"
    for trial in failed:
        assert "total energy has drifted" in trial["reason"]
        assert trial["error"] is None
        assert (target / trial["name"] / "offenders.h5").is_file()


@pytest.mark.slow
def test_existing_runs_are_judged_without_running_again(first_search, tube):
    _, target = first_search
    before = {path: path.stat().st_mtime_ns for path in target.glob("*/summary.json")}
    words = (target / "physics.C.json").read_text()
    again = called(tube, target, "--jobs", "2")
    assert again.exit_code == 0
    assert (target / "physics.C.json").read_text() == words
    assert {path: path.stat().st_mtime_ns for path in target.glob("*/summary.json")} == before
    judge = Judge(target / "physics.C=0.0375", Criterion(error_growth=1.0000001))
    assert judge.trial(0.15, target / "default").verdict == "beyond"
    # the reference keeps what it is the measure of
    assert judge.trial(0.0375, target / "physics.C=0.0375").verdict == "stable"


@pytest.mark.slow
@pytest.mark.parametrize("word", ["nan", "inf"])
def test_nan_error_is_beyond_limit(first_search, tmp_path, word):
    _, target = first_search
    run = shutil.copytree(target / "default", tmp_path / "default")
    summary = json.loads((run / "summary.json").read_text())
    summary["errors"]["fields"]["pressure"]["L1"] = word
    (run / "summary.json").write_text(json.dumps(summary))
    trial = Judge(target / "physics.C=0.0375", Criterion()).trial(0.15, run)
    assert (trial.verdict, trial.field) == ("beyond", "pressure")
    assert f"pressure is {word} of its limit" in trial.reason


@pytest.mark.slow
def test_killed_search_continues_its_run(first_search, tube):
    _, target = first_search
    run = target / "default"
    summary = run / "summary.json"
    before = json.loads(summary.read_text())
    summary.unlink()
    (run / "checkpoints" / "checkpoint_000001.h5").unlink()
    assert called(tube, target, "--jobs", "2").exit_code == 0
    assert "$ sph restart" in (target / "logs" / "default.log").read_text()
    assert json.loads(summary.read_text())["errors"] == before["errors"]


@pytest.mark.slow
def test_directory_of_other_configuration_is_refused(first_search, tube):
    _, target = first_search
    result = called(tube, target, "--set", "problem.n=50")
    assert result.exit_code == 2
    assert "of another configuration" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--key", "physics.alpha"], "expected one of physics.C, physics.eta"),
        (["--limit", "growth=2"], "did you mean error_growth?"),
        (["--limit", "deviation=-1"], "expected a number above 0"),
        (["--limit", "error_growth=1"], "expected a number above 1"),
        (["--limit", "reference=2"], "expected at most 1"),
        (["--set", "problem.m=3"], "problem.m"),
    ],
)
def test_wrong_option_exits_with_2(tube, tmp_path, arguments, said):
    result = called(tube, tmp_path / "out", *arguments)
    assert result.exit_code == 2, result.output
    assert said in result.stderr
    assert not (tmp_path / "out").exists()


def test_missing_configuration_exits_with_4(tmp_path):
    assert called(tmp_path / "none.toml", tmp_path / "out").exit_code == 4


@pytest.mark.slow
def test_failed_reference_run_exits_with_3(tube, tmp_path):
    result = called(tube, tmp_path / "out", "--set", "physics.max_energy_drift=1e-15")
    assert result.exit_code == 3, result.output
    assert "the reference run physics.C=0.0375 fails: step" in result.stderr


@pytest.mark.slow
def test_refused_run_is_unstable_with_reason(first_search, tube):
    """At eta = 5e4 a support takes more than a thousand images of the box."""
    _, target = first_search
    trials = Trials(tube, "physics.eta", (), target, Criterion(), 1)
    assert trials.are_stable([5e4]) == [False]
    assert trials.done[5e4].verdict == "failed"
    assert "times the shortest side of the box" in trials.done[5e4].reason


@pytest.mark.slow
def test_runs_without_exact_solution_compared_with_reference(tmp_path):
    path = tmp_path / "four.toml"
    path.write_text(
        '[problem]\nname = "particles"\n[time]\nend = 0.05\n[output]\ninterval = 0.05\n'
    )
    trials = Trials(path, "physics.C", (), tmp_path / "out", Criterion(), 1)
    assert not trials.judge.has_exact
    reference = trials.judge.directory
    same = trials.judge.trial(0.0375, reference)
    assert same.verdict == "stable"
    assert same.error == 0.0
    assert trials.are_stable([0.15]) == [True]
    assert 0.0 < trials.done[0.15].error < 1.0
    strict = Judge(reference, Criterion(deviation=1e-12))
    assert strict.trial(0.15, tmp_path / "out" / "default").verdict == "beyond"
    assert (
        "fields and figures of the report within 5% of the run at C = 0.0375"
        in trials.judge.in_words()
    )


@pytest.mark.slow
def test_islands_of_stability_are_reported(first_search, tube):
    _, target = first_search
    found = command.run(tube, "physics.C", (), target, ("resolution=1.5",), 2)
    reference, default, *more = (trial.value for trial in found.trials if trial.is_stable)
    assert more
    assert found.islands("largest") == []
    found.edges["largest"] = Edge(reference, default)  # as if the default were beyond
    assert found.islands("largest") == more
    assert f"The range has gaps: stable again at {more[0]:g}" in table.in_words(found)
    assert "THE CONFIGURATION IS UNSTABLE" in table.in_words(found)


def changed(run, target, change):
    """A copy of a run in `target`, its summary changed in place by `change`."""
    shutil.copytree(run, target)
    summary = RunDirectory(target).summary
    content = json.loads(summary.read_text())
    change(content)
    summary.write_text(json.dumps(content))
    return target


@pytest.mark.slow
def test_energy_drift_judged_by_problem_or_reference(first_search, tmp_path):
    _, target = first_search
    reference, default = target / "physics.C=0.0375", target / "default"
    judge = Judge(reference, Criterion())
    allowed = judge.state.config.problem.limits["energy_drift"].bound
    assert allowed != judge.state.config.physics.max_energy_drift  # else this shows nothing
    assert judge.drift == allowed

    def drifting(by):
        return lambda summary: summary["conservation"].update(energy_drift_max=by)

    trial = judge.trial(0.15, changed(default, tmp_path / "far", drifting(1.01 * allowed)))
    assert trial.verdict == "beyond"
    assert "energy drifts by" in trial.reason
    near = changed(default, tmp_path / "near", drifting(0.99 * allowed))
    assert judge.trial(0.15, near).verdict == "stable"
    drifts = changed(reference, tmp_path / "reference", drifting(2.0 * allowed))
    assert Judge(drifts, Criterion()).drift == pytest.approx(3.0 * allowed)


@pytest.mark.slow
def test_problem_limits_are_judged(first_search, tmp_path, monkeypatch):
    _, target = first_search
    reference, default = target / "physics.C=0.0375", target / "default"
    bound = {"momentum_change": base.Limit(0.5, "a test"), "no_figure": base.Limit(1.0, "none")}
    problem = type(Judge(reference, Criterion()).state.config.problem)
    monkeypatch.setattr(problem, "limits", problem.limits | bound)

    def moving(by):
        return lambda summary: summary["conservation"].update(momentum_change=by)

    judge = Judge(changed(reference, tmp_path / "reference", moving(0.1)), Criterion())
    assert judge.figures == {
        "momentum_change": bound["momentum_change"]
    }  # the other is no figure of these runs
    assert "momentum change at most 0.5" in judge.in_words()
    keeps = judge.trial(0.15, changed(default, tmp_path / "keeps", moving(0.49)))
    assert keeps.verdict == "stable"
    for word, by in (("breaks", 0.51), ("none", None)):
        trial = judge.trial(0.15, changed(default, tmp_path / word, moving(by)))
        assert trial.verdict == "beyond"
        assert trial.reason.startswith("momentum change is ")
        assert trial.reason.endswith(", more than 0.5")
    breaks = Judge(changed(reference, tmp_path / "too", moving(0.6)), Criterion())
    assert breaks.figures["momentum_change"].bound == pytest.approx(0.9)


@pytest.mark.slow
def test_figures_without_exact_solution_compared_with_reference(tmp_path):
    """A mode may be a hundredth of the flow: in the fields its loss would not be seen."""
    path = tmp_path / "four.toml"
    path.write_text(
        '[problem]\nname = "particles"\n[time]\nend = 0.05\n[output]\ninterval = 0.05\n'
    )
    reference = Trials(path, "physics.C", (), tmp_path / "out", Criterion(), 1).judge.directory

    def with_mode(name, value):
        return changed(
            reference, tmp_path / name, lambda summary: summary["report"].update(mode=value)
        )

    judge = Judge(with_mode("has", 0.02), Criterion())
    assert judge.trial(0.15, with_mode("keeps", 0.0191)).verdict == "stable"
    for name, value in (("loses", 0.0189), ("gains", 0.0211), ("none", "nan")):
        trial = judge.trial(0.15, with_mode(name, value))
        assert trial.verdict == "beyond"
        assert trial.reason == f"mode is {float(value):.3g}, the reference's 0.02"
    assert Trials(path, "physics.eta", (), tmp_path / "out", Criterion(), 1).judge.report == {}


@pytest.mark.slow
def test_shortened_search_lists_skipped_runs(tmp_path):
    path = tmp_path / "four.toml"
    path.write_text(
        '[problem]\nname = "particles"\n[time]\nend = 0.05\n[output]\ninterval = 0.05\n'
    )
    short = ("time.end=0.02",)
    found = command.run(path, "physics.C", short, tmp_path / "out", ("resolution=3",), 1)
    assert (found.end, found.whole_end) == (0.02, 0.05)
    assert "runs to t = 0.02 of time.end = 0.05: later times were not tested. " in table.in_words(
        found
    )


@pytest.mark.slow
def test_errors_below_fraction_of_field_are_ignored(first_search, tmp_path):
    """Against a reference without errors: of velocity, a part of the mean |v| + c_s."""
    _, target = first_search

    def exact(summary):
        for norms in summary["errors"]["fields"].values():
            norms["L1"] = 0.0

    judge = Judge(changed(target / "physics.C=0.0375", tmp_path / "exact", exact), Criterion())
    p, gamma = judge.state.particles, 1.4
    sizes = {
        "density": p.density,
        "velocity": np.abs(p.velocity[0]) + np.sqrt(gamma * (gamma - 1) * p.internal_energy),
        "pressure": (gamma - 1) * p.density * p.internal_energy,
        "internal_energy": p.internal_energy,
    }
    volume = p.mass / p.density
    for name, size in sizes.items():
        assert judge.errors[name] == pytest.approx(1e-9 * np.average(size, weights=volume)), name


@pytest.mark.slow
def test_particles_compared_by_id(tmp_path):
    """Runs that order them otherwise, as their lists ask, have no error by that."""
    path = tmp_path / "four.toml"
    path.write_text(
        '[problem]\nname = "particles"\n[time]\nend = 0.05\n[output]\ninterval = 0.05\n'
    )
    judge = Trials(path, "physics.C", (), tmp_path / "out", Criterion(), 1).judge
    turned = RunDirectory(changed(judge.directory, tmp_path / "turned", lambda summary: None))
    state = checkpoints.read(turned.latest())
    for array in state.particles.arrays().values():
        array[...] = array[..., ::-1].copy()
    checkpoints.write(turned.latest(), state)
    assert judge.trial(0.0375, turned.path).error == 0.0


def test_help_and_document_list_all_limits():
    text = Path(__file__).parents[3].joinpath("docs/stability.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| `(\w+)` \| ([\de.+-]+) \|", text, re.MULTILINE))
    assert {name: float(value) for name, value in told.items()} == Criterion._field_defaults
    said = CliRunner().invoke(main, ["stability", "--help"]).output
    assert all(name in said for name in Criterion._fields)


def test_criterion_uses_options():
    assert Criterion.of(["deviation=0.1"]).deviation == 0.1
    with pytest.raises(ConfigError, match="expected a number above 1"):
        Criterion.of(["resolution=many"])
