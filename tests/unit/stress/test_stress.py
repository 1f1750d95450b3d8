"""The stress suite: cases as files, and verdicts on runs of an artificial case."""

import json
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

import sph
from sph import config as configuration
from sph.cli import main
from sph.errors import ConfigError
from sph.stress import case as cases
from sph.stress import command, figures
from sph.stress.case import Bound
from sph.sweep.task import Outcome

# Gas at rest on a lattice, where nothing happens, so that each figure is known beforehand.
STILL = """\
title = "gas at rest"
hard = "it is not: it shows the verdicts"
[problem]
name = "uniform"
dimension = 1
n = 20
[physics]
C = 0.15
[time]
end = 0.02
[output]
interval = 0.02
[limits]
"change.internal_energy" = { at_most = 1e-6, why = "nothing happens" }
"history.max_density.max" = { at_most = 2.0, why = "the density is 1" }
[reaches]
"errors.density.L1" = { ideal = 0.0, why = "the lattice sums to 0.25 % too much" }
[settings.right]
about = "passes"
"""
IMPOSSIBLE = """
[settings.impossible]
about = "no density is below one half"
limits = { "history.max_density.max" = { at_most = 0.5, why = "it cannot be kept" } }
"""
CAUGHT = """
[settings.caught]
about = "the same, written to fail"
limits = { "history.max_density.max" = { at_most = 0.5, why = "it cannot be kept" } }
fails = { limit = "history.max_density.max", because = "the density is 1" }
[settings.refused]
about = "a support wider than the box allows"
set = ["problem.boundary=mirror", "physics.eta=5e4"]
fails = { exit = "times the shortest side", because = "it holds fewer particles than asked for" }
[settings.overflown]
about = "numbers near the largest there are"
set = ["problem.noise=0.5", "problem.pressure=1e300"]
fails = { exit = "particle", because = "products of them are not finite" }
"""
UNEXPECTED = """
[settings.unexpected]
about = "keeps the limit that it is to break"
fails = { limit = "history.max_density.max", because = "we believe so" }
"""
OTHERWISE = """
[settings.otherwise]
about = "breaks another limit than the one written"
limits = { "steps" = { at_most = 0, why = "it cannot be kept" } }
fails = { limit = "history.max_density.max", because = "we believe so" }
"""


@pytest.fixture
def stress(tmp_path, monkeypatch):
    """stress(text): write that case, run the suite; the click result and the records by setting."""
    monkeypatch.setattr(cases, "FOLDER", tmp_path)

    def run(text, *arguments):
        (tmp_path / "still.toml").write_text(text)
        target = tmp_path / "out"
        result = CliRunner().invoke(main, ["stress", "-o", str(target), *arguments])
        (found,) = json.loads((target / "stress.json").read_text())["cases"]
        return result, found, {one["setting"]: one for one in found["settings"]}

    return run


@pytest.mark.slow
def test_suite_with_expected_verdicts_exits_with_0(stress, tmp_path):
    result, case, settings = stress(STILL + CAUGHT)
    assert result.exit_code == 0, result.output
    assert case["passes"]
    assert settings["right"]["verdict"] == "pass"
    assert {settings[name]["verdict"] for name in ("caught", "refused", "overflown")} == {
        "expected failure"
    }
    assert settings["caught"]["reason"].startswith("the density is 1 (")
    assert "1 of 1 cases pass; 3 expected failures;" in result.output
    # the floor of the density sum of a lattice at eta = 1.6 in one dimension, 1.002456
    assert settings["right"]["reaches"]["errors.density.L1"]["value"] == pytest.approx(
        0.002456, abs=1e-6
    )
    assert "still reaches errors.density.L1 = 0.00246 (right); exact: 0." in (result.output)
    assert "| still | right | grad_h | pass |" in (tmp_path / "out" / "stress.md").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "setting", "verdict"),
    [
        (IMPOSSIBLE, "impossible", "falls short"),
        (UNEXPECTED, "unexpected", "unexpected pass"),
        (OTHERWISE, "otherwise", "unexpected failure"),
    ],
)
def test_case_with_unexpected_verdict_exits_with_3(stress, more, setting, verdict):
    result, case, settings = stress(STILL + more)
    assert result.exit_code == 3, result.output
    assert not case["passes"]
    assert settings["right"]["verdict"] == "pass"
    assert settings[setting]["verdict"] == verdict
    assert "0 of 1 cases pass; 0 expected failures;" in result.stderr
    assert f"Not passed: still ({setting} {verdict})." in result.stderr


@pytest.mark.slow
def test_finished_case_is_judged_without_running_again(stress, tmp_path):
    stress(STILL)
    summary = tmp_path / "out" / "still" / "still.right" / "summary.json"
    before = summary.stat().st_mtime_ns
    result, _, settings = stress(STILL + IMPOSSIBLE)
    assert result.exit_code == 3
    assert set(settings) == {"right", "impossible"}
    result, _, settings = stress(STILL.replace("at_most = 2.0", "at_most = 0.9") + IMPOSSIBLE)
    assert "2 of 2 runs are done already" in result.stderr
    assert settings["right"]["verdict"] == "falls short"
    assert summary.stat().st_mtime_ns == before


@pytest.mark.slow
def test_set_applies_to_all_settings_and_is_not_changed_in_a_directory(stress, tmp_path):
    own = STILL + 'set = ["physics.C=0.1"]\n'
    options = ("--set", "run.precision=single", "--set", "physics.C=0.2")
    result, _, _ = stress(own, *options)
    assert result.exit_code == 0, result.output
    found = configuration.load(tmp_path / "out" / "still" / "still.right" / "config.toml")
    assert found.run.precision == "single"
    assert found.physics.C == 0.1  # of the setting
    result, _, _ = stress(own)
    assert result.exit_code == 2
    assert 'run.precision = "single" there, "double" now' in result.stderr


@pytest.mark.slow
def test_only_named_cases_run(stress):
    result, _, _ = stress(STILL, "--only", "st*")
    assert result.exit_code == 0
    result = CliRunner().invoke(main, ["stress", "--only", "stil"])
    assert result.exit_code == 2
    assert 'there is no case "stil"' in result.stderr
    assert "still" in result.stderr.removeprefix('sph: there is no case "stil"')


@pytest.mark.parametrize(
    ("bound", "inside", "outside"),
    [
        (Bound(at_most=1.0, why="-"), 1.0, 1.1),
        (Bound(at_least=-1.0, why="-"), -1.0, -1.1),
        (Bound(at_least=0.5, why="-"), 0.6, -0.1),
        (Bound(at_least=2.0, at_most=3.0, why="-"), 2.9, 1.9),
        (Bound(at_least=-3.0, at_most=3.0, why="-"), -2.9, -3.1),
    ],
)
def test_bound_holds_inside_only(bound, inside, outside):
    assert bound.holds(inside)
    assert bound.closeness(inside) <= 1.0
    for value in (outside, float("nan")):
        assert not bound.holds(value)
        assert bound.closeness(value) >= 1.0


PYTHON_SAYS = r"(?<=TOML: ).*"  # differs between versions of Python


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        ("at_most = 2.0, ", "", "at_least"),
        ("[settings.right]", "[[settings]]", "settings"),
        ("title = ", "tilte = ", "tilte"),
        ("title = ", 'name = "other"\ntitle = ', "name"),
        ("at_most = 1e-6", 'at_most = "few"', "at_most"),
        ("about = ", "about = [", "TOML"),
        ("history.max_density.max", "history.max_density.max", None),
    ],
)
def test_invalid_case_file_is_refused(messages, old, new, fact, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(STILL.replace(old, new))
    if fact is None:
        assert cases.read(path).name == "case"
        return
    with messages.raised(ConfigError, path, fact, mask=PYTHON_SAYS):
        cases.read(path)


def test_case_with_no_expected_pass_is_refused(messages, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(STILL + 'fails = { limit = "conservation.energy_drift_max", because = "so" }\n')
    with messages.raised(ConfigError, "settings"):
        cases.read(path)
    path.write_text(STILL + 'fails = { limit = "report.none", because = "so" }\n')
    with messages.raised(ConfigError, "settings.right.fails.limit", "report.none"):
        cases.read(path)


@pytest.mark.parametrize("name", cases.names())
def test_shipped_case_is_valid(name, tmp_path):
    (case,) = cases.load([name])
    base = tmp_path / "base.toml"
    base.write_text(case.to_toml())
    for setting in case.settings:
        configuration.load(base, case.settings[setting].set)
        for figure in (*case.bounds(setting), *case.reaches):
            assert figure.partition(".")[0] in figures.KINDS, figure


def test_shipped_cases_are_package_data():
    project = tomllib.loads((Path(sph.__file__).parents[1] / "pyproject.toml").read_text())
    patterns = project["tool"]["setuptools"]["package-data"]["sph.stress"]
    package = Path(sph.__file__).parent / "stress"
    assert {path.stem for one in patterns for path in package.glob(one)} == set(cases.names())
    assert cases.names()


def test_unknown_case_is_refused(messages):
    with messages.raised(ConfigError):
        cases.load(["no_such_case"])


def test_case_with_unwritable_run_has_no_verdict(tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "FOLDER", tmp_path)
    (tmp_path / "still.toml").write_text(STILL)
    refused = Outcome("still.right", "failed", "cannot write x: No space left on device.", "run", 4)
    monkeypatch.setattr(command.local, "run", lambda tasks, jobs, tell: tell(refused))
    result = CliRunner().invoke(main, ["stress", "-o", str(tmp_path / "out")])
    assert result.exit_code == 4
    assert "still.right: cannot write x: No space left" in result.stderr
    assert not (tmp_path / "out" / "stress.json").exists()
