"""The closing words of a run, and what a summary has of one that was stopped or failed."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph.analysis import summary
from sph.analysis.summary import in_words

COST = {
    "cpu_seconds": 80.0, "wall_seconds": 90.0, "threads": 2,
    "session": {
        "steps": 15, "updates": 1500, "updates_per_cpu_second": 1234567, "cpu_seconds": 3.0,
        "wall_seconds": 2.0, "compile_cpu_seconds": 1.5,
    },
}  # fmt: skip
KEPT = {
    "energy_drift": 1e-9, "energy_drift_max": 2e-5, "energy_injected": 0.0,
    "momentum_change": 3e-15, "volume_ratio": 0.98765, "volume_ratio_worst": 0.5,
}  # fmt: skip
ERRORS = {
    "against": "the exact solution",
    "region": "x > 0",
    "fields": {
        "density": {"L1": 0.01, "relative_L1": 0.025},
        "internal_energy": {"L1": 0.02, "relative_L1": None},
    },
}
DONE = {
    "status": "done", "problem": "uniform", "dimension": 2, "particles": 100,
    "time": 0.25, "steps": 20, "warnings": [], "settings_changed": [],
    "errors": ERRORS, "errors_left_out": None,
    "report": {"peak_density": 4.5}, "conservation": KEPT, "cost": COST,
}  # fmt: skip


def lines(**changed):
    return in_words(DONE | changed).splitlines()


def test_summary_text_names_every_figure(messages):
    first, errors, figure, kept, cost = lines()
    numbers = {
        first: ["100", "0.25", "20", "done"],
        errors: ["x > 0", "density 0.01", "2.5 %", "internal energy 0.02"],
        figure: ["peak density", "4.5"],
        kept: ["2e-05", "3e-15", "0.9877"],
        cost: ["2 s", "3 CPU s", "1.5", "1,234,567"],
    }
    for line, expected in numbers.items():
        assert all(number in line for number in expected), line
    messages.check("\n".join(lines()))


def test_summary_text_names_injected_and_added_energy(messages):
    def kept(**changed):
        return lines(conservation=KEPT | changed)[3]

    assert "1.5e-05" in kept(energy_injected=1.5e-5)
    for changed in ("energy_injected", "momentum_change", "volume_ratio"):
        messages.check(kept(**{changed: 1.5e-5 if changed == "energy_injected" else None}))


@pytest.mark.parametrize(
    ("axes", "words"),
    [(["x", "y"], "momentum to 3e-15"), (["y"], "momentum along y to 3e-15")],
)
def test_summary_text_names_axes_that_conserve_momentum(axes, words):
    assert f"; {words};" in lines(momentum_along=axes)[3]


@pytest.mark.parametrize("rate", [0, None])
def test_summary_text_of_restart_without_steps_has_no_rate(rate):
    session = COST["session"] | {"updates": 0, "updates_per_cpu_second": rate}
    assert lines(cost=COST | {"session": session})[4].endswith(" 1.5 CPU s for compilation.")


@pytest.mark.parametrize(("count", "words"), [(1, "1 warning)"), (2, "2 warnings)")])
def test_summary_text_starts_with_warnings_and_changed_settings(count, words):
    told = [{"kind": "limit", "text": f"text {i}"} for i in range(count)]
    found = lines(warnings=told, settings_changed=["a = 1", "b = 2"])
    assert found[0].endswith(f"(done, with {words}.")
    assert found[1 : 1 + count] == [f"Warning: text {i}" for i in range(count)]
    assert found[1 + count].endswith("a = 1; b = 2.")
    assert found[2 + count].startswith("Error")


def test_summary_text_error_above_field_is_a_multiple():
    def told(relative):
        return lines(errors=ERRORS | {"fields": {"density": {"L1": 1.0, "relative_L1": relative}}})[
            1
        ]

    assert told(0.996).endswith("density 1 (1e+02 %).")
    assert told(1.0).endswith("density 1 (1 times its size).")


def test_summary_text_names_reference_or_reason_without_errors():
    assert "against the run fine/run" in lines(errors=ERRORS | {"reference": "fine/run"})[1]
    assert "left out, because it is dark." in lines(errors=None, errors_left_out="it is dark")[1]


@pytest.fixture
def summary_of(monkeypatch):
    """summary_of(status, reference): the summary of a simulation of which nothing is worked out."""
    called = []
    for name in ("conservation", "cost"):
        monkeypatch.setattr(summary, name, lambda *_, name=name: called.append(name) or name)
    monkeypatch.setattr(summary.errors, "against_exact", lambda *_: "errors")
    monkeypatch.setattr(summary.truth, "left_out", lambda *_: "why not")
    monkeypatch.setattr(summary.truth, "figures", lambda *_: "figures")
    monkeypatch.setattr(summary.warnings, "of_run", lambda *_: [summary.warnings.Warning("a", "b")])

    def made(status, reference=None, lineage=()):
        config = SimpleNamespace(
            problem=SimpleNamespace(name="uniform"), report=SimpleNamespace(reference=reference),
            time=SimpleNamespace(end=9.0),
        )  # fmt: skip
        particles = SimpleNamespace(number=3, position=None)
        torn = SimpleNamespace(bodies=1, pieces=3)
        formulation = SimpleNamespace(pressure=lambda state: None, pieces=lambda state: torn)
        simulation = SimpleNamespace(
            scene=SimpleNamespace(
                config=config, dimension=2, formulation=formulation,
                described=lambda: (["i"], ["o"]), keeps_momentum=np.array([0.0, 1.0]),
            ),
            particles=particles, time=0.25, step=20, baseline=None,
            nearest=lambda: called.append("nearest") or np.array([0.9, 1.1, 0.2]),
        )  # fmt: skip
        called.clear()
        found = summary.of_run(simulation, {}, status, "a reason", lineage)
        # the cost has what the search for the nearest compiles
        assert called[-1] == "cost"
        assert ("nearest" in called) == (status != "failed")
        return found

    return made


def test_summary_finished_run_has_every_entry(summary_of):
    lineage = (
        "restarted at step 1, t = 0.125 with physics.alpha = 2.0 (was 1.0)",
        "restarted at step 2, t = 0.25",
    )
    found = summary_of("done", lineage=lineage)
    assert found.pop("version")
    assert found == {
        "status": "done", "reason": "a reason", "warnings": [{"kind": "a", "text": "b"}],
        "problem": "uniform", "dimension": 2, "particles": 3, "time": 0.25, "steps": 20,
        "lineage": list(lineage),
        "settings_changed": ["physics.alpha = 2.0 (was 1.0) at t = 0.125"],
        "errors": "errors", "errors_left_out": "why not", "report": "figures",
        "conservation": "conservation", "momentum_along": ["y"],
        "nearest": {"median": 0.9, "smallest": 0.2},
        "tearing": {"bodies": 1, "pieces": 3}, "cost": "cost", "compiled_in": ["i"],
        "left_out": ["o"],
    }  # fmt: skip


def test_summary_failed_run_has_no_warnings(summary_of):
    found = summary_of("failed")
    assert (found["errors"], found["report"], found["nearest"]) == (None, None, None)
    assert "failed" in found["errors_left_out"]
    assert found["warnings"]


def test_summary_errors_against_reference_only_at_end(summary_of):
    done, stopped = (summary_of(status, reference="fine") for status in ("done", "stopped"))
    assert (done["errors"], done["errors_left_out"]) == (None, None)
    assert (stopped["errors"], done["report"], stopped["report"]) == (None, "figures", "figures")
    assert "stopped before" in stopped["errors_left_out"]
