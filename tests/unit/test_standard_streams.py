"""A run outlives its log: full disks, closed pipes, closed descriptors, hung-up terminals."""

import io
import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

import sph
from sph import progress, standard_streams
from sph.output import history

ROOT = Path(sph.__file__).parents[1]
ENVIRONMENT = {
    **os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
}  # fmt: skip
TUBE = """\
[problem]
name = "shock_tube"
n = 40
[time]
end = 0.1
[output]
interval = 0.05
[run]
threads = 1
"""
RUN = "run tube.toml -o run"
SWEEP = "sweep tube.toml --vary problem.n=40 -o sweep"


@pytest.fixture
def shell(tmp_path):
    """`sph` and its redirections as a shell does them; the exit code of sph, and what is left."""
    (tmp_path / "tube.toml").write_text(TUBE)

    def called(arguments):
        return subprocess.run(
            ["bash", "-c", f'"{sys.executable}" -m sph.cli {arguments}; exit ${{PIPESTATUS[0]}}'],
            cwd=tmp_path,
            env=ENVIRONMENT,
            capture_output=True,
            text=True,
            timeout=120,
        )

    return called


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (f"{RUN} >/dev/full 2>/dev/full", 0),
        (f"{RUN} 2>&1 | true", 0),
        (f"{RUN} >&- 2>&- <&-", 0),
        (f"{SWEEP} >/dev/full 2>&1", 0),
        ("list >/dev/full", 0),
        ("run missing.toml 2>/dev/full", 4),
        (f"{RUN} --set physics.C=-1 2>&-", 2),
        (f"{RUN} --set physics.max_energy_drift=1e-300 >/dev/full 2>&1", 3),
        ("--nonsense 2>/dev/full", 2),
        # here the text is all that the command makes, so its loss is an error
        ("new noh >/dev/full", 4),
        (f"{RUN} --dry-run >/dev/full", 4),
        ("new noh | true", 0),
    ],
)
def test_unwritable_streams_keep_exit_code(arguments, code, shell, tmp_path):
    result = shell(arguments)
    assert result.returncode == code, result.stderr
    assert "Traceback" not in result.stderr
    assert "Exception ignored" not in result.stderr
    if code == 0 and arguments.startswith(RUN):
        assert (tmp_path / "run" / "summary.json").exists()


@pytest.mark.slow
def test_signal_without_stderr_stops_run_and_keeps_files(tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    # a file of the run must not be descriptor 2, to which the signal handler writes
    (tmp_path / "stopping.py").write_text(
        "import os, signal\n"
        "from sph import progress\n"
        "def step(*_):\n"
        "    null = os.stat(os.devnull)\n"
        "    assert all(os.path.samestat(os.fstat(one), null) for one in range(3))\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "progress.Lines.step = step\n"
        "from sph.cli import main\n"
        "main()\n"
    )
    command = f'"{sys.executable}" stopping.py {RUN} <&- >&- 2>&-'
    code = subprocess.run(
        ["bash", "-c", command],
        cwd=tmp_path,
        env=ENVIRONMENT,
        timeout=120,
        check=False,
    ).returncode
    assert code == 75
    assert len(history.read(tmp_path / "run" / "history.csv")["step"]) == 2


@pytest.mark.slow
def test_terminal_hangup_does_not_end_run(tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    terminal, its_end = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "sph.cli", *RUN.split()],
        cwd=tmp_path,
        env=ENVIRONMENT,
        stdout=its_end,
        stderr=its_end,
    )
    os.close(its_end)
    os.read(terminal, 1)
    os.close(terminal)
    assert process.wait(120) == 0
    assert (tmp_path / "run" / "summary.json").exists()


def test_stream_drops_unwritable_text_and_keeps_reason():
    descriptor = os.open("/dev/full", os.O_WRONLY)
    stream = standard_streams._dropping(None, descriptor)
    print("x" * 100_000, file=stream, flush=True)
    print("more", file=stream, flush=True)
    assert "No space left" in str(stream.buffer.raw.failure)
    stream.close()
    os.close(descriptor)


def test_paths_not_utf8_written_as_bytes(tmp_path):
    descriptor = os.open(tmp_path / "out", os.O_WRONLY | os.O_CREAT)
    stream = standard_streams._dropping(None, descriptor)
    print("run-\udcff …", file=stream, flush=True)
    stream.close()
    os.close(descriptor)
    assert (tmp_path / "out").read_bytes() == b"run-\xff \xe2\x80\xa6\n"


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_other_encodings_escape_missing_characters(encoding, tmp_path):
    descriptor = os.open(tmp_path / "out", os.O_WRONLY | os.O_CREAT)
    stream = standard_streams._dropping(io.TextIOWrapper(io.BytesIO(), encoding), descriptor)
    print("\udcff …", file=stream, flush=True)
    stream.close()
    os.close(descriptor)
    assert (tmp_path / "out").read_bytes() == b"\\udcff \\u2026\n"


class FullStream(io.StringIO):
    def write(self, text):
        raise OSError(28, "No space left on device")


@pytest.mark.parametrize("say", [progress.Lines().note, progress.RunLines("points", 2, 0).note])
@pytest.mark.parametrize("kind", ["full", "closed", "none"])
def test_notes_to_python_caller_dropped_when_unwritable(kind, say, monkeypatch, capsys):
    stream = {"full": FullStream(), "closed": io.StringIO(), "none": None}[kind]
    if kind == "closed":
        stream.close()
    monkeypatch.setattr(sys, "stderr", stream)
    say("lost")
    assert type(progress.suited()) is progress.Lines
    assert capsys.readouterr().out == ""
