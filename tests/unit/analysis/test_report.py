"""Reports on runs whose errors and costs are made up, so that what they must say is known."""

import csv
import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from sph import config as configuration
from sph.analysis import report as reports
from sph.analysis.report import front, runs, table, words
from sph.analysis.report.compare import DRIFT
from sph.cli import main
from sph.errors import ConfigError, FileError
from sph.output.run_directory import RunDirectory
from sph.sweep.manifest import SweepDirectory
from sph.sweep.plan import Plan

# A few operations on numbers of order one.
ROUND_OFF = 1e-12


# --- front and fits ---------------------------------------------------------------------------


def test_front_holds_runs_not_beaten_in_cost_and_error():
    cost = np.array([1.0, 2.0, 4.0, 2.0, 4.0, 8.0])
    error = np.array([8.0, 4.0, 2.0, 5.0, 4.0, 2.0])
    #   worse than the second at its cost; dearer than the second at its error; than the third
    assert front.on_front(cost, error).tolist() == [True, True, True, False, False, False]


def test_front_equal_runs_are_both_on_it():
    assert front.on_front(np.array([1.0, 1.0]), np.array([2.0, 2.0])).all()


def test_front_between_runs_is_power_law():
    """cost = 16 / error^2 through the two runs gives 16/9 at 3, and nothing cheaper at 10."""
    cost, error = np.array([1.0, 4.0]), np.array([4.0, 2.0])
    assert front.cost_at(3.0, cost, error) == pytest.approx(16 / 9, rel=ROUND_OFF)
    assert front.cost_at(10.0, cost, error) == pytest.approx(1.0, rel=ROUND_OFF)
    with pytest.raises(ValueError, match="does not reach"):
        front.cost_at(1.9, cost, error)


def test_excess_is_cost_over_front_cost_at_equal_error():
    cost = np.array([1.0, 4.0, 16 / 3, 3.0, 1.0])
    error = np.array([4.0, 2.0, 3.0, 10.0, 5.0])
    # off the front: 16/3 over 16/9; 3 over the cheapest; as cheap as the cheapest but worse
    assert front.excess(cost, error) == pytest.approx([1.0, 1.0, 3.0, 3.0, 1.0], rel=ROUND_OFF)
    assert front.on_front(cost, error).tolist() == [True, True, False, False, False]


def test_excess_is_at_least_one():
    random = np.random.default_rng(1)
    cost, error = np.exp(random.normal(size=(2, 200)))
    assert front.excess(cost, error).min() >= 1.0 - ROUND_OFF


def test_fit_power_law_gives_exponents():
    x = np.array([1.0, 2.0, 4.0])
    assert front.slope(x, 3.0 * x**-1.5) == pytest.approx(-1.5, rel=ROUND_OFF)
    # least squares: a middle point that is off shifts the line, and does not turn it
    assert front.slope(x, np.array([1.0, 5.0, 4.0])) == pytest.approx(1.0, rel=ROUND_OFF)
    assert front.slope(np.array([2.0, 2.0]), np.array([1.0, 3.0])) is None
    assert front.slope(np.array([2.0]), np.array([1.0])) is None


# --- runs that are made up --------------------------------------------------------------------


def write_run(path, error, cpu, overrides=(), status="done", **changes):
    """A run directory as `sph run` leaves it; 10 s of CPU time compile, 1 s starts Numba."""
    (path.parent / "base").mkdir(parents=True, exist_ok=True)
    base = path.parent / "base" / "base.toml"
    base.write_text('[problem]\nname = "shock_tube"\n')
    config = configuration.load(base, overrides)
    run = RunDirectory.create(path)
    run.write_config(config.to_toml())
    norms = (
        {"L1": error, "L2": 2 * error, "Linf": 3 * error, "relative_L1": None} if error else None
    )
    n = config.problem.n
    session = {
        "steps": 100, "updates": 100 * n, "compile_cpu_seconds": 10.0, "cpu_seconds": cpu,
        "phases_cpu_seconds": {"start of Numba": 1.0, "density": cpu / 2, "rates": cpu / 4},
        "updates_per_cpu_second": None, "wall_seconds": cpu / 2 + 11.0, "list_builds": 3,
        "peak_memory_bytes": 10**8,
    }  # fmt: skip
    summary = {
        "status": status, "reason": None, "problem": "shock_tube", "steps": 100,
        "dimension": config.problem.dimension, "particles": n, "time": 0.2,
        "errors": norms and {"region": "all", "particles": n, "fields": {"density": norms}},
        "errors_left_out": None, "nearest": None, "warnings": [], "lineage": [],
        "settings_changed": [], "version": "0", "compiled_in": [], "left_out": [],
        "report": {"radius_error": -error if error else 0.0},
        "conservation": {"energy_drift": -1e-5, "energy_drift_max": 2e-5, "momentum_change": None,
                         "energy_injected": 0.0, "volume_ratio": None, "volume_ratio_worst": None},
        "cost": {"cpu_seconds": cpu, "wall_seconds": cpu / 2 + 11.0, "threads": 2,
                 "session": session},
    }  # fmt: skip
    run.write_summary(summary | changes)
    return run.path


def test_runs_without_exact_solution_are_compared_by_energy_drift(tmp_path):
    for n in (100, 200):
        write_run(tmp_path / f"n={n}", None, 1.0, [f"problem.n={n}"])
    assert compared(tmp_path).error.tolist() == [2e-5, 2e-5]
    assert "No run has errors: --reference DIR" in said(compared(tmp_path))
    write_run(tmp_path / "n=400", 0.25, 1.0, ["problem.n=400"])
    assert "No run has errors" not in said(compared(tmp_path, field=DRIFT))
    assert compared(tmp_path).error.tolist() == [0.25]  # where a run has errors, these


@pytest.fixture
def study(tmp_path):
    """Error = 100/N and CPU = (N/100)^2 for alpha = 1; thrice the time for alpha = 2."""
    for alpha, factor in ((1.0, 1.0), (2.0, 3.0)):
        for n in (100, 200, 400):
            write_run(tmp_path / "study" / f"n={n},alpha={alpha}", 100 / n, factor * (n / 100) ** 2,
                      [f"problem.n={n}", f"physics.alpha={alpha}"])  # fmt: skip
    return tmp_path / "study"


def compared(*sources, **question):
    return reports.make(sources, reports.Question(**question))


def said(report):
    return "\n".join(words.sentences(report))


def test_costs_exclude_compiling_and_starting(tmp_path):
    (row,) = runs.read([write_run(tmp_path / "run", 0.1, 5.0, ["problem.n=100"])])
    assert row.cost == {"cpu": 5.0, "wall": 2.5, "updates": 10_000, "n": 100}


def test_varied_keys_are_found(study, tmp_path):
    rows = runs.read([study])
    assert runs.varied_keys(rows) == ["problem.n", "physics.alpha"]
    assert [row.n for row in rows[:3]] == [100, 100, 200]  # n=100 before n=200
    # threads change no result, and what goes with the problem's name says nothing more
    rows = runs.read([
        write_run(tmp_path / "a" / "1", 0.1, 1.0, ["run.threads=1"]),
        write_run(tmp_path / "a" / "2", 0.1, 1.0, ["problem.name=uniform", "run.threads=2"]),
    ])  # fmt: skip
    assert runs.varied_keys(rows) == ["problem.name"]


def test_model_parameters_shown_only_where_varied(tmp_path):
    flattened = "physics.kernel={name = 'cubic_spline', flattened = %s}"
    paths = [
        write_run(tmp_path / "s" / "1", 0.1, 1.0, [flattened % "true"]),
        write_run(tmp_path / "s" / "2", 0.1, 1.0, ["physics.kernel=wendland_c2"]),
    ]
    assert [row.value("physics.kernel") for row in runs.read(paths)] == [
        "cubic_spline",
        "wendland_c2",
    ]
    write_run(tmp_path / "s" / "3", 0.1, 1.0, [flattened % "false"])
    assert [row.value("physics.kernel") for row in runs.read([tmp_path / "s"])] == [
        "cubic_spline(flattened=true)",
        "wendland_c2",
        "cubic_spline(flattened=false)",
    ]


RELAXED = {"iterations": 70, "density_error": 8e-4, "mean_offset": 5e-3, "cpu_seconds": 0.5}


@pytest.fixture
def on_glass(tmp_path):
    """A vortex on a lattice, and on a glass of two seeds."""
    for seed, ended in ((None, {}), (0, {"relaxation": RELAXED}), (1, {"relaxation": RELAXED})):
        relax = "none" if seed is None else f"{{seed = {seed}}}"
        keys = ["problem.name=uniform", "problem.dimension=2", f"problem.relax={relax}"]
        write_run(tmp_path / "s" / relax, 0.1, 2.0, keys, **ended)
    return tmp_path / "s"


def test_table_that_some_runs_lack_is_shortened(on_glass):
    assert [line.label for line in compared(on_glass).series] == [
        "relax = none", "relax = {seed=0}", "relax = {seed=1}",
    ]  # fmt: skip
    fewer = compared(*(on_glass / one for one in ("none", "{seed = 0}")))
    assert [line.label for line in fewer.series] == ["relax = given", "relax = none"]


def test_relaxation_is_stated_in_table_words_and_records(on_glass):
    report = compared(on_glass)
    header, *lines = table.cells(report)
    at = header.index("relaxation CPU s")
    assert [line[at] for line in lines] == ["–", "0.5", "0.5"]
    assert "relaxation to a glass: 0.5 CPU s, 0.25 of the CPU time of these runs" in said(report)
    records = json.loads(table.as_json(report, []))["runs"]
    assert [one.get("relaxation.density_error") for one in records] == [None, 8e-4, 8e-4]
    by_updates = compared(on_glass, cost="updates")
    assert "besides the particle updates" in said(by_updates)
    by_residual = compared(on_glass, field="relaxation.density_error")
    assert by_residual.error.tolist() == [8e-4, 8e-4]


def test_run_given_twice_counts_once(study):
    assert len(runs.read([study, study / "n=100,alpha=1.0"])) == 6


def test_study_has_series_front_and_orders(study):
    report = compared(study)
    first, second = report.series
    assert (first.label, second.label) == ("alpha = 1.0", "alpha = 2.0")
    assert [report.rows[i].n for i in first.members] == [100, 200, 400]
    # in 1-D spacing ~ 1/N, and cost ~ N^2
    for line in report.series:
        assert line.order == pytest.approx(1.0, rel=ROUND_OFF)
        assert line.exponent == pytest.approx(-0.5, rel=ROUND_OFF)
    assert report.on_front.tolist() == [True] * 3 + [False] * 3
    assert report.excess == pytest.approx([1.0] * 3 + [3.0] * 3, rel=ROUND_OFF)


def test_order_2d_is_in_particle_spacing(tmp_path):
    plane = ["problem.dimension=2"]
    for n in (100, 400):
        write_run(tmp_path / "s" / str(n), 100 / n, n / 100.0, [*plane, f"problem.n={n}"])
    (line,) = compared(tmp_path / "s").series
    # error ~ 1/N = spacing^2
    assert line.order == pytest.approx(2.0, rel=ROUND_OFF)


def test_cost_that_grows_more_slowly_than_n_gives_no_exponent(tmp_path):
    from sph.analysis.figures.report_labels import power

    for n, cost in ((100, 0.2), (200, 0.25), (400, 0.3)):
        write_run(tmp_path / "s" / str(n), 100 / n, cost, [f"problem.n={n}"])
    report = compared(tmp_path / "s")
    (line,) = report.series
    assert line.exponent is None
    assert line.order == pytest.approx(1.0, rel=ROUND_OFF)
    assert power(line) == "fixed costs dominate"
    assert "fixed costs dominate these short runs" in said(report)
    assert "error ∝" not in said(report)


def test_words_state_orders_front_and_excess(study):
    text = said(compared(study))
    assert "L1 error of density, plotted against CPU time without compilation" in text
    assert "alpha = 1.0: order 1.00 in the particle spacing, so error ∝ cost^-0.50." in text
    assert "On the front: alpha = 1.0 at N = 100, 200, 400." in text
    assert (
        "alpha = 2.0 is never on the front: 3 times the CPU time of the front "
        "at equal error." in text
    )


def test_words_for_each_standing_relative_to_front(tmp_path):
    directory = tmp_path / "s"
    for alpha, n, error, cpu in (
        (1.0, 100, 1.0, 1.0), (1.0, 200, 0.5, 4.0),
        (2.0, 100, 1.0, 1.05),  # within the scatter of timings
        (3.0, 100, 2.0, 7.0),  # less accurate than all of the front: a bound
        (4.0, 100, 0.8, 1.2), (4.0, 200, 0.5, 8.0),  # once on it
    ):  # fmt: skip
        write_run(directory / f"{alpha},{n}", error, cpu,
                  [f"physics.alpha={alpha}", f"problem.n={n}"])  # fmt: skip
    text = said(compared(directory))
    assert "alpha = 2.0 is never on the front, but within 10% of it." in text
    assert "alpha = 3.0 is never on the front: at least 7 times" in text
    assert "alpha = 4.0 is off the front at N = 200: 2 times the CPU time" in text
    assert "alpha = 4.0 at N = 100" in text.partition("On the front")[2].splitlines()[0]


def test_compare_other_norm_cost_and_field(study):
    largest = compared(study, norm="Linf")
    assert largest.error[0] == pytest.approx(3.0)
    assert "Linf error of density" in said(largest)
    assert compared(study, cost="wall").cost[0] == pytest.approx(0.5)
    by_updates = compared(study, cost="updates")
    # they cost the same updates at the same error: all are on the front
    assert by_updates.on_front.all()
    figure = compared(study, field="report.radius_error")
    assert figure.error[1] == pytest.approx(0.5)
    assert "Compared: report.radius_error" in said(figure)
    by_number = compared(study, by=("problem.n",))
    assert [line.label for line in by_number.series][:2] == ["n = 100", "n = 200"]


def test_by_groups_colours_but_keeps_lines(tmp_path):
    for alpha in (1.0, 2.0):
        for eta in (1.2, 1.6):
            for n in (100, 200):
                keys = [f"physics.alpha={alpha}", f"physics.eta={eta}", f"problem.n={n}"]
                write_run(tmp_path / "s" / f"{alpha},{eta},{n}", alpha * eta / n, float(n), keys)
    report = compared(tmp_path / "s", by=("physics.eta",))
    assert [len(line.members) for line in report.series] == [2, 2, 2, 2]
    assert {line.group for line in report.series} == {"eta = 1.2", "eta = 1.6"}


def test_runs_without_error_are_listed(study, tmp_path):
    write_run(study / "failed", None, 1.0, status="failed", reason="u < 0 of particle 3\nTry: …")
    write_run(study / "inexact", None, 1.0)
    write_run(study / "late", None, 1.0)
    summary = RunDirectory(study / "late").summary
    late = json.loads(summary.read_text()) | {"errors_left_out": "the exact solution ends"}
    summary.write_text(json.dumps(late))
    RunDirectory.create(study / "killed").write_config((study / "failed/config.toml").read_text())
    report = compared(study)
    assert len(report.rows) == 6
    text = said(report)
    assert "Without an error: failed (failed: u < 0 of particle 3)." in text
    assert "Without an error: inexact (it has no L1 error of density)." in text
    assert (
        "Without an error: late (it has no L1 error of density: the exact solution ends)." in text
    )
    assert "Without an error: killed (unfinished: it has not ended)." in text


def test_sweep_points_without_run_are_listed(tmp_path):
    base = tmp_path / "tube.toml"
    base.write_text('[problem]\nname = "shock_tube"\n')
    sweep = SweepDirectory(tmp_path / "sweep")
    sweep.prepare(base, Plan.of(["problem.n=100,200,300"]))
    write_run(tmp_path / "sweep" / "problem.n=100", 0.1, 1.0, ["problem.n=100"])
    (sweep.logs / "problem.n=200.failed").write_text("the disk is full\n")
    (tmp_path / "sweep" / "problem.n=300").symlink_to("problem.n=300")  # to itself
    text = said(compared(tmp_path / "sweep"))
    assert "problem.n=200 (failed: the disk is full)" in text
    assert "problem.n=300 (unfinished: not started)" in text


def test_words_warn_of_restarts_and_different_tasks(study, tmp_path):
    write_run(study / "restarted", 0.3, 50.0, ["problem.n=300"], steps=200)
    write_run(study / "longer", 0.3, 50.0, ["problem.n=300", "time.end=0.3"])
    text = said(compared(study))
    assert "The runs differ in time.end:" in text
    assert "took to start" not in said(compared(study, cost="updates"))


def test_compare_without_usable_runs_gives_empty_report(tmp_path):
    write_run(tmp_path / "s" / "one", None, 1.0, status="failed", reason="u < 0")
    report = compared(tmp_path / "s")
    assert report.rows == []
    assert "Without an error: one" in reports.in_words(report)
    reports.write(report, tmp_path / "out")


def test_compare_unknown_field_key_or_directory_is_refused(messages, study, tmp_path):
    with messages.raised(ConfigError, "--field entropy", "report.radius_error"):
        compared(study, field="entropy")
    with messages.raised(ConfigError, "--by physics", "problem.n", "physics.alpha"):
        compared(study, by=("physics.aplha",))
    with messages.raised(FileError):
        compared(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with messages.raised(FileError):
        compared(tmp_path / "empty")
    point = study / "n=100,alpha=1.0"
    for text in ("{", "[]", '{"status": "done"}', '{"status": "done", "reason": "", "cost": 1}'):
        (point / "summary.json").write_text(text)
        with messages.raised(FileError, "summary.json"):
            compared(study)
    for name in ("config.toml", "summary.json"):
        whole = (point / name).read_bytes()
        (point / name).write_bytes(b"\xff")
        with messages.raised(FileError, name):
            compared(study)
        (point / name).write_bytes(whole)
    (point / "config.toml").write_text("problem = 1\n")
    with messages.raised(FileError, "config.toml"):
        compared(study)
    (point / "config.toml").write_text("problem = \n")
    with messages.raised(FileError, "config.toml", "line 1", mask=r"(?<=TOML: ).*"):
        compared(study)  # what follows are words of Python's reader


def test_front_independent_of_run_order():
    cost, error = np.array([4.0, 1.0, 2.0]), np.array([2.0, 8.0, 4.0])
    # power laws: cost = 8/error, so that 3 takes 8/3
    assert front.cost_at(3.0, cost, error) == pytest.approx(8 / 3, rel=ROUND_OFF)
    assert front.cost_at(2.0, cost, error) == pytest.approx(4.0, rel=ROUND_OFF)


def test_series_sorted_by_value_and_runs_by_n(tmp_path):
    for name, alpha, n in ((1, 10.0, 200), (2, 2.0, 400), (3, 10.0, 80), (4, 2.0, 90)):
        write_run(tmp_path / "s" / f"{name}", 1 / n, float(n),
                  [f"physics.alpha={alpha}", f"problem.n={n}"])  # fmt: skip
    report = compared(tmp_path / "s")
    assert [line.label for line in report.series] == ["alpha = 2.0", "alpha = 10.0"]
    assert [row.n for row in report.rows] == [90, 400, 80, 200]


def test_varied_keys_ignore_threads_and_include_failed_runs(tmp_path):
    write_run(tmp_path / "s" / "1", 0.1, 1.0, ["run.threads=1"])
    write_run(tmp_path / "s" / "2", 0.1, 1.0, ["run.threads=2"])
    assert runs.varied_keys(runs.read([tmp_path / "s"])) == []
    write_run(tmp_path / "s" / "3", None, 1.0, ["physics.alpha=2.0"], status="failed")
    (line,) = compared(tmp_path / "s").series
    assert line.label == "alpha = 1.0"


def test_stopped_or_failed_run_with_errors_is_not_compared(study):
    for status in ("stopped", "failed"):
        write_run(study / status, 1e-6, 1e-6, ["problem.n=800"], status=status)
    report = compared(study)
    assert report.on_front.sum() == 3
    assert {row.name for row in report.without} == {"stopped", "failed"}


def test_errors_must_be_positive_finite(tmp_path):
    figures = {"negative": -2.0, "zero": 0.0, "true": True, "word": "nan"}
    (row,) = runs.read([write_run(tmp_path / "run", 0.1, 1.0, report=figures)])
    found = {name: row.error(f"report.{name}", "L1") for name in figures}
    assert found == dict.fromkeys(figures) | {"negative": 2.0}
    assert row.error("report", "L1") is None
    assert row.error("density", "L2") == 0.2
    assert row.error("report.negative.more", "L1") is None


def test_errors_against_reference_replace_summary_errors(tmp_path):
    (row,) = runs.read([write_run(tmp_path / "run", 0.1, 1.0)])
    assert row.truth is None
    row.reference = {"reference": "fine", "fields": {"velocity": {"L1": 0.5}}}
    assert (row.truth, row.error("velocity", "L1"), row.error("density", "L1")) == (
        "fine",
        0.5,
        None,
    )
    assert row.figures()[0] == "velocity"


def test_reference_and_unfinished_runs_are_not_compared(study, monkeypatch):
    write_run(study / "stopped", 0.1, 1.0, status="stopped")
    fine, asked = study / "n=400,alpha=2.0", []

    def errors_of(path, reference):
        asked.append(path.name)
        return {"reference": reference, "fields": {"density": {"L1": 0.5}}}

    monkeypatch.setattr("sph.analysis.reference.Reference", str)
    monkeypatch.setattr("sph.analysis.reference.errors_of", errors_of)
    report = compared(study, reference=fine)
    assert fine.name not in [row.name for row in (*report.rows, *report.without)]
    assert len(asked) == len(report.rows) == 5
    assert "stopped" not in asked
    assert report.error.tolist() == [0.5] * 5


def test_updates_restarted_run_counts_all_steps(tmp_path):
    (row,) = runs.read([write_run(tmp_path / "run", 0.1, 5.0, ["problem.n=100"], steps=250)])
    assert row.cost["updates"] == 25_000
    assert row.is_restarted


def test_words_list_excess_from_least_to_most(tmp_path):
    for alpha, n, error, cpu in (
        (1.0, 100, 1.0, 1.0), (1.0, 200, 0.5, 4.0),
        (2.0, 100, 1.0, 2.0), (2.0, 200, 0.5, 16.0),
        (3.0, 100, 1.0, 1.02), (3.0, 200, 0.5, 12.0),
        (4.0, 100, 2.0, 3.0), (4.0, 200, 0.5, 12.0),
    ):  # fmt: skip
        write_run(tmp_path / "s" / f"{alpha},{n}", error, cpu,
                  [f"physics.alpha={alpha}", f"problem.n={n}"])  # fmt: skip
    text = said(compared(tmp_path / "s"))
    assert "alpha = 2.0 is never on the front: 2 to 4 times the CPU time" in text
    assert "alpha = 3.0 is never on the front: up to 3 times the CPU time" in text
    # a bound where all of a line are less accurate than the front, and one of these is not
    assert "alpha = 4.0 is never on the front: 3 times the CPU time" in text


def test_words_include_first_line(tmp_path):
    for alpha, factor in ((1.0, 3.0), (2.0, 1.0)):
        for n in (100, 200):
            write_run(tmp_path / "s" / f"{alpha},{n}", 1 / n, factor * n,
                      [f"physics.alpha={alpha}", f"problem.n={n}"])  # fmt: skip
    text = said(compared(tmp_path / "s"))
    assert "alpha = 1.0 is never on the front: 3 times" in text
    assert "alpha = 1.0: order 1.00" in text
    assert "alpha = 2.0: order 1.00" in text


def test_words_name_runs_with_changed_settings(study):
    for name, error in (("with", 0.3), ("without", None)):
        write_run(study / name, error, 50.0, ["problem.n=300"], settings_changed=[f"C of {name}"])
    text = said(compared(study))
    for name in ("with", "without"):
        assert f"{name} changed its settings in restarts: C of {name}." in text


def test_words_name_restarts_only_for_time_costs(study):
    write_run(study / "restarted", 0.3, 50.0, ["problem.n=300"], steps=200)
    assert "earlier sessions: restarted." in said(compared(study, cost="wall"))
    for cost in ("cpu", "n"):
        assert "earlier sessions" not in said(compared(study, cost=cost))


def test_json_record_has_every_entry_of_run(tmp_path):
    warned = [{"kind": "limit", "text": "-"}, {"kind": "volume", "text": "-"}]
    write_run(tmp_path / "s" / "a", 0.1, 5.0, ["problem.n=100"], warnings=warned, steps=250)
    write_run(tmp_path / "s" / "b", None, 1.0, ["problem.n=200"], status="failed", reason="no")
    report = compared(tmp_path / "s")
    first, second = table._records(report)
    assert first == {
        "run": "a", "status": "done", "reason": "", "problem.n": "100", "particles": 100,
        "steps": 250, "updates": 25_000, "cpu_seconds": 5.0, "wall_seconds": 2.5,
        "compile_cpu_seconds": 10.0, "threads": 2, "warnings": "limit volume",
        "density_error.L1": 0.1, "density_error.L2": 0.2, "density_error.Linf": pytest.approx(0.3),
        "report.radius_error": -0.1, "conservation.energy_drift": -1e-5,
        "conservation.energy_drift_max": 2e-5, "conservation.momentum_change": None,
        "conservation.energy_injected": 0.0, "conservation.volume_ratio": None,
        "conservation.volume_ratio_worst": None,
        "error": 0.1, "excess": 1.0, "on_front": True,
    }  # fmt: skip
    assert (second["run"], second["status"], second["reason"]) == ("b", "failed", "no")
    assert "error" not in second
    header, line = table.cells(report)
    assert header[-1] == "warnings"
    assert line == ["100", "250", "5", "0.1", "2.0e-05", "front", "limit, volume"]


def test_json_lines_have_both_fits(study):
    found = json.loads(table.as_json(compared(study), []))["series"]
    assert [line["order"] for line in found] == pytest.approx([1.0, 1.0], rel=ROUND_OFF)
    assert [line["exponent"] for line in found] == pytest.approx([-0.5, -0.5], rel=ROUND_OFF)
    assert found[0]["runs"] == [f"n={n},alpha=1.0" for n in (100, 200, 400)]


def test_sweep_points_with_run_are_not_listed_as_missing(tmp_path):
    sweep = sweep_of(tmp_path / "alpha", "1.0,2.0", 1.0)
    assert [row.status for row in runs.read([sweep])] == ["done"] * 4


def test_report_target_link_is_refused(study, tmp_path):
    (study / "report").symlink_to(tmp_path)
    before = sorted(tmp_path.iterdir())
    result = CliRunner().invoke(main, ["report", str(study)])
    assert result.exit_code == 4
    assert "report is a symbolic link" in result.stderr
    assert sorted(tmp_path.iterdir()) == before


# --- what is written --------------------------------------------------------------------------


@pytest.mark.slow
def test_report_command_writes_table_words_and_pictures(study):
    result = CliRunner().invoke(main, ["report", str(study)])
    assert result.exit_code == 0, result.output
    header, *lines = result.stdout.splitlines()[:7]
    assert re.split(r"  +", header.strip()) == [
        "physics.alpha", "N", "steps", "CPU s", "L1 error of density", "energy drift",
        "against the front",
    ]  # fmt: skip
    assert lines[0].split() == ["1.0", "100", "100", "1", "1", "2.0e-05", "front"]
    assert lines[5].split() == ["2.0", "400", "100", "48", "0.25", "2.0e-05", "×", "3.00"]
    written = sorted(path.name for path in (study / "report").iterdir())
    assert written == ["error_against_cpu.png", "error_against_n.png", "phases.png",
                       "report.csv", "report.json", "report.md"]  # fmt: skip
    with (study / "report" / "report.csv").open() as file:
        records = list(csv.DictReader(file))
    assert len(records) == 6
    last = records[-1]
    assert (last["physics.alpha"], last["particles"], last["on_front"]) == ("2.0", "400", "False")
    assert (float(last["density_error.L2"]), float(last["report.radius_error"])) == (0.5, -0.25)
    assert float(last["excess"]) == pytest.approx(3.0, rel=ROUND_OFF)
    found = json.loads((study / "report" / "report.json").read_text())
    assert [line["order"] for line in found["series"]] == pytest.approx([1.0, 1.0])
    text = (study / "report" / "report.md").read_text()
    assert "| 2.0 | 400 | 100 | 48 | 0.25 | 2.0e-05 | × 3.00 |" in text
    assert all(f"]({name})" in text for name in written if name.endswith(".png"))
    # a report beside the runs is not taken for one
    assert CliRunner().invoke(main, ["report", str(study)]).exit_code == 0


def test_pictures_show_every_run(study):
    from sph.analysis.figures import report as pictures

    report = compared(study)
    panel = pictures.error_against_cost(report).axes[0]
    lines = {line.get_label(): line for line in panel.lines}
    assert lines["Pareto front"].get_xdata().tolist() == [1.0, 4.0, 16.0]
    (label,) = (label for label in lines if label.startswith(r"$\alpha$ = 2.0"))
    assert label.endswith("cost$^{-0.50}$")
    assert lines[label].get_xdata().tolist() == [3.0, 12.0, 48.0]
    assert lines[label].get_ydata().tolist() == [1.0, 0.5, 0.25]
    # guides: orders 1 and 2 in 1-D with one step for all are cost^(-1/2) and cost^-1
    guides = [line for line in panel.lines if line.get_linestyle() == ":"]
    slopes = [front.slope(*map(np.asarray, line.get_data())) for line in guides]
    assert slopes == pytest.approx([-0.5, -1.0], rel=ROUND_OFF)
    for (start, end), (top, bottom) in (line.get_data() for line in guides):
        level = np.interp(np.log(report.cost), np.log([start, end]), np.log([top, bottom]))
        inside = (report.cost >= start) & (report.cost <= end)
        assert inside.any()
        assert (level > np.log(report.error))[inside].all()  # no line crosses a curve
    at = report.cost.max()
    first, second = (line.get_ydata()[-1] for line in guides if line.get_xdata()[-1] == at)
    assert second >= first * (1.0 - ROUND_OFF)  # the steeper line crosses the other nowhere
    panel = pictures.error_against_number(report).axes[0]
    assert any(line.get_label() == r"$\alpha$ = 1.0: order 1.00" for line in panel.lines)
    bars = pictures.phases(report).axes[0].containers
    widths = {one.get_label(): [bar.get_width() for bar in one] for one in bars}
    assert set(widths) == {"density", "rates", "other"}
    assert widths["density"] == pytest.approx([50.0] * 6)
    assert np.sum(list(widths.values()), axis=0) == pytest.approx([100.0] * 6)


def sweep_of(path, alphas, factor):
    """A directory of a sweep over alpha, errors and costs as in `study`, cost times `factor`."""
    vary = ["problem.n=100,200", f"physics.alpha={alphas}"]
    (path.parent / "tube.toml").write_text('[problem]\nname = "shock_tube"\n')
    plan = Plan.of(vary)
    SweepDirectory(path).prepare(path.parent / "tube.toml", plan)
    for point in plan.points:
        n = int(point.settings[0].partition("=")[2])
        write_run(path / point.name, 100 / n, factor * (n / 100) ** 2, point.settings)
    return path


@pytest.mark.slow
def test_pictures_several_sweeps_have_one_panel_each(tmp_path):
    from sph.analysis.figures import report as pictures

    first = sweep_of(tmp_path / "alpha", "1.0,2.0", 1.0)
    second = sweep_of(tmp_path / "wide", "1.0,{min = 0.1, max = 2.0}", 3.0)
    report = compared(first, second)
    # the same setting in both stays apart, since their times may have been taken in other company
    found = [(line.sweep, line.label) for line in report.series]
    assert found[:3] == [
        ("alpha", "alpha = 1.0"),
        ("alpha", "alpha = 2.0"),
        ("wide", "alpha = 1.0"),
    ]
    assert found[3][1].startswith("alpha = {")
    assert "\nalpha = 1.0: order 1.00" in said(report)
    assert "\nwide: alpha = 1.0: order 1.00" in said(report)
    panels = pictures.error_against_cost(report).axes
    assert [panel.get_title() for panel in panels] == ["alpha", "wide"]
    drawn = {line.get_label(): line.get_xdata().tolist() for line in panels[1].lines}
    assert drawn["Pareto front"] == [1.0, 1.0, 4.0, 4.0]  # of all: two lines of the first
    (switched,) = (label for label in drawn if "0.1 to 2.0" in label)
    assert drawn[switched] == [3.0, 12.0]
    bars = pictures.phases(report).axes[0]
    # a sweep that is called as what it varies is not named again
    assert [label.get_text() for label in bars.get_yticklabels()][::2] == [
        r"$\alpha$ = 1.0, $N$ = 100",
        r"$\alpha$ = 2.0, $N$ = 100",
        r"wide, $\alpha$ = 1.0, $N$ = 100",
        r"wide, $\alpha$ = 0.1 to 2.0 (morris monaghan), $N$ = 100",
    ]
    assert CliRunner().invoke(main, ["report", str(first), str(second)]).exit_code == 0
    assert "| wide | { min = 0.1, max = 2.0" in (first / "report" / "report.md").read_text()


def test_pictures_sweeps_with_same_lines_share_one_legend(tmp_path):
    from sph.analysis.figures import report as pictures

    sweeps = [sweep_of(tmp_path / name, "1.0,2.0", 1.0) for name in ("coarse", "fine")]
    report = compared(*sweeps)
    for picture in (pictures.error_against_cost(report), pictures.error_against_number(report)):
        assert [panel.get_legend() for panel in picture.axes] == [None, None]
        (legend,) = picture.legends
        names = [text.get_text() for text in legend.get_texts()]
        assert [name for name in names if "alpha" in name] == [r"$\alpha$ = 1.0", r"$\alpha$ = 2.0"]
    other = compared(sweeps[0], sweep_of(tmp_path / "more", "1.0,3.0", 1.0))
    assert all(panel.get_legend() for panel in pictures.error_against_cost(other).axes)


def test_picture_labels_are_short():
    from sph.analysis.figures import report_labels as labels

    assert labels.short("kernel = wendland_c2, eta = 1.6") == r"kernel = wendland c2, $\eta$ = 1.6"
    table = '{ min = 0.02, max = 2.0, switch = "cullen_dehnen" }'
    assert labels.short(f"alpha = {table}") == r"$\alpha$ = 0.02 to 2.0 (cullen dehnen)"
    table = '{ min = 0.1, max = 2.0, switch = "cullen_dehnen", ell = 0.05 }'
    assert labels.short(f"alpha = {table}, C = 0.3") == (
        r"$\alpha$ = 0.1 to 2.0 (cullen dehnen, ell = 0.05), $C$ = 0.3"
    )
    assert labels.value_alone("scheme = grad_h") == "grad_h"
    assert labels.value_alone("eta = 1.6") == "eta = 1.6"


@pytest.mark.parametrize(
    ("value", "text"),
    [(300.0, "300"), (1e-4, "$10^{-4}$"), (1.5e-4, r"$1.5\times 10^{-4}$"),
     (2e-4, r"$2\times 10^{-4}$")],
)  # fmt: skip
def test_ticks_of_one_decade_differ(value, text):
    from sph.analysis.figures.report_labels import tick

    assert tick(value) == text
