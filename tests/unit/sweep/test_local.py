"""Sweeps on this machine: killed, stopped, failed, and run again."""

import fcntl
import json
import os
import signal
import threading
from dataclasses import replace
from pathlib import Path

import h5py
import pytest
from sweeps import attempts, runs, until

from sph.output.history import read as read_history
from sph.sweep import command
from sph.sweep.local import available_processors
from sph.sweep.manifest import SweepDirectory
from sph.sweep.plan import Plan
from sph.sweep.task import execute, tasks


def summaries(directory):
    return {name: json.loads(run.summary.read_text()) for name, run in runs(directory).items()}


def prepared(program, *varies):
    """The tasks of a sweep that has not been run."""
    sweep = SweepDirectory(program.directory / "sweep")
    plan = Plan.of(varies)
    sweep.prepare(program.config, plan)
    return tasks(sweep, plan)


@pytest.mark.slow
def test_killed_sweep_run_again_finishes_all_points(killed_sweep):
    assert killed_sweep.second.exit_code == 0, killed_sweep.second.output
    assert "12 of 12 points are done." in killed_sweep.second.stdout
    found = summaries(killed_sweep.path)
    assert len(found) == 12
    assert {summary["status"] for summary in found.values()} == {"done"}
    assert {summary["time"] for summary in found.values()} == {0.4}


@pytest.mark.slow
def test_killed_sweep_run_again_repeats_no_work(killed_sweep):
    assert "stopped: ended by signal 9" in killed_sweep.told
    assert 4 <= len(killed_sweep.before) < 12  # else nothing was killed
    for name, run in runs(killed_sweep.path).items():
        assert attempts(killed_sweep.path, name).count("run") == 1
        steps = read_history(run.history)["step"]
        assert steps.tolist() == list(range(steps.size))
        if name in killed_sweep.before:
            assert run.summary.stat().st_mtime_ns == killed_sweep.before[name]
    assert attempts(killed_sweep.path, killed_sweep.worker) == ["run", "restart"]
    with h5py.File(runs(killed_sweep.path)[killed_sweep.worker].checkpoints()[-1]) as file:
        (lineage,) = json.loads(file["Checkpoint"].attrs["lineage"])
    assert lineage.startswith("restarted at step")
    assert "step 0," not in lineage


@pytest.mark.slow
def test_finished_sweep_does_nothing(killed_sweep):
    before = killed_sweep.done()
    again = killed_sweep.program.run("--vary", "problem.n=40", "--vary", "physics.alpha=0.5,1.0",
                               "-o", killed_sweep.path)  # fmt: skip
    assert again.exit_code == 0
    assert "2 of 2 points are done already" in again.stderr
    assert killed_sweep.done() == before
    assert len(SweepDirectory(killed_sweep.path).plan().points) == 12


@pytest.mark.slow
def test_failed_point_is_reported_and_others_continue(program, tmp_path):
    arguments = ("--vary", "physics.eta=1.6,5e4", "--vary", "physics.max_energy_drift=0.02,1e-15",
                 "--set", "time.end=0.002", "-o", tmp_path / "sweep")  # fmt: skip
    result = program.run(*arguments)
    assert result.exit_code == 3, result.output
    assert "1 of 4 points are done, 3 failed" in result.stderr
    # one failed in its steps, and two before there was a run directory to tell of it
    assert "times the shortest side of the box" in result.stderr
    found = runs(tmp_path / "sweep")
    assert found["physics.eta=1.6,physics.max_energy_drift=0.02"].summary.exists()
    failed = found["physics.eta=1.6,physics.max_energy_drift=1e-15"]
    assert json.loads(failed.summary.read_text())["status"] == "failed"
    reasons = SweepDirectory(tmp_path / "sweep").failures()
    assert sorted(reasons) == [
        "physics.eta=1.6,physics.max_energy_drift=1e-15",
        "physics.eta=5e4,physics.max_energy_drift=0.02",
        "physics.eta=5e4,physics.max_energy_drift=1e-15",
    ]
    assert json.loads(failed.summary.read_text())["reason"].strip() == reasons[failed.path.name]
    result = program.run(*arguments)
    assert result.exit_code == 3
    assert "1 of 4 points are done already" in result.stderr
    assert attempts(tmp_path / "sweep", "physics.eta=1.6,physics.max_energy_drift=0.02") == ["run"]
    assert attempts(tmp_path / "sweep", failed.path.name) == ["run", "run"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda one: one.name)
def test_signal_stops_runs_with_checkpoint(number, program, tmp_path):
    path = tmp_path / "sweep"
    arguments = ("--vary", "problem.n=40,50,60", "--set", "time.end=4.0", "--jobs", "2", "-o", path)
    process = program.started(*arguments)
    first = ("problem.n=40", "problem.n=50")
    for name in first:
        until(lambda name=name: (path / name / "checkpoints" / "checkpoint_000002.h5").exists())
    process.send_signal(number)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 75, told
    assert "0 of 3 points are done; the same command continues with the rest." in told
    assert "Traceback" not in told
    assert {name: summaries(path)[name]["status"] for name in first} == dict.fromkeys(
        first, "stopped"
    )
    assert not (path / "problem.n=60").exists()
    # it goes on: shown up to the next look, not to the end
    process = program.started(*arguments)
    for name in first:
        until(lambda name=name: attempts(path, name) == ["run", "restart"])
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)


@pytest.mark.slow
def test_second_interrupt_ends_runs_at_once(program, tmp_path):
    path = tmp_path / "sweep"
    # enough particles for the initial state to take longer than two signals
    process = program.started("--vary", "problem.n=400000", "--jobs", "1", "-o", path)
    log = path / "logs" / "problem.n=400000.log"
    until(lambda: log.exists() and "preparing" in log.read_text())
    process.send_signal(signal.SIGINT)
    until(lambda: "again to stop at once" in log.read_text())
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "sph: ended by Ctrl-C" in told
    assert not list(path.glob("*/checkpoints/*.h5"))


def test_point_running_in_other_process_is_skipped(program):
    (task,) = prepared(program, "problem.n=40")
    with task.log.open("ab") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        outcome = execute(task, stops=lambda: 1)
        assert outcome == (
            "problem.n=40",
            "stopped",
            "another process is running this point",
            "",
            0,
            (),
        )
        found = []
        waiting = threading.Thread(target=lambda: found.append(execute(task)))
        waiting.start()
        waiting.join(0.3)
        assert waiting.is_alive()
        assert not task.run.path.exists()
        # what the other process would have done
        task.run.path.mkdir()
        task.run.write_summary({"status": "done"})
    waiting.join(10.0)
    assert found == [("problem.n=40", "done", "", "", 0, ())]


@pytest.mark.slow
def test_orphaned_run_keeps_its_lock(program, tmp_path):
    path = tmp_path / "sweep"
    process = program.started("--vary", "problem.n=40", "--set", "time.end=2.0", "-o", path)
    until(lambda: (path / "problem.n=40" / "checkpoints" / "checkpoint_000000.h5").exists())
    process.kill()
    process.communicate()
    with (path / "logs" / "problem.n=40.log").open("ab") as log, pytest.raises(BlockingIOError):
        fcntl.flock(log, fcntl.LOCK_EX | fcntl.LOCK_NB)
    result = program.run("--vary", "problem.n=40", "--set", "time.end=2.0", "-o", path)
    assert result.exit_code == 0, result.output
    assert attempts(path, "problem.n=40") == ["run"]


def test_threads_are_divided_among_jobs(program, monkeypatch):
    from sph.sweep import local

    found = prepared(program, "problem.n=40:80:+10")
    told = []
    monkeypatch.setattr(local, "execute", lambda task, stops: task.threads)
    monkeypatch.setattr(local, "available_processors", lambda: 8)
    for jobs in (None, 2, 3):
        local.run(found, jobs, told.append)
    # five points leave one thread each of eight; two jobs four, and three jobs two
    assert told == [1] * 5 + [4] * 5 + [2] * 5
    told.clear()
    chosen = [replace(task, overrides=("run.threads=3",)) for task in found]
    local.run(chosen, 2, told.append)
    assert told == [None] * 5


@pytest.mark.slow
def test_failed_run_without_message_gives_last_lines_as_reason(program, monkeypatch):
    (task,) = prepared(program, "problem.n=40")
    # a file where the run directory should be
    Path(task.run.path).write_text("")
    outcome = execute(task)
    assert (outcome.status, outcome.how) == ("failed", "run")
    assert "is a file" in outcome.reason
    assert task.failure.read_text().strip() == outcome.reason
    os.unlink(task.run.path)
    assert execute(task).status == "done"
    assert not task.failure.exists()


def test_available_processors_within_machine():
    assert 1 <= available_processors() <= os.cpu_count()


def test_sweep_reports_number_of_points_and_asks_above_bound(program, tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(command.local, "run", lambda tasks, jobs, tell: ran.append(len(tasks)))
    monkeypatch.setattr(command, "ASKED_ABOVE", 2)
    arguments = ("--vary", "problem.n=40,50,60", "-o", tmp_path / "sweep")
    result = program.run(*arguments)
    assert result.exit_code == 2
    assert "the sweep has 3 points" in result.stderr
    assert "--yes" in result.stderr
    assert not (tmp_path / "sweep").exists()
    result = program.run(*arguments, "--yes")
    assert result.exit_code == 0
    assert "3 points to check and run" in result.stderr
    assert ran == [3]


@pytest.mark.slow
def test_file_system_error_of_point_is_its_reason(program, tmp_path):
    path = tmp_path / "a path/sweep"
    (path.parent).mkdir()
    result = program.run("--vary", "problem.n=40", "-o", path)
    assert f"(`sph report '{path}'` compares them)" in result.stdout
    for part in ("checkpoints", "summary.json"):
        target = path / "problem.n=40" / part
        target.rename(target.with_name(f"old-{part}"))
    (path / "problem.n=40" / "checkpoints").touch()
    result = program.run("--vary", "problem.n=40", "-o", path)
    assert result.exit_code in (3, 4), result.output
    assert "Not a directory" in result.stderr
    assert isinstance(result.exception, SystemExit)
