"""Frames of runs: when they are taken, that they change nothing, and restarts."""

import numpy as np
import pytest

from sph import config as configuration
from sph import progress, restarting, runner
from sph.output import checkpoint as checkpoints
from sph.output import frames
from sph.output.history import read as read_history
from sph.output.run_directory import RunDirectory
from sph.output.times import next_frame

TUBE = configuration.from_text(
    '[problem]\nname = "shock_tube"\nn = 60\nboundary = "mirror"\n'
    "[time]\nend = 0.2\n[output]\ninterval = 0.05\n[run]\nthreads = 1\n"
)
FRAMES = 10


def run(path, *overrides):
    directory = RunDirectory.create(path)
    runner.run(TUBE.override(overrides), directory, progress.Lines())
    return directory


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    return run(tmp_path_factory.mktemp("filmed") / "run", f"output.frames={FRAMES}")


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return run(tmp_path_factory.mktemp("plain") / "run")


def without_clock(directory):
    history = read_history(directory.history)
    return {name: list(column) for name, column in history.items() if "seconds" not in name}


def hashes(directory):
    return [checkpoints.hash_of(checkpoints.read(path)) for path in directory.checkpoints()]


def contents(directory):
    return {path.name: path.read_bytes() for path in directory.frames.paths()}


def test_run_without_the_key_has_no_directory(plain):
    assert not plain.frames.path.exists()


def test_frames_change_no_bit(filmed, plain):
    assert without_clock(filmed) == without_clock(plain)
    assert hashes(filmed) == hashes(plain)


def test_frames_are_of_the_steps_that_first_reach_their_times(filmed):
    times = read_history(filmed.history)["t"]
    # 1e-9: rounding of multiples; 60 particles need more than FRAMES steps, one of each is due
    due = [np.argmax(times >= k * 0.2 / (FRAMES - 1) * (1 - 1e-9)) for k in range(FRAMES)]
    found = [frames.read(path, TUBE) for path in filmed.frames.paths()]
    assert [one.step for one in found] == due
    assert [one.time for one in found] == [times[step] for step in due]
    assert found[-1].time == 0.2


def test_frame_has_the_state_of_the_checkpoint(filmed):
    last = checkpoints.read(filmed.checkpoints()[-1])
    found = frames.read(filmed.frames.paths()[-1], TUBE)
    np.testing.assert_allclose(found.particles.density, last.particles.density, 2.0**-24)
    np.testing.assert_allclose(found.pressure, last.pressure, 2.0**-24)


def test_frames_closer_than_steps_are_one_a_step(tmp_path):
    directory = run(tmp_path / "run", "output.frames=100000", "time.end=0.02")
    steps = len(read_history(directory.history)["t"])
    assert len(directory.frames.paths()) == steps


@pytest.mark.parametrize("is_in_place", [True, False])
def test_restart_continues_frames(filmed, tmp_path, is_in_place):
    """From a run that was killed in its middle: its later frames are made again."""
    directory = run(tmp_path / "run", f"output.frames={FRAMES}")
    directory.summary.unlink()
    for path in directory.checkpoints()[3:]:
        path.unlink()
    last = directory.frames.paths()[-1]
    (last.parent / f".{last.name}.ab.partial").touch()
    target = directory.path if is_in_place else tmp_path / "other"
    _, after = restarting.restart(directory.path, [], target, progress.Lines())
    assert contents(after) == contents(filmed)
    assert hashes(after) == hashes(filmed)


def test_restart_with_other_steps_keeps_no_frame_of_the_old_ones(tmp_path):
    directory = run(tmp_path / "run", f"output.frames={FRAMES}")
    restarting.restart(directory.checkpoint_path(1), ["physics.C=0.1"], None, progress.Lines())
    times = read_history(directory.history)["t"]
    found = [frames.read(path, TUBE) for path in directory.frames.paths()]
    assert [one.time for one in found] == [times[one.step] for one in found]
    assert len(found) == FRAMES


def test_frame_is_written_before_the_checkpoint_of_its_step(tmp_path, monkeypatch):
    """A restart from that checkpoint would not write the frame."""
    found = {}

    def note(path, state):
        found[state.step] = RunDirectory(path.parent.parent).frames.paths()
        write(path, state)

    write = checkpoints.write
    monkeypatch.setattr(checkpoints, "write", note)
    directory = run(tmp_path / "run", "output.frames=5")  # at the times of checkpoints
    assert [len(paths) for paths in found.values()] == [1, 2, 3, 4, 5]
    assert all(paths == directory.frames.up_to(step) for step, paths in found.items())


def test_restart_may_begin_frames(plain, tmp_path):
    number = 2
    _, after = restarting.restart(
        plain.checkpoint_path(number), ["output.frames=5"], tmp_path / "run", progress.Lines()
    )
    found = [frames.read(path, TUBE).time for path in after.frames.paths()]
    # at the restart, t = 0.1, and then at 0.15 and 0.2, where steps end for checkpoints
    assert found == [0.1, 0.15, 0.2]


def test_force_removes_frames(filmed, tmp_path):
    directory = run(tmp_path / "run", "output.frames=5", "time.end=0.01")
    assert directory.frames.paths()
    again = RunDirectory.create(directory.path, force=True)
    again.make_room()
    assert again.frames.paths() == []


@pytest.mark.parametrize(
    ("time", "number", "due"),
    [
        (0.0, 5, 0.25), (0.25, 5, 0.5), (0.25 - 1e-12, 5, 0.5), (0.3, 5, 0.5), (1.0, 5, 1.25),
        (0.3, 11, 0.4), (0.7, 11, 0.8), (0.0, None, np.inf),
    ],
)  # fmt: skip
def test_next_frame(time, number, due):
    assert next_frame(time, 1.0, number) == pytest.approx(due, rel=3e-9)
