"""`sph info`: what it says of runs in each state, of checkpoints, and of what is neither."""

import json

import pytest
from click.testing import CliRunner
from test_figures import state_of, write_run

from sph import config
from sph.analysis import info, truth
from sph.analysis.info import settings
from sph.analysis.info.words import in_words
from sph.cli import main
from sph.clock import STARTING
from sph.errors import FileError
from sph.output import checkpoint
from sph.output.history import History
from sph.output.json_text import json_text

SESSION = {
    "steps": 2, "updates": 120, "updates_per_cpu_second": None, "cpu_seconds": 2.0,
    "wall_seconds": 8.0, "compile_cpu_seconds": 4.0, "list_builds": 1, "peak_memory_bytes": 10**8,
    "phases_cpu_seconds": {STARTING: 0.5, "density": 0.5, "rates": 1.0},
}  # fmt: skip
NORMS = {"L1": 0.25, "L2": 0.5, "Linf": 1.5, "relative_L1": 0.125}
ENDED = {
    "status": "done", "reason": None, "version": "0.9", "problem": "shock_tube",
    "warnings": [{"kind": "volume", "text": "too few neighbours"}],
    "dimension": 1, "particles": 60, "time": 0.2, "steps": 2, "lineage": [],
    "settings_changed": [],
    "errors": {
        "against": "the exact solution", "region": "the whole domain", "particles": 60,
        "fields": {"density": NORMS},
    },
    "errors_left_out": None, "report": {"peak_density": 1.25, "of_a_user": 3.0},
    "conservation": {
        "energy_drift": 1e-9, "energy_drift_max": 2e-9, "energy_injected": 0.0,
        "momentum_change": None, "volume_ratio": 1.0, "volume_ratio_worst": 1.5,
    },
    "nearest": {"median": 1.0, "smallest": 0.5}, "compiled_in": ["1-D"],
    "left_out": ["heating: not given"],
    "cost": {
        "cpu_seconds": 2.0, "wall_seconds": 8.0, "threads": 1, "updates": 120, "session": SESSION
    },
}  # fmt: skip


@pytest.fixture
def tube(tmp_path):
    """A run of three steps without a summary."""
    states = [state_of("shock_tube", "physics.C=0.1", time=t) for t in (0.0, 0.05, 0.2)]
    run = write_run(tmp_path / "tube", states)
    steps = History.create(run.history, 1)
    for step, (state, limiter) in enumerate(
        zip(states, ("growth", "viscosity", "end"), strict=True)
    ):
        row = dict.fromkeys(steps.columns, 1.0) | {
            "step": step,
            "t": state.time,
            "limiter": limiter,
        }
        steps.extend({name: [value] for name, value in row.items()})
    steps.close()
    return run


@pytest.fixture
def ended(tube):
    tube.write_summary(ENDED)
    return tube


def invoked(*arguments):
    return CliRunner().invoke(main, ["info", *map(str, arguments)])


def test_run_that_has_ended_is_described(ended):
    found = info.of(ended.path)
    state = found["state"]
    assert (state["status"], state["time"], state["step"]) == ("done", 0.2, 2)
    assert (state["checkpoints"], state["last_checkpoint"]["time"]) == (3, 0.2)
    assert found["settings"] == [
        {"key": "problem.n", "value": 60, "default": 400},
        {"key": "physics.C", "value": 0.1, "default": 0.15},
    ]
    assert found["errors"] == ENDED["errors"]
    assert found["left_out"] == ENDED["left_out"]


def test_limit_of_a_row_is_that_of_the_next_step(ended):
    steps = info.of(ended.path)["steps"]
    assert (steps["number"], steps["shortest"]) == (2, 0.05)
    by = {one["criterion"]: one for one in steps["limited_by"]}
    assert {*by} == {"growth", "viscosity"}  # not that after the last row
    assert by["growth"]["share_of_steps"] == 0.5
    # 0.05 of 0.2; round-off of a difference
    assert by["growth"]["share_of_time"] == pytest.approx(0.25, rel=1e-12)
    assert "physics.alpha" in by["viscosity"]["meaning"]


def test_time_without_a_phase_is_other_time(ended):
    time = info.of(ended.path)["time"]
    assert time["phases_cpu_seconds"] == {"rates": 1.0, "density": 0.5, "other": 0.5}
    assert (time["start_cpu_seconds"], time["compile_cpu_seconds"]) == (0.5, 4.0)


def test_every_number_of_the_summary_has_its_meaning(ended):
    figures = {one["name"]: one for one in info.of(ended.path)["figures"]}
    assert figures["errors.fields.density.L2"]["value"] == 0.5
    assert figures["report.peak_density"]["unit"] == "mass length^-D"
    assert figures["conservation.momentum_change"]["value"] is None
    assert figures["cost.session.peak_memory_bytes"]["unit"] == "bytes"
    without = [name for name, one in figures.items() if not one["meaning"]]
    assert without == ["report.of_a_user"]


def test_figures_have_physical_units(tmp_path):
    units = ("units.length=pc", "units.mass=M_sun", "units.time=Myr")
    run = write_run(tmp_path / "tube", [state_of("shock_tube", *units, time=t) for t in (0.0, 0.2)])
    run.write_summary(ENDED)
    found = info.of(run.path)
    figures = {one["name"]: one["unit"] for one in found["figures"]}
    assert figures["report.peak_density"] == "M_sun pc^-3"
    assert figures["cost.wall_seconds"] == "s"
    columns = {one["name"]: one["unit"] for one in found["columns"]}
    assert columns["total_energy"] == "M_sun pc^2 Myr^-2"
    assert "t = 0.2 of 0.2 Myr, step" in in_words(found)
    assert found["units"]["length"] == "pc"


def test_every_column_of_the_history_has_its_meaning(ended):
    columns = {one["name"]: one for one in info.of(ended.path)["columns"]}
    assert columns["limiter"]["last"] == "end"
    assert columns["t"]["last"] == 0.2
    assert all(one["meaning"] for one in columns.values())


def test_text_holds_all_that_was_found(ended):
    found = info.of(ended.path)
    text = in_words(found)
    for one in found["figures"]:
        if not one["name"].startswith(("errors.", "particles", "time", "dimension", "steps")):
            assert one["name"].partition(".")[2] in text, one["name"]
    for words in (
        "State: done at t = 0.2 of 0.2, step 2, by sph 0.9", "Warning (volume)", "(default 0.15)",
        "50.0 %  viscosity", "12.5 %", "peak_density = 1.25 mass length^-D", "= none",
        "no meaning is declared", "heating: not given",
    ):  # fmt: skip
        assert words in text, words
    assert max(map(len, text.splitlines()[3:])) <= 100


def test_json_is_what_was_found(ended):
    done = invoked(ended.path, "--json")
    assert (done.exit_code, json.loads(done.stdout)) == (
        0,
        json.loads(json_text(info.of(ended.path))),
    )
    assert invoked(ended.path).stdout.startswith(str(ended.path))


@pytest.mark.parametrize(
    ("summary", "words"),
    [
        (None, "interrupted at t = 0.2"),
        ({"status": "stopped", "reason": "SIGTERM"}, "stopped at t = 0.2"),
        ({"status": "failed", "reason": "step 3: u < 0"}, "failed at t = 0.2"),
    ],
)
def test_state_of_run(tube, summary, words):
    if summary is not None:
        tube.write_summary(ENDED | summary)
    text = invoked(tube.path).stdout
    assert f"State: {words}" in text
    assert summary is None or f"Reason: {summary['reason']}" in text


def test_run_in_another_process_is_running(tube):
    with tube.alone():
        assert info.of(tube.path)["state"]["status"] == "running"
    assert info.of(tube.path)["state"]["status"] == "interrupted"
    with tube.alone():  # and the look did not leave a lock
        pass


def test_frames_are_counted(tube):
    assert "Frames" not in in_words(info.of(tube.path))
    with tube.frames.held():
        for step in (0, 7):
            tube.frames.path_of(step).touch()
    assert "Frames: 2 (`sph movie` uses them)" in in_words(info.of(tube.path))


def test_run_without_checkpoints_is_described_by_its_configuration(tube):
    for path in tube.checkpoints():
        path.unlink()
    found = info.of(tube.path)
    assert found["state"]["last_checkpoint"] is None
    assert found["settings"][0]["key"] == "problem.n"
    assert "Checkpoints: none" in in_words(found)
    tube.config.write_text("[problem\n")
    with pytest.raises(FileError, match="neither a checkpoint nor a valid config"):
        info.of(tube.path)


def test_configuration_that_cannot_be_read_comes_from_the_checkpoint(ended):
    ended.config.write_text("[problem\n")
    assert info.of(ended.path)["settings"][1]["key"] == "physics.C"


def test_checkpoint_is_described(tube):
    path = tube.checkpoint_path(1)
    found = info.of(path)
    state = checkpoint.read(path)
    assert (found["state"]["time"], found["state"]["next_step"]) == (0.05, 0.1)
    # the exact solution is laid on the particles
    assert found["errors"]["fields"]["density"]["L1"] < 1e-12
    figures = {one["name"] for one in found["figures"]}
    report = truth.figures(state.config, 0.05, state.particles, state.pressure)
    assert {f"report.{name}" for name in report} <= figures
    fields = {one["name"]: one for one in found["fields"]}
    assert fields["density"]["largest"] == state.particles.density.max()
    assert "|velocity|" in fields
    assert "Particles:" in in_words(found)


def test_particles_of_a_failure_have_no_errors(tube, tmp_path):
    state = checkpoint.read(tube.checkpoint_path(1))
    state.lineage = (checkpoint.PART,)
    checkpoint.write(tmp_path / "offenders.h5", state)
    found = info.of(tmp_path / "offenders.h5")
    assert found["errors"] is None
    assert found["errors_left_out"] == f"the file contains only {checkpoint.PART}"


def test_what_is_no_run_is_refused(ended, tmp_path):
    for path, words in (
        (tmp_path / "nothing", "does not exist"),
        (tmp_path, "contains 1 run"),
        (ended.path / "checkpoints", "is not a run directory"),
        (ended.config, "not an HDF5 file"),
    ):
        done = invoked(path)
        assert done.exit_code == 4, path
        assert words in done.stderr, path
        assert "Try: " in done.stderr, path


def test_defaults_of_every_problem_differ_in_nothing():
    from sph import registry

    for name in registry.names("sph.problems"):
        assert settings.different(config.from_text(f'[problem]\nname = "{name}"\n')) == [], name


def test_settings_are_those_that_differ_from_defaults_of_problem_and_formulation():
    text = """
    [problem]
    name = "bodies"
    [[problem.body]]
    shape = "disc"
    centre = [0.0, 0.0]
    radius = 0.5
    [physics]
    formulation = "continuum"
    eos = { name = "tait", rho_0 = 1.0, c_0 = 2.0 }
    kernel = "cubic_spline"
    [time]
    end = 4.0
    """
    made = config.from_text(text)
    found = {one["key"]: one for one in settings.different(made)}
    # the others are defaults of "bodies"
    assert {*found} - {"physics.strength"} == {"problem.body", "physics.eos"}
    assert found["physics.eos"]["default"]["c_0"] == 1.0
    assert len(found["problem.body"]["default"]) == 2
    assert found["problem.body"]["value"][0]["radius"] == 0.5


def test_default_that_is_not_given_is_shown():
    made = config.from_text(
        '[problem]\nname = "uniform"\n[physics]\neos = { name = "ideal_gas", gamma = 1.5 }\n'
    )
    found = {one["key"]: (one["value"], one["default"]) for one in settings.different(made)}
    assert found["physics.gamma"] == (None, 1.4)
    assert found["physics.eos"] == ({"name": "ideal_gas", "gamma": 1.5}, None)


def test_defaults_of_a_problem_that_cannot_be_made_alone_are_found_by_key(monkeypatch):
    """Such as a problem in a file of a user."""
    from sph.errors import ConfigError

    text = '[problem]\nname = "noh"\nn = 77\n[units]\nlength = "m"\nmass = "kg"\ntime = "s"\n'
    made = config.from_text(text)

    def refuse(text):
        raise ConfigError("no")

    monkeypatch.setattr(config, "from_text", refuse)
    found = {one["key"]: (one["value"], one["default"]) for one in settings.different(made)}
    assert found == {
        "problem.n": (77, type(made.problem).model_fields["n"].default),
        "units.length": ("m", None), "units.mass": ("kg", None), "units.time": ("s", None),
    }  # fmt: skip
