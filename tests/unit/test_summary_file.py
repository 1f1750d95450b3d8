"""Summaries as they are read: checked, and with NaN and infinities as numbers."""

import json
import math

import pytest

from sph.clock import STARTING
from sph.errors import FileError
from sph.output.run_directory import RunDirectory
from sph.summary import figure, lookup, of_json, wall_without_start

NORMS = {"L1": 0.25, "L2": 0.5, "Linf": "inf", "relative_L1": None}
KEPT = {
    "energy_drift": 1e-9, "energy_drift_max": 2e-9, "energy_injected": 0.0,
    "momentum_change": "nan", "volume_ratio": None, "volume_ratio_worst": None,
}  # fmt: skip
SESSION = {
    "steps": 3, "updates": 30, "updates_per_cpu_second": None, "cpu_seconds": 2.0,
    "wall_seconds": 8.0, "compile_cpu_seconds": 4.0, "list_builds": 1, "peak_memory_bytes": 10**8,
    "phases_cpu_seconds": {STARTING: 0.5, "rates": 1.5},
}  # fmt: skip
WRITTEN = {
    "status": "done", "reason": None, "warnings": [{"kind": "limit", "text": "-"}],
    "version": "0", "problem": "uniform", "dimension": 1, "particles": 10, "time": 1,
    "steps": 3, "lineage": [], "settings_changed": [],
    "errors": {"region": "all", "particles": 10, "fields": {"density": NORMS}},
    "errors_left_out": None, "report": {"peak": "-inf"}, "conservation": KEPT,
    "nearest": None, "compiled_in": [], "left_out": [],
    "cost": {"cpu_seconds": 2.0, "wall_seconds": 9.0, "threads": 1, "session": SESSION},
}  # fmt: skip


def changed(name, value):
    """WRITTEN with the figure of that name changed, or left out where the value is ..."""
    content = json.loads(json.dumps(WRITTEN))
    *tables, last = name.split(".")
    table = content
    for one in tables:
        table = table[int(one) if isinstance(table, list) else one]
    if value is ...:
        del table[last]
    else:
        table[last] = value
    return json.dumps(content)


def test_non_finite_numbers_are_read_as_floats():
    found = of_json(json.dumps(WRITTEN))
    assert found["errors"]["fields"]["density"] == NORMS | {"Linf": math.inf}
    assert found["report"] == {"peak": -math.inf}
    assert math.isnan(found["conservation"].pop("momentum_change"))
    assert found["conservation"].items() <= KEPT.items()
    same = set(WRITTEN) - {"errors", "report", "conservation"}
    assert all(found[name] == WRITTEN[name] for name in same)


def test_unknown_figures_are_kept():
    assert of_json(changed("cost.energy_joules", 5.0))["cost"]["energy_joules"] == 5.0


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("cost.session.steps", ..., "cost.session.steps is missing"),
        ("cost.session.steps", 1.5, "cost.session.steps is 1.5"),
        ("cost", 1, "cost is 1"),
        ("status", "well", "status is 'well'"),
        ("time", "soon", "time is 'soon'"),
        ("problem", "nan!", None),
        ("problem", None, "problem is None"),
        ("report.peak", [1.0], r"report.peak is \[1.0\]"),
        ("warnings.0.kind", 3, "warnings.0.kind is 3"),
        ("errors.fields.density.L2", ..., "errors.fields.density.L2 is missing"),
    ],
)
def test_summary_invalid_entry_is_named(tmp_path, name, value, words):
    run = RunDirectory(tmp_path)
    run.summary.write_text(changed(name, value))
    if words is None:
        assert run.whole_summary()[name] == value
        return
    with pytest.raises(FileError, match=rf"summary\.json cannot be read: {words}\."):
        run.whole_summary()


def test_figure_names_of_problem_limits_are_found():
    expected = {
        "l1.density": 0.25, "l1.velocity": None, "peak": -math.inf, "energy_drift": 2e-9,
        "energy_injected": 0.0, "nothing": None,
    }  # fmt: skip
    summary = of_json(json.dumps(WRITTEN))
    assert {name: figure(summary, name) for name in expected} == expected
    unjudged = summary | {"errors": None, "report": None}
    assert figure(unjudged, "l1.density") is None
    assert figure(unjudged, "peak") is None


def test_figure_is_found_by_its_tables():
    summary = of_json(json.dumps(WRITTEN))
    assert lookup(summary, "cost.session.steps") == 3
    assert lookup(summary, "steps") == 3
    assert lookup(summary, "steps.more") is lookup(summary, "nearest.median") is None


def test_wall_clock_time_excludes_start_of_last_session():
    assert wall_without_start(of_json(json.dumps(WRITTEN))["cost"]) == 9.0 - 4.0 - 0.5
