"""Restarts that have nothing to do, and what is told of changed settings."""

import hashlib
import json
import os
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from sph import config as configuration
from sph import restarting
from sph.cli import main
from sph.output import checkpoint as checkpoints
from sph.output.history import History
from sph.output.run_directory import RunDirectory
from sph.simulation import Simulation

TUBE = """\
[problem]
name = "shock_tube"
n = 60
[time]
end = 0.02
[output]
interval = 0.01
[run]
threads = 1
"""
END = "has reached its end, t = 0.02"


def sph_(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    home = tmp_path_factory.mktemp("restarting")
    (home / "tube.toml").write_text(TUBE)
    result = sph_("run", home / "tube.toml", "-o", home / "run")
    assert result.exit_code == 0, result.output
    return home / "run"


@pytest.fixture
def run(finished, tmp_path):
    return RunDirectory(shutil.copytree(finished, tmp_path / "run"))


def files(directory):
    """SHA-256 and time of writing of every file below `directory`, by path."""
    return {
        path: (hashlib.sha256(path.read_bytes()).hexdigest(), path.stat().st_mtime_ns)
        for path in directory.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize("which", ["run", "last checkpoint", "lone checkpoint"])
@pytest.mark.parametrize(
    ("settings", "code", "words"),
    [
        ([], 0, f"{END}. Try: a later time.end."),
        (["--threads", "2"], 0, END),
        (["--set", "time.end=0.02"], 0, END),
        (
            ["--set", "physics.kernel=cubic_spline", "--set", "physics.alpha=7"],
            2,
            f"{END}: no step would be computed with physics.kernel = ",
        ),
        (["--set", "output.interval=0.005"], 2, "output.interval = 0.005 (was 0.01)"),
    ],
)
@pytest.mark.parametrize("elsewhere", [False, True])
def test_restart_of_finished_run_changes_nothing(
    run, tmp_path, which, settings, code, words, elsewhere
):
    source = run.path if which == "run" else run.checkpoint_path(2)
    if which == "lone checkpoint":
        source = shutil.copy(source, tmp_path / "lone.h5")
        elsewhere = True  # else it has nowhere to go
    before = files(tmp_path)
    into = ["-o", tmp_path / "new"] if elsewhere else []
    result = sph_("restart", source, *settings, *into)
    assert result.exit_code == code, result.output
    assert words in result.stderr
    assert str(source) in result.stderr
    assert files(tmp_path) == before
    assert not (tmp_path / "new").exists()


def test_restart_to_earlier_end_changes_nothing(run, tmp_path):
    before = files(run.path)
    result = sph_("restart", run.checkpoint_path(1), "--set", "time.end=0.01")
    assert result.exit_code == 2
    assert "has reached its end, t = 0.01" in result.stderr
    assert files(run.path) == before


def test_restart_of_run_killed_before_summary_writes_summary(run):
    before = json.loads(run.summary.read_text())
    kept = files(run.path / "checkpoints")
    run.summary.unlink()
    refused = sph_("restart", run.path, "--set", "physics.alpha=7")
    assert refused.exit_code == 2
    assert not run.summary.exists()
    result = sph_("restart", run.path, "--threads", "2")
    assert result.exit_code == 0, result.output
    after = json.loads(run.summary.read_text())
    for key in ("status", "time", "steps", "errors", "conservation", "settings_changed"):
        assert after[key] == before[key]
    assert files(run.path / "checkpoints") == kept


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", '{"status": ["done"]}', "\xff"])
def test_restart_rewrites_damaged_summary(run, text):
    run.summary.write_text(text, encoding="latin-1")
    result = sph_("restart", run.path)
    assert result.exit_code == 0, result.output
    assert json.loads(run.summary.read_text())["status"] == "done"


@pytest.mark.parametrize("name", ["config.toml", "summary.json"])
def test_restart_does_not_wait_for_pipe_in_directory(run, name):
    (run.path / name).unlink()
    os.mkfifo(run.path / name)
    result = sph_("restart", run.path, "--set", "time.end=0.025")
    assert result.exit_code == 0, result.output
    assert (run.path / name).is_file()


def test_restart_of_link_to_itself_is_refused(run, tmp_path):
    (tmp_path / "loop").symlink_to("loop")
    result = sph_("restart", run.path, "--set", "time.end=0.025", "-o", tmp_path / "loop")
    assert result.exit_code == 4, result.output
    assert "loop" in result.stderr


def test_missing_summary_written_only_from_last_checkpoint(run):
    """Of a run that was taken further, an earlier end is no reason to drop what came later."""
    ended = run.checkpoint_path(2).read_bytes()
    assert sph_("restart", run.path, "--set", "time.end=0.03").exit_code == 0
    run.checkpoint_path(2).write_bytes(ended)
    run.summary.unlink()
    before = files(run.path)
    result = sph_("restart", run.checkpoint_path(2))
    assert result.exit_code == 0
    assert END in result.stderr
    assert files(run.path) == before


def test_restart_of_failed_run_to_last_checkpoint_finishes_it(run):
    """An attempt to go on has failed: the summary is of that, and not of the last checkpoint."""
    far = ["--set", "time.end=0.1", "--set", "physics.max_energy_drift=1e-12"]
    assert sph_("restart", run.path, *far).exit_code == 3
    assert sph_("restart", run.path).exit_code == 0
    found = json.loads(run.summary.read_text())
    assert (found["status"], found["time"]) == ("done", 0.02)


def test_restart_with_changed_settings_is_reported(run, tmp_path):
    first = sph_("restart", run.path, "--set", "time.end=0.03")
    assert first.exit_code == 0, first.output
    assert "Settings changed" not in first.stdout
    found = json.loads(run.summary.read_text())
    assert found["settings_changed"] == []
    assert len(found["lineage"]) == 1
    changes = ["--set", "time.end=0.04", "--set", "physics.alpha=2.0"]
    second = sph_("restart", run.path, *changes)
    told = "physics.alpha = 2.0 (was 1.0) at t = 0.03"
    assert f"Settings changed in restarts: {told}." in second.stdout
    found = json.loads(run.summary.read_text())
    assert found["settings_changed"] == [told]
    last = checkpoints.read(run.latest())
    assert list(last.lineage) == found["lineage"]
    assert last.lineage[-1].endswith("with physics.alpha = 2.0 (was 1.0)")
    third = sph_("restart", run.path, "--set", "time.end=0.05")  # it stays told
    assert told in third.stdout
    said = sph_("report", run.path, "-o", tmp_path / "report").stdout
    assert f"changed its settings in restarts: {told}." in said


def test_restart_with_edited_config_file_is_noted(run):
    """Edited by hand, or left by a restart that was killed before its first checkpoint."""
    text = run.config.read_text()
    assert "alpha = 1.0" in text
    run.config.write_text(text.replace("alpha = 1.0", "alpha = 3.0"))
    taken = sph_("restart", run.path, "--set", "time.end=0.025", "--set", "physics.alpha=3.0")
    assert "config.toml has" not in taken.stderr
    run.config.write_text(text.replace("alpha = 1.0", "alpha = 4.0"))
    result = sph_("restart", run.path, "--set", "time.end=0.03")
    assert result.exit_code == 0, result.output
    assert "config.toml has physics.alpha = 4.0 (the checkpoint: 3.0)" in result.stderr
    assert checkpoints.read(run.latest()).config.physics.alpha == 3.0


SETTINGS = ("--set", "time.end=0.03", "--set", "physics.alpha=2.0", "--set", "physics.C=0.1")


@pytest.mark.parametrize("killed_in", ["write_config", "resume", "advance"])
def test_killed_restart_has_recorded_settings(run, tmp_path, monkeypatch, killed_in):
    """Or none of them: what goes on from there is the whole restart, to the last bit."""
    whole = RunDirectory(shutil.copytree(run.path, tmp_path / "whole"))
    assert sph_("restart", whole.path, *SETTINGS).exit_code == 0

    def kill(*_, **__):
        raise KeyboardInterrupt

    owner = {"write_config": RunDirectory, "resume": History, "advance": Simulation}[killed_in]
    with monkeypatch.context() as patch:
        patch.setattr(owner, killed_in, kill)
        assert sph_("restart", run.path, *SETTINGS).exit_code != 0
    assert not run.summary.exists()  # which told of the old settings
    assert sph_("restart", run.path).exit_code == 0
    one, other = (checkpoints.read(each.latest()) for each in (run, whole))
    assert one.config == other.config
    assert one.config.time.end == 0.03
    assert one.time == 0.03
    np.testing.assert_array_equal(one.particles.position, other.particles.position)
    found = json.loads(run.summary.read_text())["settings_changed"]
    assert found == json.loads(whole.summary.read_text())["settings_changed"]
    (changed,) = found
    assert changed.endswith(" at t = 0.02")
    for one in ("physics.alpha = 2.0 (was 1.0)", "physics.C = 0.1 (was 0.15)"):
        assert one in changed


# --- what is decided before anything is changed ------------------------------------------------


@pytest.fixture
def place(tmp_path):
    """A run directory with three checkpoints, of which there is nothing but the names."""
    run = RunDirectory.create(tmp_path / "place")
    for number in range(3):
        run.checkpoint_path(number).write_text(f"{number}")
    run.history.write_text("step,t\n")
    return run


@pytest.mark.parametrize(
    ("summary", "number", "expected"),
    [
        (None, 2, True),
        (None, 1, False),
        ("{", 2, True),
        ("[]", 2, True),
        ('{"status": "done"}', 2, True),
        ('{"status": "done", "time": 0.5}', 2, False),
        ('{"status": "failed", "time": 0.5}', 2, True),
        ('{"status": "done", "time": 0.25}', 2, True),
    ],
)
def test_summary_of_earlier_checkpoint_counts_as_missing(place, summary, number, expected):
    if summary is not None:
        place.summary.write_text(summary)
    path = place.checkpoint_path(number)
    assert restarting._is_last_without_summary(place, path, 0.5) == expected
    assert not restarting._is_last_without_summary(None, path, 0.5)


@pytest.mark.parametrize(
    ("has_failed", "why"), [(True, "energy has drifted"), (False, "cannot be read")]
)
def test_skipped_checkpoints_are_reported_with_reason(place, has_failed, why):
    if has_failed:
        place.write_summary({"status": "failed"})
    notes = []
    restarting._note_damaged(place, place.checkpoint_path(1), SimpleNamespace(note=notes.append))
    (note,) = notes
    assert "checkpoint_000002.h5 is skipped" in note
    assert why in note
    assert "checkpoint_000001.h5" in note


def test_unused_file_settings_are_noted_except_threads(place):
    before = configuration.from_text(TUBE)
    notes = []

    def told(written, *overrides):
        notes.clear()
        place.write_config(before.override(written).to_toml())
        progress = SimpleNamespace(note=notes.append)
        restarting._note_other_settings(place, before, before.override(overrides), progress)
        return len(notes)

    assert told([]) == 0
    assert told(["run.threads=2"]) == 0
    assert told(["physics.alpha=2.0", "physics.C=0.1"]) == 2
    assert told(["physics.alpha=2.0"], "physics.alpha=2.0") == 0  # which is what goes on
    assert told(["physics.alpha=2.0"]) == 1
    assert "has physics.alpha = 2.0 (the checkpoint: 1.0)" in notes[0]
    assert "continuing with that of the checkpoint" in notes[0]
    assert told(["physics.alpha=2.0"], "physics.alpha=3.0") == 1
    assert "continuing with that of --set" in notes[0]
    assert told([], "physics.alpha=3.0") == 0  # the file has what the checkpoint has


def test_restart_into_new_directory_copies_history_and_checkpoints(place, tmp_path):
    path = place.checkpoint_path(1)
    target, number = restarting._place_to_go_on(place, path, 0, tmp_path / "new")
    assert number == 1
    assert [one.read_text() for one in target.checkpoints()] == ["0", "1"]
    assert target.history.read_text() == "step,t\n"
    for directory in (None, place.path):
        assert restarting._place_to_go_on(place, path, 0, directory) == (place, 1)
    target, number = restarting._place_to_go_on(None, path, 0, tmp_path / "lone")
    assert (number, [one.read_text() for one in target.checkpoints()]) == (0, ["1"])
    assert not target.history.exists()


def test_first_step_follows_new_courant_number_and_limit():
    before = configuration.from_text(TUBE).override(["physics.energy_limit=false"])
    now = before.override(["physics.C=0.075", "physics.energy_limit=true"])
    # 0.75 is the least of u/|du/dt|; gas without any energy sets none
    energy, rate = np.array([3.0, 1.0, 0.0]), np.array([-4.0, 0.5, 9.0])
    arrays = {"internal_energy": energy, "energy_rate": rate}
    particles = SimpleNamespace(**arrays, get=arrays.get)
    for next_step, expected in ((1.0, 0.075 * 0.75), (0.01, 0.005)):
        checkpoint = SimpleNamespace(config=before, particles=particles, next_step=next_step)
        assert restarting._coming_step(now, checkpoint) == pytest.approx(expected, rel=1e-14)
