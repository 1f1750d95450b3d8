"""The program's first moments: signals while it imports, Python without docstrings, no POSIX."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import sph
from sph.docstrings import docstring

ROOT = Path(sph.__file__).parents[1]
# Sends the process a signal at the moment it begins to import a module.
HOOK = """
import runpy, signal, sys

class Finder:
    def find_spec(self, name, *_):
        if name == {module!r}:
            signal.raise_signal({number})

sys.meta_path.insert(0, Finder())
sys.argv = ["sph", *{arguments!r}]
runpy.run_module({program!r}, run_name="__main__", alter_sys=True)
"""
TUBE = '[problem]\nname = "shock_tube"\nn = 60\n[time]\nend = 0.001\n'


def python(*arguments, directory=ROOT, **environment):
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=directory,
        env=os.environ | {"PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        timeout=120,
        # a shell may have told its background jobs to ignore it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda one: one.name)
@pytest.mark.parametrize(
    ("program", "command", "module"),
    [
        ("sph", ["--version"], "click"),
        ("sph.cli", ["--version"], "click"),
        ("sph.cli", ["list"], "llvmlite.binding"),
        ("sph.cli", ["list"], "numba.core.dispatcher"),
        ("sph.cli", ["run", "tube.toml"], "pydantic"),
        ("sph.cli", ["run", "tube.toml"], "h5py"),
        ("sph.cli", ["plot", "tube.toml"], "sph.analysis.figures"),
    ],
)
def test_signal_during_import_ends_with_one_line(number, program, command, module, tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    code = HOOK.format(module=module, number=int(number), arguments=command, program=program)
    done = python("-c", code, directory=tmp_path)
    said = "Ctrl-C" if number == signal.SIGINT else "SIGTERM"
    # by the signal itself: what started it, a shell or a sweep, must know
    assert done.returncode == -number
    assert done.stderr == f"sph: ended by {said}\n"
    assert os.listdir(tmp_path) == ["tube.toml"]


def test_ignored_signal_stays_ignored():
    code = HOOK.format(module="click", number=2, arguments=["--version"], program="sph")
    ignoring = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{code}"
    done = python("-c", ignoring)
    assert (done.returncode, done.stdout) == (0, f"sph, version {sph.__version__}\n")


@pytest.mark.slow
@pytest.mark.parametrize("command", [["list"], ["--help"], ["sweep", "--help"], ["new", "gresho"]])
def test_output_without_docstrings_is_equal(command):
    plain, without = (python("-m", "sph", *command, PYTHONOPTIMIZE=level) for level in ("", "2"))
    assert (without.returncode, without.stderr) == (0, "")
    assert without.stdout == plain.stdout


def test_docstring_read_from_source():
    assert docstring(sys.modules[__name__]) == __doc__
    assert docstring(python) == ""
    assert docstring(docstring).startswith("Return the docstring of a module, class or function")


@pytest.mark.parametrize("missing", ["fcntl", "resource"])
def test_system_without_posix_exits_with_4(missing):
    code = f"import sys; sys.modules[{missing!r}] = None; from sph.__main__ import main; main()"
    done = python("-c", code)
    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr.startswith(
        "sph: this operating system is not supported: expected Linux or macOS.\n"
    )
