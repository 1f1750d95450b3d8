"""Warnings: every kind by a scene that gives it, and a shipped scene that gives none."""

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from sph import warnings
from sph.cli import main
from sph.problems.base import Limit

DOCUMENT = Path(__file__).parents[2] / "docs" / "warnings.md"

SCENES = {
    # gas at rest, disturbed, with 2.6 neighbours on average
    "volume": """
[problem]
name = "uniform"
dimension = 1
n = 100
noise = 0.2
[physics]
eta = 0.8
""",
    # cold streams that meet in steps which resolve the heating of neither; energy_limit would
    "energy_drift": """
[problem]
name = "noh"
n = 100
[physics]
alpha = 2.0
C = 0.3
energy_limit = false
max_energy_drift = 1.0
[time]
end = 0.3
[output]
interval = 0.3
""",
    # open on all sides, with supports that are to stay as narrow as the ball
    "held_supports": """
[problem]
name = "expanding_ball"
dimension = 2
n = 100
[physics]
max_support = 0.5
[time]
end = 1.0
""",
    # a box so far from 0 that a spacing of 0.01 holds 84,000 numbers
    "resolution": """
[problem]
name = "uniform"
dimension = 1
n = 100
domain = [1e9, 1000000001.0]
""",
    # a kernel and an eta that a configuration refuses unless it is asked for
    "paired": """
[problem]
name = "uniform"
n = 400
noise = 0.2
[physics]
kernel = "cubic_spline"
eta = 2.2
allow_pairing = true
[time]
end = 10.0
[output]
interval = 10.0
""",
    # half of the particles with which the shipped configuration keeps its limits
    "limit": """
[problem]
name = "noh"
n = 50
""",
    # a plate whose end is as fast as sound
    "torn": """
[problem]
name = "oscillating_plate"
n = 250
tip_velocity = 100.0
[physics]
allow_tearing = true
max_energy_drift = 1.0
[time]
end = 0.004
[output]
interval = 0.004
""",
    # a wave of amplitude 1e-6 on a glass, whose noise is a hundred times as large
    "swamped": """
[problem]
name = "sound_wave"
dimension = 2
n = 400
lattice = "relaxed"
[time]
end = 0.05
""",
}


def sph(*arguments):
    return CliRunner().invoke(main, [*map(str, arguments)])


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory):
    """finished_run(kind): the result and the run directory of its scene, run once."""
    kept = {}

    def once(kind):
        if kind not in kept:
            folder = tmp_path_factory.mktemp(kind)
            (folder / "scene.toml").write_text(SCENES[kind])
            kept[kind] = sph("run", folder / "scene.toml", "-o", folder / "run"), folder / "run"
        return kept[kind]

    return once


@pytest.mark.parametrize("kind", SCENES)
def test_run_of_each_kind_ends_with_its_warning(finished_run, kind):
    result, run = finished_run(kind)
    assert result.exit_code == 0
    told = json.loads((run / "summary.json").read_text())["warnings"]
    assert kind in [one["kind"] for one in told]
    count = f"{len(told)} warning{'s' * (len(told) > 1)}"
    first, *others = result.stdout.splitlines()
    assert first.endswith(f"(done, with {count}).")
    assert others[: len(told)] == [f"Warning: {one['text']}" for one in told]
    said = re.search(r"^sph: .* ended with warnings: (.*) \(see docs/warnings\.md\)\.$",
                     result.stderr, re.MULTILINE)  # fmt: skip
    assert kind in said[1].split(", ")


def test_strict_with_warnings_exits_with_3(finished_run, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENES["limit"])
    result = sph("run", scene, "-o", tmp_path / "run", "--strict")
    assert result.exit_code == 3
    assert "ended with warnings: limit" in result.stderr
    # the run itself is done and complete
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["status"] == "done"
    assert sph("report", tmp_path / "run").exit_code == 0


def test_valid_run_passes_with_and_without_strict(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text('[problem]\nname = "shock_tube"\nn = 60\n')
    result = sph("run", scene, "-o", tmp_path / "run", "--strict")
    assert result.exit_code == 0
    assert result.stdout.splitlines()[0].endswith("(done).")
    assert "warning" not in (result.stdout + result.stderr).lower()


@pytest.mark.slow
def test_reports_and_sweeps_mark_runs_with_warnings(finished_run, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENES["limit"])
    swept = sph("sweep", scene, "--vary", "problem.n=50,100", "-o", tmp_path / "sweep", "--jobs", 1)
    assert re.search(r"problem\.n=50 done, with warnings: limit$", swept.stderr, re.MULTILINE)
    assert re.search(r"problem\.n=100 done$", swept.stderr, re.MULTILINE)
    assert "2 of 2 points are done, 1 of them ended with warnings." in swept.stdout
    report = sph("report", tmp_path / "sweep").stdout
    header, coarse, fine = report.splitlines()[:3]
    assert header.split()[-1] == "warnings"
    assert (coarse.split()[-1], fine.split()[-1]) == ("limit", "–")
    assert "Ended with warnings (hollow in the pictures): problem.n=50 (limit)." in report


def test_every_kind_is_documented():
    kinds = set(re.findall(r'Warning\(\s*"(\w+)"', Path(warnings.__file__).read_text()))
    rows = set(re.findall(r"^\| `(\w+)` \|", DOCUMENT.read_text(), re.MULTILINE))
    assert kinds == rows
    # momentum is conserved by every pair force there is: no scene can lose it
    assert kinds - {"momentum"} <= set(SCENES)


KEPT = {
    "energy_drift": 0.0, "energy_drift_max": 0.0, "energy_injected": 0.0, "momentum_change": 0.0,
    "volume_ratio": 1.0, "volume_ratio_worst": 1.0,
}  # fmt: skip


class FakeSimulation:
    """What a warning looks at of a simulation, and nothing amiss in it."""

    def __init__(self, limits=None, swamped=None, precision="double", inexact=()):
        self.held_supports = 0
        self.max_support, self.number = 0.125, 40
        self.scene = self.config = self.problem = self.particles = self.run = self
        self.precision = precision
        self.formulation, self.neighbours_key = self, "physics.eta"
        self.inexact_momentum = inexact
        self.swamped = swamped or {}
        self.allowed = lambda: limits or {}


@pytest.fixture
def kinds_of(monkeypatch):
    """kinds_of(kept, report, ...): the kinds of warning for figures of a summary."""
    monkeypatch.setattr(warnings.resolution, "doubt", lambda _: None)  # there are no particles

    def kinds(kept=(), report=None, median=1.0, **of_problem):
        summary = {
            "conservation": KEPT | dict(kept), "errors": None, "report": report or {},
            "nearest": {"median": median, "smallest": 0.0},
        }  # fmt: skip
        return [one.kind for one in warnings.of_run(FakeSimulation(**of_problem), summary)]

    return kinds


@pytest.mark.parametrize(
    ("kept", "expected"),
    [
        ({}, []),
        ({"energy_drift_max": 0.99e-3}, []),
        ({"energy_drift_max": 1.01e-3}, ["energy_drift"]),
        ({"energy_drift_max": float("nan")}, ["energy_drift"]),
        ({"momentum_change": 0.9e-6}, []),
        ({"momentum_change": 1.1e-6}, ["momentum"]),
        ({"momentum_change": None}, []),
        ({"volume_ratio": 0.945}, []),
        ({"volume_ratio": 0.935}, ["volume"]),
        ({"volume_ratio": 1.065}, ["volume"]),
        ({"volume_ratio": None}, []),
        # what it was on the way, as particles settled, is no matter
        ({"volume_ratio_worst": 0.5}, []),
    ],
)
def test_conserved_quantity_beyond_bound_warns(kinds_of, kept, expected):
    assert kinds_of(kept) == expected


def test_momentum_in_single_precision_has_limit_of_its_own(kinds_of):
    limits = {"momentum_change": Limit(1e-12, "only round-off")}
    single = {"limits": limits, "precision": "single"}
    assert kinds_of({"momentum_change": 0.9e-6}, limits=limits) == ["limit"]
    assert kinds_of({"momentum_change": 0.9e-4}, **single) == []
    assert kinds_of({"momentum_change": 1.1e-4}, **single) == ["momentum"]


def test_momentum_that_is_not_exact_has_limit_of_its_own(kinds_of):
    inexact = {"inexact": ["self-gravity", "individual time steps"]}
    assert kinds_of({"momentum_change": 0.9e-3}, **inexact) == []
    assert kinds_of({"momentum_change": 1.1e-3}, **inexact) == ["momentum"]


def test_nearest_neighbour_below_half_spacing_warns_of_pairs(kinds_of):
    assert kinds_of(median=0.49) == ["paired"]
    assert kinds_of(median=0.51) == []  # particles at random places begin with .54


@pytest.fixture
def texts_of(monkeypatch):
    """texts_of(simulation, **summary): the warnings of a run by their kinds, in order."""
    monkeypatch.setattr(warnings.resolution, "doubt", lambda _: "far from 0")
    whole = {
        "conservation": KEPT, "errors": None, "report": {}, "nearest": {"median": 1.0},
    }  # fmt: skip

    def made(simulation=None, **changed):
        found = warnings.of_run(simulation or FakeSimulation(), whole | changed)
        return {one.kind: one.text for one in found}

    return made


def test_warning_text_has_numbers_of_run(messages, texts_of):
    alone = FakeSimulation()
    alone.held_supports = 3
    wrong = {"energy_drift_max": 0.0213, "momentum_change": 0.5, "volume_ratio": 0.8}
    found = texts_of(alone, conservation=KEPT | wrong, nearest={"median": 0.25, "smallest": 0.1})
    assert list(found) == [
        "energy_drift", "momentum", "volume", "held_supports", "resolution", "paired",
    ]  # fmt: skip
    numbers = {
        "energy_drift": ["2.1 %", "0.1 %"],
        "momentum": ["0.5"],
        "volume": ["0.8", "25 %"],  # densities are too high by what volumes are too small: 1/0.8
        "held_supports": ["3", "40", "0.125"],
        "resolution": ["far from 0"],
        "paired": ["0.25"],
    }
    for kind, expected in numbers.items():
        assert all(number in found[kind] for number in expected), kind
    messages.check("\n".join(f"{kind}: {text}" for kind, text in found.items()))


@pytest.mark.parametrize("wrong", ["momentum_change", "volume_ratio"])
def test_nan_quantity_warns(texts_of, wrong):
    kind = wrong.partition("_")[0]
    assert kind in texts_of(conservation=KEPT | {wrong: float("nan")})


def test_pairs_judged_by_median_not_single_pair(texts_of):
    assert "paired" not in texts_of(nearest={"median": 0.9, "smallest": 0.0})
    assert "paired" not in texts_of(nearest=None)  # of a run that failed


def test_limit_warning_has_side_and_reason(messages, texts_of):
    limits = {"high": Limit(2.0, "as so"), "low": Limit(2.0, "as so", at_least=True)}
    found = texts_of(FakeSimulation(limits=limits), report={"high": 2.5, "low": 2.5})
    assert found["limit"].startswith("high ")
    messages.check(found["limit"])
    found = texts_of(FakeSimulation(limits=limits), report={"high": 1.5, "low": 1.5})
    assert found["limit"].startswith("low ")
    messages.check(found["limit"])
    assert "limit" not in texts_of(FakeSimulation(limits=limits), report={"high": 2.0, "low": 2.0})


def test_lost_signal_warning_comes_first(messages, texts_of):
    lost = FakeSimulation(swamped={"wave": Limit(0.5, "half of it")})
    found = texts_of(lost, report={"wave": 0.75}, conservation=KEPT | {"energy_drift_max": 1.0})
    assert list(found)[:2] == ["swamped", "energy_drift"]
    assert "0.75" in found["swamped"]
    messages.check(found["swamped"])


def test_limit_warning_without_lost_signal(kinds_of):
    both = {"limits": {"wave": Limit(0.1, "so")}, "swamped": {"wave": Limit(0.5, "so")}}
    assert kinds_of(report={"wave": 0.2}, **both) == ["limit"]
    assert kinds_of(report={"wave": 0.6}, **both) == ["swamped"]


def test_kinds_listed_once_in_order_without_old_summaries():
    told = [{"kind": kind} for kind in ("volume", "limit", "limit", "energy_drift", "volume")]
    assert warnings.kinds({"warnings": told}) == ["volume", "limit", "energy_drift"]
    assert warnings.kinds({}) == []


@pytest.mark.parametrize(("at_least", "value", "holds"), [
    (False, 1.0, True), (False, 1.1, False), (False, float("nan"), False),
    (True, 1.0, True), (True, 0.9, False), (True, float("nan"), False),
])  # fmt: skip
def test_limit_holds_at_bound_and_fails_for_nan(at_least, value, holds):
    assert Limit(1.0, "so", at_least).holds(value) == holds


def test_figure_warns_once(kinds_of):
    drift = {"energy_drift": Limit(1e-4, "so")}
    assert kinds_of({"energy_drift_max": 5e-4}, limits=drift) == ["limit"]
    assert kinds_of({"energy_drift_max": 5e-3}, limits=drift) == ["energy_drift"]
    ratio = {"limits": {"g": Limit(0.6, "so", at_least=True)},
             "swamped": {"g": Limit(0.2, "so", at_least=True)}}  # fmt: skip
    assert [kinds_of(report={"g": g}, **ratio) for g in (0.7, 0.5, 0.1)] == [
        [],
        ["limit"],
        ["swamped"],
    ]
    assert kinds_of(report={"other": 1.0}, **ratio) == []  # a run that stopped before it was known
