"""`sph sweep` in this process or in a process of its own, and what it leaves behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
from click.testing import CliRunner

import sph
from sph.cli import main
from sph.output.checkpoint import state_hash
from sph.output.run_directory import RunDirectory

ROOT = Path(sph.__file__).parents[1]

# Long enough to be killed in its middle: some 0.3 s and twenty checkpoints.
TUBE = """\
[problem]
name = "shock_tube"
n = 40
[time]
end = 0.4
[output]
interval = 0.02
"""
TWELVE = ("--vary", "problem.n=40:60:+10", "--vary", "physics.alpha=0.5:2.0:+0.5")


class Program:
    """`sph` in a directory with a configuration, and what it leaves there."""

    def __init__(self, directory):
        self.directory = directory
        self.config = directory / "tube.toml"
        self.config.write_text(TUBE)

    def run(self, *arguments):
        """In this process."""
        return CliRunner().invoke(main, ["sweep", str(self.config), *map(str, arguments)])

    def started(self, *arguments):
        """In a process of its own, its standard error in a pipe."""
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        return subprocess.Popen(
            [sys.executable, "-m", "sph.cli", "sweep", str(self.config), *map(str, arguments)],
            cwd=self.directory,
            env={**os.environ, "PYTHONPATH": path},
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
            # a shell may have told its background jobs to ignore it
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )


def until(condition, seconds=60.0):
    """The first true value of `condition()`, looked at every hundredth of a second."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if value := condition():
            return value
        time.sleep(0.01)
    raise AssertionError("it never came to that")


def processes_of(run):
    """IDs of the processes that run the point in that directory."""
    listed = subprocess.run(
        ["ps", "-A", "-ww", "-o", "pid=", "-o", "args="], capture_output=True, text=True, check=True
    )
    lines = [line.split(None, 1) for line in listed.stdout.splitlines()]
    return [int(pid) for pid, args in lines if "sph.cli" in args and f"{run} " in f"{args} "]


def attempts(sweep_directory, name):
    """What was called for a point, "run" or "restart", in order."""
    log = (sweep_directory / "logs" / f"{name}.log").read_text()
    return [line.split()[2] for line in log.splitlines() if line.startswith("$ sph ")]


def runs(sweep_directory):
    """The points that have a run directory, by name."""
    found = (path for path in sorted(sweep_directory.iterdir()) if path.name != "logs")
    return {path.name: RunDirectory(path) for path in found if path.is_dir()}


def hashes(sweep_directory):
    """SHA-256 of the last state of every point, by name."""
    found = {}
    for name, run in runs(sweep_directory).items():
        with h5py.File(run.checkpoints()[-1]) as file:
            state = {key: dataset[()] for key, dataset in file["Checkpoint"].items()}
        found[name] = state_hash(state)
    return found


class KilledSweep:
    """A sweep of twelve points whose worker and whose parent were killed, and its second call."""

    def __init__(self, directory):
        self.program = Program(directory)
        self.path = directory / "killed"
        parent = self.program.started(*TWELVE, "--jobs", "2", "-o", self.path)
        for line in parent.stderr:
            if "[ 4/12]" in line:
                break
        self.worker = self._half_done()
        os.kill(processes_of(self.path / self.worker)[0], signal.SIGKILL)
        self.told = next(line for line in parent.stderr if self.worker in line)
        parent.kill()
        parent.communicate()
        self.before = self.done()
        self.second = self.program.run(*TWELVE, "--jobs", "2", "-o", self.path)

    def _half_done(self):
        def found():
            for name, run in runs(self.path).items():
                checkpoints = run.path.joinpath("checkpoints").glob("checkpoint_*.h5")
                if 2 <= len(list(checkpoints)) < 15 and processes_of(run.path):
                    return name
            return None

        return until(found)

    def done(self):
        """When each point was done that is."""
        summaries = {name: run.summary for name, run in runs(self.path).items()}
        return {name: path.stat().st_mtime_ns for name, path in summaries.items() if path.exists()}
