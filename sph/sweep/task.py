"""One point of a sweep, on any machine: looks into its directory and does what is missing.

A point is run by `sph run` or `sph restart` in a process of its own. That process writes to the log
of the point and holds a lock on it, which the system releases when the process ends. A process that
outlives a killed sweep therefore continues, and no other process touches its directory.
"""

import fcntl
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from sph import warnings
from sph.errors import FileError, NumericalError, SphError, Stopped
from sph.output.files import Damaged, explained, open_to_append, write_text
from sph.output.run_directory import RunDirectory
from sph.sweep.manifest import SweepDirectory, has_checkpoints, reason_in
from sph.sweep.plan import Plan, Point

POLL = 0.1  # seconds between two checks of a lock, a child process or a stop signal


class Outcome(NamedTuple):
    """The state of a point after an attempt."""

    name: str
    status: str  # "done", "failed", or "stopped": not ended, the next sweep continues it
    reason: str = ""
    how: str = ""  # "run" or "restart" in this attempt; empty where the point had ended
    code: int = 0  # exit code of this attempt
    warnings: tuple[str, ...] = ()  # the kinds of warning that a done point ended with


@dataclass(frozen=True)
class Task:
    """What another machine needs to run a point, given the same files."""

    sweep: SweepDirectory
    point: Point
    overrides: tuple[str, ...]  # shared by all points
    threads: int | None = None  # None: as the configuration says

    @property
    def run(self) -> RunDirectory:
        return RunDirectory(self.sweep.path / self.point.name)

    @property
    def log(self) -> Path:
        return self.sweep.logs / f"{self.point.name}.log"

    @property
    def failure(self) -> Path:
        """The file with the reason, if the last attempt failed."""
        return self.sweep.logs / f"{self.point.name}.failed"

    @property
    def status(self) -> str | None:
        """The status in summary.json; None without that file."""
        return self.run.read_summary().get("status")

    def command(self) -> list[str]:
        """The command that completes this point: a restart, or a run from the initial state."""
        program = [sys.executable, "-m", "sph.cli"]
        threads = [] if self.threads is None else ["--threads", str(self.threads)]
        if self.status != "failed" and _can_go_on(self.run):
            return [*program, "restart", str(self.run.path), *threads]
        sets = [part for one in (*self.overrides, *self.point.settings) for part in ("--set", one)]
        target = ["-o", str(self.run.path), "--force"]
        return [*program, "run", str(self.sweep.base), *sets, *target, *threads]


def tasks(sweep: SweepDirectory, plan: Plan) -> list[Task]:
    """A task for each point, ended or not; `share_threads` sets their threads."""
    return [Task(sweep, point, plan.overrides) for point in plan.points]


def chooses_threads(task: Task) -> bool:
    """Whether the user gave run.threads, by --set or --vary."""
    return any(one.startswith("run.threads=") for one in (*task.overrides, *task.point.settings))


def execute(task: Task, stops: Callable[[], int] = lambda: 0) -> Outcome:
    """Run a point to its end, as soon as no other process runs it; errors are in the outcome.

    stops(): the number of stop signals so far. After the first, the run writes a checkpoint and
    ends; after a second, it ends at once.
    """
    try:
        if not task.sweep.is_one:
            raise FileError(
                f"{task.sweep.path} does not exist: the files of a sweep must be shared"
            )
        with explained(f"cannot run {task.point.name}"), _locked(task.log, stops) as log:
            if task.status == "done":
                return _done(task)
            return _attempt(task, log, stops)
    except Stopped as stopped:
        return Outcome(task.point.name, "stopped", str(stopped))
    except SphError as error:
        return Outcome(task.point.name, "failed", str(error), code=error.exit_code)


def standing(task: Task) -> Outcome:
    """The state of a point from its files."""
    name = task.point.name
    if task.status == "done":
        return _done(task)
    if task.failure.is_file():
        return Outcome(name, "failed", reason_in(task.failure))
    return Outcome(name, "stopped", "it has not ended")


def _done(task: Task, how: str = "") -> Outcome:
    warned = tuple(warnings.kinds(task.run.read_summary()))
    return Outcome(task.point.name, "done", how=how, warnings=warned)


def _attempt(task: Task, log: BinaryIO, stops: Callable[[], int]) -> Outcome:
    task.failure.unlink(missing_ok=True)
    command = task.command()
    with suppress(OSError):  # the disk is full: the run reports that
        log.write(f"$ sph {shlex.join(command[3:])}\n".encode(errors="surrogateescape"))
    begin = log.tell()
    # A session of its own: Ctrl-C at the terminal reaches us alone, and we pass it on once.
    child = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
    )
    code = _wait(child, stops)
    how, name = command[3], task.point.name
    if code == 0 and task.status == "done":
        return _done(task, how)
    if code == Stopped.exit_code or code < 0:
        reason = f"ended by signal {-code}" if code < 0 else "stopped, with a checkpoint"
        return Outcome(name, "stopped", reason, how)
    reason = _reason(task, code, begin)
    with suppress(FileError):  # a full disk must not hide why the run failed
        write_text(task.failure, reason + "\n")
    return Outcome(name, "failed", reason, how, code)


def _wait(child: subprocess.Popen, stops: Callable[[], int]) -> int:
    """The exit code of `child`; sends it a SIGTERM for each stop signal."""
    sent = 0
    try:
        while True:
            with suppress(subprocess.TimeoutExpired):
                return child.wait(POLL)
            while sent < stops():
                child.terminate()
                sent += 1
    finally:
        if child.returncode is None and not sent:  # this process is ending: end the child too
            child.terminate()


def _reason(task: Task, code: int, begin: int) -> str:
    """Why an attempt failed: from the summary, or else the last message of the run."""
    if code == NumericalError.exit_code and task.status == "failed":
        return str(task.run.read_summary().get("reason"))
    said = task.log.read_bytes()[begin:].decode(errors="replace").strip()
    message = re.search(r"^sph: (.*)", said, re.MULTILINE | re.DOTALL)
    last = said.splitlines()[-1] if said else "no message"
    return message[1] if message else f"exit code {code}: {last}"


@contextmanager
def _locked(path: Path, stops: Callable[[], int]) -> Iterator[BinaryIO]:
    """Wait until no process locks `path`, then open it to append, with a lock. Raises Stopped."""
    with open(open_to_append(path), "ab", buffering=0) as file:
        while True:
            with suppress(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            if stops():
                raise Stopped("another process is running this point")
            time.sleep(POLL)
        if stops():
            raise Stopped("not started")
        yield file


def _can_go_on(run: RunDirectory) -> bool:
    if not (run.config.is_file() and has_checkpoints(run)):
        return False
    try:
        run.latest()
    except Damaged:
        return False
    return True
