"""One point of a sweep, wherever it runs: look what its directory has, and do what is missing.

A point is run by `sph run` or `sph restart` in a process of its own. That process writes to the
point's log and holds, through it, the lock on the log: it goes with the process, however that ends.
So an orphan of a sweep that was killed goes on unharmed, and nobody else touches its directory.
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

POLL = 0.1  # seconds between two looks at a lock, a child or a wish to stop


class Outcome(NamedTuple):
    """How a point stands after an attempt."""

    name: str
    status: str  # "done", "failed" or "stopped": it has not ended, and goes on in the next sweep
    reason: str = ""
    how: str = ""  # "run" or "restart" in this attempt; empty where nothing was done
    code: int = 0  # exit code of this attempt
    warnings: tuple[str, ...] = ()  # the kinds of warning that a done point ended with


@dataclass(frozen=True)
class Task:
    """All that another machine needs to run a point, given the same files."""

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
        """Where the reason stands if the last attempt failed."""
        return self.sweep.logs / f"{self.point.name}.failed"

    @property
    def status(self) -> str | None:
        """The status in summary.json, or None while there is none."""
        return self.run.read_summary().get("status")

    def command(self) -> list[str]:
        """What does the rest of this point: go on from the last good checkpoint, or run anew."""
        program = [sys.executable, "-m", "sph.cli"]
        threads = [] if self.threads is None else ["--threads", str(self.threads)]
        if self.status != "failed" and _can_go_on(self.run):
            return [*program, "restart", str(self.run.path), *threads]
        sets = [part for one in (*self.overrides, *self.point.settings) for part in ("--set", one)]
        target = ["-o", str(self.run.path), "--force"]
        return [*program, "run", str(self.sweep.base), *sets, *target, *threads]


def tasks(sweep: SweepDirectory, plan: Plan) -> list[Task]:
    """A task for each point, done or not; threads are not shared out yet."""
    return [Task(sweep, point, plan.overrides) for point in plan.points]


def chooses_threads(task: Task) -> bool:
    """Whether the user gave run.threads, by --set or --vary."""
    return any(one.startswith("run.threads=") for one in (*task.overrides, *task.point.settings))


def execute(task: Task, stops: Callable[[], int] = lambda: 0) -> Outcome:
    """Bring a point to its end, once nobody else is at it; the outcome tells of all errors.

    stops(): how often a stop has been asked for. At the first the run writes a checkpoint and
    ends, at a second it ends at once.
    """
    try:
        if not task.sweep.is_one:
            raise FileError(f"{task.sweep.path} is not there: the sweep's files must be shared")
        with explained(f"cannot run {task.point.name}"), _locked(task.log, stops) as log:
            if task.status == "done":
                return _done(task)
            return _attempt(task, log, stops)
    except Stopped as stopped:
        return Outcome(task.point.name, "stopped", str(stopped))
    except SphError as error:
        return Outcome(task.point.name, "failed", str(error), code=error.exit_code)


def standing(task: Task) -> Outcome:
    """How a point stands by its files, whoever ran it."""
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
    with suppress(OSError):  # the disk is full: the run will say so
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
    """The exit code of `child`, which is sent a SIGTERM for each stop that is asked for."""
    sent = 0
    try:
        while True:
            with suppress(subprocess.TimeoutExpired):
                return child.wait(POLL)
            while sent < stops():
                child.terminate()
                sent += 1
    finally:
        if child.returncode is None and not sent:  # we are being torn down: do not leave it alone
            child.terminate()


def _reason(task: Task, code: int, begin: int) -> str:
    """Why an attempt failed: in the summary's words, or the last that the run said."""
    if code == NumericalError.exit_code and task.status == "failed":
        return str(task.run.read_summary().get("reason"))
    said = task.log.read_bytes()[begin:].decode(errors="replace").strip()
    message = re.search(r"^sph: (.*)", said, re.MULTILINE | re.DOTALL)
    last = said.splitlines()[-1] if said else "it said nothing"
    return message[1] if message else f"exit code {code}: {last}"


@contextmanager
def _locked(path: Path, stops: Callable[[], int]) -> Iterator[BinaryIO]:
    """`path`, open to append to and locked, as soon as no process holds it. Raises Stopped."""
    with open(open_to_append(path), "ab", buffering=0) as file:
        while True:
            with suppress(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            if stops():
                raise Stopped("another process is at it")
            time.sleep(POLL)
        if stops():
            raise Stopped("it was not begun")
        yield file


def _can_go_on(run: RunDirectory) -> bool:
    if not (run.config.is_file() and has_checkpoints(run)):
        return False
    try:
        run.latest()
    except Damaged:
        return False
    return True
