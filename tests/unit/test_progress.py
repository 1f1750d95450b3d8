"""Progress: lines in a log, a bar on a terminal, and no bar where it could not be seen."""

import io
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import warnings
from fcntl import ioctl
from pathlib import Path
from types import SimpleNamespace

import pytest

import sph
from sph import progress
from sph.sweep import command
from sph.sweep.task import Outcome

ROOT = Path(sph.__file__).parents[1]
TUBE = """\
[problem]
name = "shock_tube"
n = 400
[time]
end = 0.4
[output]
interval = 0.2
[run]
threads = 1
"""


class ManualClock:
    """A clock that the test turns."""

    now = 100.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    hours = ManualClock()
    monkeypatch.setattr(progress, "time", hours)
    return hours


def at(time, step=1, dt=0.01):
    return SimpleNamespace(time=time, step=step, limit=SimpleNamespace(dt=dt))


def test_lines_printed_seconds_apart_with_time_left(clock, capsys):
    lines = progress.Lines()
    lines.start(0.0, 1.0)
    clock.now += 40.0  # the first step compiles
    lines.step(at(0.01))
    first = capsys.readouterr().err
    assert first == "step 1, t = 0.01 of 1, dt = 0.01\n"  # and says nothing of the pace
    clock.now += 9.9
    lines.step(at(0.1, step=10))
    assert capsys.readouterr().err == ""
    clock.now += 0.1
    lines.step(at(0.11, step=11))
    # 0.1 in the 10 s since the first step: 0.89 takes 89 s
    assert capsys.readouterr().err == "step 11, t = 0.11 of 1, dt = 0.01, about 89 s left\n"
    lines.wrote(Path("a/checkpoint_000001.h5"), at(0.5))
    assert capsys.readouterr() == ("", "t = 0.5: wrote checkpoint_000001.h5\n")
    lines.close()


def test_tiny_steps_cause_no_division_by_zero(clock, capsys):
    lines = progress.Lines()
    lines.start(1.0, 2.0)
    for step in range(3):
        clock.now += 20.0
        lines.step(at(1.0, step, dt=1e-300))
    assert "left" not in capsys.readouterr().err


def test_time_left_after_restart_counts_from_its_start(clock, capsys):
    lines = progress.Lines()
    lines.start(5.0, 6.0)
    lines.step(at(5.0))
    clock.now += 10.0
    lines.step(at(5.5))
    assert "about 10 s left" in capsys.readouterr().err


@pytest.mark.parametrize("begin", [0.0, 0.1])
def test_bar_reaches_its_end_without_warnings(begin, monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    bar = progress.Bar()
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # tqdm warns of a bar that passes its end
        bar.start(begin, 0.7)
        bar.step(at(begin, dt=0.0))
        for step in range(1, 8):
            bar.step(at(begin + step * (0.7 - begin) / 7, step))
            bar._bar.refresh()
        bar.step(at(0.7, 8))
        bar._bar.refresh()
        bar.close()
    assert "100%" in stream.getvalue()
    assert re.search(r"t = 0\.7 of 0\.7, step 8, dt 0\.01 \[00:0\d, .* left\]", stream.getvalue())


def test_bar_never_started_closes():
    progress.Bar().close()


def test_sweep_bar_counts_points_and_keeps_lines_whole(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    bar = progress.RunBar("points", 4, 1)
    bar.ended("b done")
    bar._bar.refresh()
    bar.close()
    shown = stream.getvalue()
    assert " 25%|" in shown
    assert "1 of 4 points" in shown
    assert re.search(r" 50%\|.*\| 2 of 4 points \[00:0\d, .* left\]", shown)
    assert re.search(r"(^|[\r\n] *)\[2/4\] b done\n", shown)


def test_bar_of_iterations_shows_residual_and_keeps_notes_whole(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    bar = progress.IterationBar("relaxing", 200)
    bar.step(50, 3e-3)
    bar._bar.refresh()
    bar.note("relaxed")
    bar.close()
    assert re.search(
        r" 25%\|.*\| relaxing, residual 3\.00e-03 \[00:0\d, at most .* left\]", stream.getvalue()
    )
    assert re.search(r"(^|[\r\n] *)relaxed\n", stream.getvalue())


def test_lines_of_iterations_are_seconds_apart(clock, capsys):
    lines = progress.Iterations("relaxing", 200)
    for count in range(1, 8):
        clock.now += 3.0
        lines.step(count, 1e-3)
    lines.close()
    assert capsys.readouterr().err == "relaxing: iteration 4 of at most 200, residual 1.00e-03\n"


def test_bar_of_pictures_shows_count(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    bar = progress.PictureBar()
    bar.start(4)
    bar.drew()
    bar._bar.refresh()
    bar.close()
    assert re.search(r" 25%\|.*\| 1 of 4 pictures \[00:0\d, .* left\]", stream.getvalue())
    progress.PictureBar().close()  # of a movie that was refused before its first picture


def test_lines_of_pictures_are_seconds_apart(clock, capsys):
    lines = progress.Pictures()
    lines.start(7)
    for _ in range(7):
        clock.now += 3.0
        lines.drew()
    assert capsys.readouterr().err == "drew 4 of 7 pictures\n"


def on_terminal(monkeypatch, columns):
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(isatty=lambda: True, fileno=lambda: 2))
    monkeypatch.setattr(os, "get_terminal_size", lambda descriptor: os.terminal_size((columns, 24)))


def test_progress_is_bar_on_terminal_and_lines_elsewhere(monkeypatch):
    assert type(progress.suited()) is progress.Lines  # the tests' own stderr is no terminal
    on_terminal(monkeypatch, 80)
    assert type(progress.suited()) is progress.Bar
    assert type(progress.suited_to_pictures()) is progress.PictureBar
    monkeypatch.setattr(progress.IterationBar, "__init__", lambda *_: None)  # stderr takes no text
    assert type(progress.suited_to_iterations("relaxing", 9)) is progress.IterationBar
    on_terminal(monkeypatch, 0)
    assert type(progress.suited_to_iterations("relaxing", 9)) is progress.Iterations
    assert type(progress.suited()) is progress.Lines
    assert type(progress.suited_to_runs("points", 2)) is progress.RunLines
    assert type(progress.suited_to_pictures()) is progress.Pictures
    on_terminal(monkeypatch, 80)
    assert type(progress.suited_to_runs("trials", None)) is progress.RunLines


def test_lines_of_many_runs_count_where_their_number_is_known(capsys):
    known = progress.RunLines("runs", 12, 8)
    known.ended("a: pass")
    known.ended("b: pass")
    progress.RunLines("trials", None, 0).ended("physics.C = 0.1: stable")
    said = "8 of 12 runs are done already\n[ 9/12] a: pass\n[10/12] b: pass\n"
    assert capsys.readouterr().err == f"{said}physics.C = 0.1: stable\n"


def test_sweep_on_terminal_shows_bar(monkeypatch):
    stream = io.StringIO()
    stream.isatty, stream.fileno = lambda: True, lambda: 2
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(os, "get_terminal_size", lambda descriptor: os.terminal_size((80, 24)))
    told = command._Told(2, 0)
    told(Outcome("one", "done"))
    told.shown.close()
    assert "[1/2] one done\n" in stream.getvalue()
    assert " of 2 points" in stream.getvalue()


@pytest.mark.slow
def test_run_on_terminal_shows_bar_and_summary_on_stdout(tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    terminal, its_end = pty.openpty()
    ioctl(its_end, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "sph.cli", "run", "tube.toml", "-o", "run"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"},
        stdout=subprocess.PIPE,
        stderr=its_end,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    os.close(its_end)
    shown = b""
    try:
        while chunk := os.read(terminal, 65536):
            shown += chunk
    except OSError:  # how Linux tells that the other end has closed
        pass
    os.close(terminal)
    out = process.communicate(timeout=60)[0].decode()
    assert process.returncode == 0
    assert re.search(r" 0%\|.*left\]", shown.decode())
    assert re.search(r"\r +\d+%\|.*\| t = 0\.\d+ of 0\.4, step \d+, dt .*left\]", shown.decode())
    assert "checkpoint" not in shown.decode()
    assert out.startswith("shock_tube: ")
    assert "%|" not in out


def test_time_left_enormous_stays_short(clock, capsys):
    lines = progress.Lines()
    lines.start(0.0, 1e300)
    lines.step(at(1.0))
    clock.now += 20.0
    lines.step(at(2.0))
    assert capsys.readouterr().err.endswith("about 2.0e+301 s left\n")
