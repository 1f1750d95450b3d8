"""A picture drawn while a run goes on: new outputs, half-written files, and how it ends."""

import shutil
import threading

import pytest
from click.testing import CliRunner
from matplotlib.image import imread
from test_figures import low_resolution, shear, state_of, tube, write_run  # noqa: F401

from sph.analysis.figures import live
from sph.cli import main
from sph.errors import ConfigError, FileError
from sph.output import checkpoint, frames


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    monkeypatch.setattr(live, "POLL", 0.01)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)


def watched(run, **given):
    said = []
    options = {"view": None, "target": None, "dpi": None} | given
    ending = live.watch(run.path, say=said.append, **options)
    return said, ending


def test_finished_run_is_drawn_once(tube):  # noqa: F811
    tube.write_summary({"status": "done"})
    said, ending = watched(tube)
    assert said == [f"drew {tube.figures / 'live.png'}: t = 0.2"]
    assert ending == "the run is done"
    assert imread(tube.figures / "live.png").ndim == 3


def test_killed_run_ends_without_status(tube):  # noqa: F811
    assert watched(tube)[1] == "no run is going on in this directory"


def test_picture_follows_outputs_until_the_run_ends(tube, monkeypatch):  # noqa: F811
    """Outputs appear one after another while another process, here a lock, is in the directory."""
    later = [path.read_bytes() for path in tube.checkpoints()[1:]]
    for path in tube.checkpoints()[1:]:
        path.unlink()
    said, drawn = [], threading.Event()

    def say(text):
        said.append(text.rpartition(": ")[2])
        drawn.set()

    ended = []
    watching = threading.Thread(
        target=lambda: ended.append(live.watch(tube.path, None, None, None, say))
    )
    with tube.alone():
        watching.start()
        for number, content in enumerate([*later, None], start=1):
            assert drawn.wait(20.0)
            assert not ended
            drawn.clear()
            if content is not None:
                tube.checkpoint_path(number).write_bytes(content)
        tube.write_summary({"status": "stopped"})
    watching.join(20.0)
    assert said == ["t = 0", "t = 0.1", "t = 0.2"]
    assert ended == ["the run is stopped"]


def test_newest_is_a_frame_if_it_is_later(tube):  # noqa: F811
    last = checkpoint.read(tube.checkpoints()[-1])
    with tube.frames.held():
        for step, time in ((last.step - 1, 0.15), (last.step + 1, 0.25)):
            path = tube.frames.path_of(step)
            frames.write(path, last.particles, last.pressure, time, step)
            expected = time if step > last.step else 0.2
            assert live.newest(tube).time == expected


def test_half_written_files_are_left_out(tube):  # noqa: F811
    last = tube.checkpoints()[-1]
    content = last.read_bytes()
    with tube.frames.held():
        tube.frames.path_of(99).write_bytes(b"\x89HDF")
    for length in (0, 100, len(content) // 2, len(content) - 100):
        last.write_bytes(content[:length])
        assert live.newest(tube).time == 0.1
    shutil.rmtree(tube.path / "checkpoints")
    assert live.newest(tube) is None
    assert not tube.is_running()


def test_run_without_outputs_is_refused(messages, tube):  # noqa: F811
    for path in tube.checkpoints():
        path.unlink()
    with messages.raised(FileError):
        watched(tube)


def test_without_locks_the_summary_ends_the_drawing(tube, monkeypatch):  # noqa: F811
    monkeypatch.setattr(type(tube), "is_running", lambda self: None)
    assert live._is_going_on(tube)
    tube.write_summary({"status": "done"})
    assert watched(tube)[1] == "the run is done"


def test_other_formats_and_sources_are_refused(messages, tube, shear, tmp_path):  # noqa: F811
    with messages.raised(ConfigError):
        watched(tube, target=tmp_path / "a.pdf")
    for arguments in ([str(tube.path), str(shear.path)], [str(tube.path), "--time", "0.1"]):
        done = CliRunner().invoke(main, ["plot", "--live", *arguments])
        messages.check(done.output)
        assert done.exit_code == 2


def test_command_draws_its_view(shear, tmp_path):  # noqa: F811
    target = tmp_path / "a.png"
    arguments = ["plot", "--live", str(shear.path), "--field", "speed", "-o", str(target)]
    done = CliRunner().invoke(main, arguments)
    assert done.output == f"drew {target}: t = 0.5\nno run is going on in this directory\n"
    assert imread(target).shape[1] > 100


def test_display_without_toolkit_gives_file(monkeypatch, tube):  # noqa: F811
    monkeypatch.setenv("DISPLAY", ":no-such-display")
    assert isinstance(live.target_of(tube, None), live.PngFile)
