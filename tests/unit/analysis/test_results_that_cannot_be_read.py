"""Commands on results that are missing, damaged, or of a problem file that has changed."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from sph.cli import main

CLOUDS = (Path(__file__).parents[3] / "docs" / "notebooks" / "two_clouds.py").read_text()
CONFIG = """\
[problem]
file = "clouds.py"
n = 64
[time]
end = 0.002
[output]
interval = 0.001
[run]
threads = 1
"""
EXACT = "\n    def exact(self, eos, time, position):\n        return self.solution[time]\n"


def sph_(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A directory with a problem file, and a run of it in `run`."""
    home = tmp_path_factory.mktemp("home")
    (home / "clouds.py").write_text(CLOUDS)
    (home / "clouds.toml").write_text(CONFIG)
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert done.exit_code == 0, done.output
    shutil.copytree(home / "run", home / "whole")
    return home


@pytest.fixture
def run(home):
    """The run, whole."""
    (home / "clouds.py").write_text(CLOUDS)
    shutil.rmtree(home / "run")
    shutil.copytree(home / "whole", home / "run")
    return home / "run"


def empty(run):
    shutil.rmtree(run)
    run.mkdir()


def not_a_run(run):
    empty(run)
    (run / "notes.txt").write_text("mine")


def killed_before_first_checkpoint(run):
    for path in (run / "checkpoints").iterdir():
        path.unlink()
    (run / "summary.json").unlink()


def truncated(run):
    for path in (run / "checkpoints").iterdir():
        path.write_bytes(path.read_bytes()[:3000])


def without_problem_file(run):
    (run.parent / "clouds.py").unlink()


def with_broken_problem_file(run):
    (run.parent / "clouds.py").write_text("x = (\n")


def with_fault_in_exact(run):
    (run.parent / "clouds.py").write_text(CLOUDS + EXACT)


STATES = [
    empty, not_a_run, killed_before_first_checkpoint, truncated, without_problem_file,
    with_broken_problem_file, with_fault_in_exact,
]  # fmt: skip
# what a command can say nevertheless: the configuration, the summary, the state in a checkpoint
ENOUGH = {
    ("info", killed_before_first_checkpoint),
    *(("report", state) for state in STATES[2:]),
    # pictures and profiles of maps have no exact solution
    *((command, with_fault_in_exact) for command in ("info", "export --csv", "movie", "restart")),
}  # fmt: skip


@pytest.mark.parametrize("command", ["info", "plot", "export --csv", "movie", "report", "restart"])
@pytest.mark.parametrize("state", STATES, ids=lambda state: state.__name__)
def test_message_without_traceback(run, command, state):
    state(run)
    shutil.rmtree(run.parent / "report", ignore_errors=True)
    name, *options = command.split()
    done = sph_(name, run, *options, *(["-o", run.parent / "report"] if name == "report" else []))
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    if (command, state) in ENOUGH:
        assert done.exit_code == 0, done.output
        return
    assert done.exit_code == (2 if state is with_fault_in_exact else 4), done.output
    assert done.stderr.startswith("sph: ")
    if state is with_fault_in_exact:
        assert "clouds.py, line " in done.stderr
        assert "    return self.solution[time]" in done.stderr
    else:
        assert "Try: " in done.stderr


@pytest.mark.parametrize("state", [truncated, with_broken_problem_file])
def test_words_on_run_that_cannot_be_read(run, messages, state):
    state(run)
    messages.check(sph_("info", run).stderr, mask=r"(?<=Error: ).*|\(Unable.*\)")


def test_report_of_file_says_so(run, messages):
    messages.check(sph_("report", run / "config.toml").stderr)
