import errno
import json
import os

import numpy as np
import pytest

from sph.errors import FileError
from sph.output import checkpoint
from sph.output.run_directory import RunDirectory, find


def tree(path):
    """All files below `path`."""
    return {str(each.relative_to(path)) for each in path.rglob("*") if each.is_file()}


@pytest.fixture
def run(tmp_path):
    run = RunDirectory.create(tmp_path / "runs" / "sod")
    run.write_config("[problem]\n")
    return run


@pytest.fixture
def finished(run, make_state):
    for number in range(3):
        checkpoint.write(run.checkpoint_path(number), make_state())
    run.write_summary({"steps": 3})
    run.history.write_text("step,t\n")
    run.figures.mkdir()
    (run.figures / "file").touch()
    return run


def test_create_makes_parents_and_names(run, tmp_path):
    assert run.path == tmp_path / "runs" / "sod"
    assert run.config == run.path / "config.toml"
    assert run.history == run.path / "history.csv"
    assert run.summary == run.path / "summary.json"
    assert run.checkpoint_path(12) == run.path / "checkpoints" / "checkpoint_000012.h5"
    assert run.checkpoints() == []


def test_create_in_empty_or_unstarted_directory_succeeds(tmp_path):
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / ".config.toml.partial").touch()
    RunDirectory.create(tmp_path)
    assert tree(tmp_path) == set()


def test_create_over_failed_run_without_checkpoint_needs_no_force(messages, finished):
    finished.offenders.touch()
    for path in finished.checkpoints():
        path.unlink()
    with messages.raised(FileError, "--force"):  # its history would be lost
        RunDirectory.create(finished.path)
    finished.history.unlink(missing_ok=True)
    RunDirectory.create(finished.path).make_room()
    assert tree(finished.path) == {"config.toml"}


@pytest.mark.parametrize("rows", [0, 1, 2])
@pytest.mark.parametrize("has_ended", [False, True])
def test_create_over_killed_run_without_checkpoint_needs_no_force(messages, run, rows, has_ended):
    """Of such a run the history has its first row at most, and there is no summary."""
    run.history.write_text("step,t\n" + "0,0.0\n" * rows)
    if has_ended:
        run.write_summary({})
    if rows < 2 and not has_ended:
        RunDirectory.create(run.path).make_room()
        assert tree(run.path) == {"config.toml"}
    else:
        with messages.raised(FileError, "--force"):
            RunDirectory.create(run.path)


def test_checkpoints_directory_link_is_refused(messages, finished, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    (finished.path / "checkpoints").rename(elsewhere)
    (finished.path / "checkpoints").symlink_to(elsewhere)
    before = tree(elsewhere)
    for refused in (RunDirectory.open, RunDirectory.create, lambda p: RunDirectory.create(p, True)):
        with messages.raised(FileError):
            refused(finished.path)
    with pytest.raises(FileError), finished.alone():
        pass
    assert tree(elsewhere) == before


@pytest.mark.parametrize("name", ["config.toml", "summary.json"])
def test_pipe_in_run_directory_is_not_waited_for(finished, name):
    (finished.path / name).unlink()
    os.mkfifo(finished.path / name)
    assert find(finished.path)[1] == finished.checkpoint_path(2)


def test_write_to_replaced_run_directory_is_refused(messages, run, make_state, tmp_path):
    path = run.checkpoint_path(0)
    with run.alone():
        run.path.rename(tmp_path / "moved")
        other = RunDirectory.create(run.path)
        with messages.raised(FileError):
            checkpoint.write(path, make_state())
        with messages.raised(FileError):
            run.write_summary({})
    assert tree(other.path) == set()


def test_file_system_without_locks_runs_unlocked(run, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", refuse)
    with run.alone(), run.alone():
        pass


def test_create_over_run_without_force_is_refused(finished):
    before = tree(finished.path)
    with pytest.raises(FileError) as caught:
        RunDirectory.create(finished.path)
    assert "--force" in str(caught.value)
    assert f"sph restart {finished.path}" in str(caught.value)
    assert tree(finished.path) == before


def test_force_removes_run_and_keeps_user_files(finished):
    theirs = {"notes.txt", "checkpoints/mine.h5", "more/config.toml", "checkpoints/checkpoint_1.h5"}
    (finished.path / "more").mkdir()
    for name in theirs:
        (finished.path / name).touch()
    (finished.path / ".history.csv.partial").touch()
    RunDirectory.create(finished.path, force=True).make_room()
    assert tree(finished.path) == theirs | {"config.toml"}
    # and it is still known as a run, so that it can be forced again
    RunDirectory.create(finished.path, force=True).make_room()


def test_force_keeps_linked_figures_directory(finished, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    finished.figures.rename(elsewhere)
    finished.figures.symlink_to(elsewhere)
    RunDirectory.create(finished.path, force=True).make_room()
    assert (elsewhere / "file").exists()


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("names", [["notes.txt"], ["config.toml", "checkpoints/a.pt", "figures/a"]])
def test_create_in_directory_of_other_files_is_refused(messages, tmp_path, names, force):
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    with messages.raised(FileError):
        RunDirectory.create(tmp_path, force)
    assert tree(tmp_path) == set(names)


@pytest.mark.parametrize("below", ["", "run", "a/b/run"])
def test_create_in_unwritable_directory_is_refused(messages, tmp_path, below):
    (tmp_path / "file").touch()
    with messages.raised(FileError) as caught:
        RunDirectory.create(tmp_path / "file" / below)
    assert caught.value.exit_code == 4


def test_open_accepts_run_directory_only(messages, run, tmp_path):
    assert RunDirectory.open(str(run.path)) == run
    with messages.raised(FileError):
        RunDirectory.open(tmp_path / "no")
    with messages.raised(FileError):
        RunDirectory.open(tmp_path)


def test_checkpoints_sorted_by_number_other_files_ignored(run):
    names = ["checkpoint_1000000.h5", "checkpoint_000002.h5", "checkpoint_000010.h5"]
    for name in [*names, ".checkpoint_000011.h5.partial", "checkpoint_3.h5", "a.h5"]:
        (run.path / "checkpoints" / name).touch()
    found = [path.name for path in run.checkpoints()]
    assert found == ["checkpoint_000002.h5", "checkpoint_000010.h5", "checkpoint_1000000.h5"]


def test_drop_checkpoints_after_number(finished):
    (finished.path / "checkpoints" / ".checkpoint_000003.h5.partial").touch()
    (finished.path / ".summary.json.partial").touch()
    before = tree(finished.path)
    finished.drop_checkpoints_after(1)
    gone = before - tree(finished.path)
    assert gone == {
        "checkpoints/checkpoint_000002.h5",
        "checkpoints/.checkpoint_000003.h5.partial",
        ".summary.json.partial",
    }


def test_find_run_gives_last_good_checkpoint(messages, finished):
    assert find(finished.path) == (finished, finished.checkpoint_path(2))
    content = finished.checkpoint_path(2).read_bytes()
    finished.checkpoint_path(2).write_bytes(content[:-100])
    assert find(finished.path) == (finished, finished.checkpoint_path(1))
    for number in range(2):
        finished.checkpoint_path(number).write_bytes(b"")
    with messages.raised(FileError):
        find(finished.path)


def test_find_run_without_checkpoints_is_refused(messages, run):
    with messages.raised(FileError):
        find(run.path)


def test_find_checkpoint_gives_its_run(messages, finished, tmp_path, monkeypatch):
    path = finished.checkpoint_path(1)
    assert find(str(path)) == (finished, path)
    monkeypatch.chdir(path.parent)
    assert find(path.name)[0] == finished
    alone = tmp_path / path.name
    os.link(path, alone)
    assert find(alone) == (None, alone)
    with messages.raised(FileError):
        find(finished.checkpoint_path(9))


def test_summary_is_valid_json(run):
    run.write_summary(
        {
            "l1": {"density": np.float64(0.1), "steps": np.int64(3)},
            "values": np.array([1.0, np.nan]),
            "ratio": float("inf"),
            "names": ("Δt", True, None),
        }
    )

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    assert json.loads(run.summary.read_text(), parse_constant=refuse) == {
        "l1": {"density": 0.1, "steps": 3},
        "values": [1.0, "nan"],
        "ratio": "inf",
        "names": ["Δt", True, None],
    }


def test_configuration_reads_back(run, make_state):
    from sph import config

    text = make_state().config.to_toml()
    run.write_config(text)
    assert config.load(run.config) == config.from_text(text)
