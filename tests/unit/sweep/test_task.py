"""What a point of a sweep is told to do and how its end is understood, by one-line processes."""

import json
import sys
from dataclasses import replace

import pytest

from sph.output.run_directory import RunDirectory
from sph.sweep.manifest import SweepDirectory
from sph.sweep.plan import Plan
from sph.sweep.task import Task, chooses_threads, execute, standing, tasks


@pytest.fixture
def task(tmp_path):
    """The only task of a sweep, whose settings are alpha = 0.5, then alpha = 2 of the point."""
    config = tmp_path / "tube.toml"
    config.write_text('[problem]\nname = "shock_tube"\nn = 40\n')
    plan = Plan.of(["physics.C=0.1"], ["physics.alpha=0.5"])
    sweep = SweepDirectory(tmp_path / "sweep")
    sweep.prepare(config, plan)
    (one,) = tasks(sweep, plan)
    return one


@pytest.fixture
def outcome_of(task, monkeypatch):
    """outcome_of(code, summary, words): the outcome of a run that ends with that."""

    def executed(code, summary=None, words=""):
        lines = f"import sys; sys.stderr.write({words!r}); "
        if summary is not None:
            path = str(task.run.summary)
            lines += f"open({path!r}, 'w').write({json.dumps(summary)!r}); "
        task.run.path.mkdir(exist_ok=True)
        ending = f"import os; os.kill(os.getpid(), {-code})" if code < 0 else f"sys.exit({code})"
        command = [sys.executable, "-c", lines + ending, "restart"]
        monkeypatch.setattr(Task, "command", lambda _: command)
        return execute(task)

    return executed


WARNED = {"status": "done", "warnings": [{"kind": "paired"}, {"kind": "limit"}, {"kind": "limit"}]}
FAILED = {"status": "failed", "reason": "step 3: no.\nTry: more."}


def test_finished_run_reported_with_warnings(outcome_of, task):
    found = outcome_of(0, WARNED)
    assert found == (task.point.name, "done", "", "restart", 0, ("paired", "limit"))
    again = (task.point.name, "done", "", "", 0, ("paired", "limit"))
    assert execute(task) == standing(task) == again  # nothing is done a second time


def test_run_without_summary_is_failed(outcome_of, task):
    found = outcome_of(0, words="it went\nwell\n")
    assert (found.status, found.reason) == ("failed", "exit code 0: well")


@pytest.mark.parametrize(
    ("code", "words"), [(75, "stopped, with a checkpoint"), (-9, "ended by signal 9")]
)
def test_stopped_run_is_not_failed(outcome_of, task, code, words):
    found = outcome_of(code, words="sph: something")
    assert found == (task.point.name, "stopped", words, "restart", 0, ())
    assert not task.failure.exists()
    assert standing(task).status == "stopped"


def test_failed_run_reported_with_its_reason(outcome_of, task):
    found = outcome_of(3, FAILED, "sph: other words\n")
    reason = FAILED["reason"]
    assert found == (task.point.name, "failed", reason, "restart", 3, ())
    assert standing(task) == (task.point.name, "failed", reason, "", 0, ())


def test_reason_is_from_this_attempt(outcome_of, task):
    assert outcome_of(4, words="sph: first\n").reason == "first"
    assert outcome_of(4, words="nothing told\nlast\n").reason == "exit code 4: last"
    assert task.failure.read_text() == "exit code 4: last\n"
    # an old summary says nothing of another end
    assert outcome_of(4, FAILED, "sph: third\n").reason == "third"
    assert outcome_of(75).status == "stopped"
    assert not task.failure.exists()


def test_error_of_sweep_has_its_exit_code(task):
    task.sweep.manifest.unlink()
    found = execute(task)
    assert (found.status, found.code) == ("failed", 4)


def test_point_settings_follow_common_settings(task):
    command = task.command()
    sets = [command[i + 1] for i, part in enumerate(command) if part == "--set"]
    assert sets == ["physics.alpha=0.5", "physics.C=0.1"]
    assert command[3] == "run"
    assert "--force" in command


@pytest.mark.parametrize(
    ("status", "how"), [("stopped", "restart"), (None, "restart"), ("failed", "run")]
)
def test_failed_run_starts_again_and_others_restart(task, monkeypatch, status, how):
    run = RunDirectory.create(task.run.path)
    run.config.write_text("")
    if status:
        run.write_summary({"status": status})
    monkeypatch.setattr(RunDirectory, "checkpoints", lambda _: ["one"])
    monkeypatch.setattr(RunDirectory, "latest", lambda _: "one")
    assert task.command()[3] == how


def test_threads_set_for_all_points_or_one(task):
    assert not chooses_threads(task)
    by_all = Task(task.sweep, task.point, ("run.threads=2",))
    by_one = Task(task.sweep, replace(task.point, settings=("run.threads=2",)), ())
    assert chooses_threads(by_all)
    assert chooses_threads(by_one)
