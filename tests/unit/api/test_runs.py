"""sph.run and sph.open: configurations, overrides, callbacks, directories, results."""

import gc
import json
import logging
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import sph
from sph import config as configuration
from sph.output import checkpoint as checkpoints

ROOT = Path(__file__).parents[3]
TUBE = {
    "problem": {"name": "shock_tube", "n": 60},
    "time": {"end": 0.04},
    "output": {"interval": 0.01},
    "run": {"threads": 1},
}


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    return sph.run(TUBE, output=tmp_path_factory.mktemp("runs") / "tube")


def test_dictionary_file_and_config_give_equal_runs(done, tmp_path):
    (tmp_path / "tube.toml").write_text(configuration.from_tables(TUBE).to_toml())
    for source in (tmp_path / "tube.toml", str(tmp_path / "tube.toml"), done.config):
        again = sph.run(source)
        assert [one.state_hash for one in again.checkpoints] == [
            one.state_hash for one in done.checkpoints
        ]


@pytest.mark.parametrize(
    "overrides", [{"problem.n": np.int64(40)}, ["problem.n=40"], "problem.n=40"]
)
def test_overrides(overrides):
    run = sph.run(TUBE, overrides)
    assert run.summary["particles"] < 50


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"problem": {"n": 1000}}, '"problem" is a whole table; expected single keys, with a point.'
         ' Try: {"problem.n": 1000}'),
        ({"problem.n": -3}, "problem.n=-3: problem.n = -3: expected a whole number"),
        (["problem.n=-3"], "problem.n=-3: problem.n = -3: expected a whole number"),
    ],
)  # fmt: skip
def test_messages_on_overrides_are_those_of_python(overrides, words):
    with pytest.raises(sph.ConfigError) as caught:
        sph.run(TUBE, overrides)
    assert str(caught.value).startswith(f"overrides: {words}")


def test_numpy_values_and_paths_in_dictionary(tmp_path):
    shutil.copy(ROOT / "docs" / "notebooks" / "two_clouds.py", tmp_path)
    tables = {
        "problem": {"file": tmp_path / "two_clouds.py", "n": np.int64(64), "domain": (0.0, 2.0)},
        "time": {"end": np.float64(0.5)},
        "physics": {"heating": None},
    }
    found = configuration.from_tables(tables)
    assert (found.problem.n, found.problem.domain, found.time.end) == (64, [0.0, 2.0], 0.5)
    assert tables["problem"]["n"] == 64  # not changed by defaults
    assert set(tables["problem"]) == {"file", "n", "domain"}


def test_results_are_those_of_the_files(done):
    assert done.status == "done"
    assert done.summary == json.loads((done.directory / "summary.json").read_text())
    columns = done.history
    assert columns["step"].size == done.summary["steps"] + 1
    assert columns["t"].dtype == np.float64
    assert columns["limiter"][0] in ("signal_speed", "energy", "end", "growth", "approach")
    times = [one.time for one in done.checkpoints]
    assert times == [0.0, 0.01, 0.02, 0.03, 0.04]
    last = done.checkpoints[-1]
    with_h5py = checkpoints.read(last.path)
    order = np.argsort(with_h5py.particles.id)
    assert np.array_equal(last.id, np.arange(1, last.number + 1))
    assert np.array_equal(last.velocity, with_h5py.particles.velocity[:, order])
    assert np.array_equal(last.pressure, with_h5py.pressure[order])
    assert np.array_equal(last["density"], last.density)
    assert last.config.recorded == done.config.recorded
    assert last.exact()["density"].shape == (last.number,)
    assert {"position", "density", "pressure"} <= set(last.fields) <= set(dir(last))


def test_particles_are_in_the_order_of_their_ids():
    run = sph.run({**TUBE, "problem": {"name": "gresho", "n": 256}})
    first, last = run.checkpoints[0], run.checkpoints[-1]
    stored = checkpoints.read(last.path).particles.id
    assert not np.array_equal(stored, np.sort(stored))  # else this test shows nothing
    moved = np.abs(last.position - first.position)
    moved = np.minimum(moved, 1.0 - moved)  # the box is periodic
    assert moved.max() <= 0.04 * 1.1  # the fastest gas moves at 1


def test_checkpoints_are_read_when_a_field_is_asked_for(done, monkeypatch):
    read = []

    def noted(path):
        read.append(path.name)
        return original(path)

    original = checkpoints.read
    monkeypatch.setattr(checkpoints, "read", noted)
    run = sph.open(done.directory)
    some = run.checkpoints[1:3]
    assert (len(run.checkpoints), len(some), read) == (5, 2, [])
    assert repr(run.checkpoints[0]) == "<checkpoint checkpoint_000000.h5>"
    assert read == []
    _ = some[-1].density, some[-1].velocity, some[1].time
    assert read == ["checkpoint_000002.h5"]
    assert [one.step for one in run.checkpoints] == sorted(one.step for one in run.checkpoints)
    with pytest.raises(IndexError):
        run.checkpoints[5]


def test_unknown_field_names_fields(done):
    with pytest.raises(AttributeError, match=r"no field 'densty'; expected one of id, mass, pos"):
        _ = done.checkpoints[0].densty
    with pytest.raises(KeyError, match="no field 'name'"):
        _ = done.checkpoints[0]["name"]


def test_temporary_directory_lives_as_long_as_the_run():
    run = sph.run(TUBE)
    directory, last = run.directory, run.checkpoints[-1]
    assert last.density.size
    assert directory.is_dir()
    del run, last
    gc.collect()
    assert not directory.exists()


def test_checkpoints_keep_temporary_directory():
    checkpoints_alone = sph.run(TUBE).checkpoints
    gc.collect()
    assert checkpoints_alone[1].density.size
    one = checkpoints_alone[-1:][0]
    directory = one.path.parent
    del checkpoints_alone
    gc.collect()
    assert one.density.size  # read only now
    del one
    gc.collect()
    assert not directory.exists()


def test_temporary_directory_of_failed_run_is_removed(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(sph.NumericalError, match="energy"):
        sph.run(TUBE, {"physics.max_energy_drift": 1e-12})
    gc.collect()
    assert os.listdir(tmp_path) == []


def test_output_directory_is_not_replaced_unasked(done):
    with pytest.raises(sph.FileError, match="already holds a run"):
        sph.run(TUBE, output=done.directory)
    copy = done.directory.with_name("copy")
    shutil.copytree(done.directory, copy)
    assert sph.run(TUBE, {"time.end": 0.01}, output=copy, force=True).summary["time"] == 0.01


# --- callbacks --------------------------------------------------------------------------------


def test_callback_sees_each_output():
    seen = []
    run = sph.run(TUBE, callback=lambda one: seen.append((one.time, one.step, one.state_hash)))
    assert run.status == "done"
    assert seen == [(one.time, one.step, one.state_hash) for one in run.checkpoints]


def test_callback_sees_each_step_and_changes_no_bit(done):
    seen = []
    run = sph.run(TUBE, callback=lambda one: seen.append(one.time), each="step")
    assert seen == run.history["t"][1:].tolist()
    assert run.checkpoints[-1].state_hash == done.checkpoints[-1].state_hash


@pytest.mark.parametrize(("each", "calls"), [("output", 3), ("step", 5)])
def test_callback_stops_run_which_can_be_continued(done, tmp_path, each, calls):
    seen = []

    def watch(simulation):
        seen.append(simulation.time)
        return len(seen) < calls

    run = sph.run(TUBE, callback=watch, each=each, output=tmp_path / "run")
    assert (run.status, run.summary["reason"]) == ("stopped", "the callback")
    assert len(seen) == calls
    assert run.checkpoints[-1].time == seen[-1] < 0.04
    command = [sys.executable, "-m", "sph", "restart", str(run.directory)]
    subprocess.run(command, check=True, env=os.environ | {"PYTHONPATH": str(ROOT)}, timeout=120)
    if each == "output":  # else the last step before the stop is not cut short by an output
        assert sph.open(run.directory).checkpoints[-1].state_hash == done.checkpoints[-1].state_hash


@pytest.mark.parametrize("answer", [np.False_, np.array(False)], ids=["scalar", "array"])
def test_false_of_numpy_stops_run(answer):
    run = sph.run(TUBE, callback=lambda one: answer, each="step")
    assert (run.status, run.history["t"].size) == ("stopped", 2)


@pytest.mark.parametrize("answer", [None, 0, 0.0, np.True_, np.float64(0.0)])
def test_other_answers_let_run_go_on(answer):
    assert sph.run(TUBE, callback=lambda one: answer).status == "done"


def test_callback_that_stops_at_the_end_leaves_a_run_that_is_done():
    assert sph.run(TUBE, callback=lambda one: one.time < 0.04).status == "done"


def test_exception_in_callback_reaches_the_script(tmp_path):
    def fail(simulation):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        sph.run(TUBE, callback=fail, output=tmp_path / "run")
    run = sph.open(tmp_path / "run")
    assert (run.status, len(run.checkpoints)) == ("unfinished", 1)


def test_each_is_checked():
    with pytest.raises(ValueError, match='expected "output" or "step"'):
        sph.run(TUBE, each="steps")


# --- errors, threads, output to the terminal ---------------------------------------------------


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"problem": {"name": "shock_tub"}}, 'the configuration: problem.name = "shock_tub" is'),
        ({"problem": {"name": "shock_tube", "n": "60"}}, 'problem.n = "60": expected a whole'),
        ({"problem": 3}, "problem = 3: expected a table"),
        ({"problems": {}}, "problems is not a table of the configuration; did you mean problem?"),
        ({"problem": {"name": "shock_tube", "file": "none.py"}}, "none.py: file not found"),
        ({"problem": {"name": object}}, "problem.name = <class 'object'>: expected a number, a te"),
    ],
)
def test_wrong_configuration_raises_message_of_command(tables, words):
    with pytest.raises(sph.ConfigError) as error:
        sph.run(tables)
    assert words in str(error.value)


def test_missing_files_raise_messages(tmp_path):
    with pytest.raises(sph.FileError, match="file not found"):
        sph.run(tmp_path / "none.toml")
    with pytest.raises(sph.FileError, match="does not exist"):
        sph.open(tmp_path / "none")
    with pytest.raises(sph.FileError, match="is not a run directory"):
        sph.open(tmp_path)


def test_run_in_another_thread(done):
    found = []
    thread = threading.Thread(target=lambda: found.append(sph.run(TUBE)))
    thread.start()
    thread.join(120)
    assert found[0].checkpoints[-1].state_hash == done.checkpoints[-1].state_hash


def test_run_is_silent_and_logs_notes(capfd, caplog):
    with caplog.at_level(logging.INFO, logger="sph"):
        sph.run(TUBE)
    assert "preparing the initial state" in caplog.messages
    assert capfd.readouterr() == ("", "")
    sph.run(TUBE, show_progress=True)
    assert "wrote checkpoint_000004.h5" in capfd.readouterr().err


def test_import_is_light_and_names_are_those_of_the_stub():
    code = (
        "import sys, sph; heavy = {'numba', 'numpy', 'pydantic', 'h5py', 'click'}; "
        "new = heavy & set(sys.modules); "
        "print(sorted(new), sorted(set(sph.__all__) - set(dir(sph)))); sph.Problem; "
        "print('numba' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=60
    )
    assert done.stdout == "[] []\nFalse\n", done.stderr
    stub = (ROOT / "sph" / "__init__.pyi").read_text()
    named = [word for line in stub.splitlines() for word in line.split(" as ")[1:]]
    names = {one.split(",")[0].split()[0] for one in named}
    assert names == set(sph.__all__)
    assert all(getattr(sph, name) is not None for name in sph.__all__)
    with pytest.raises(AttributeError, match="module 'sph' has no attribute 'ran'"):
        _ = sph.ran
