"""Run points as jobs of a Slurm cluster, by submitit, on a file system that all nodes share.

Shortly before the time limit of a job, its run writes a checkpoint and the job is queued again; the
new job continues by `sph restart`.
"""

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from sph.errors import ConfigError
from sph.stop_signals import stop_signals
from sph.sweep.local import share_threads
from sph.sweep.task import POLL, Outcome, Task, execute, standing

CHECK_SECONDS = 1.0  # between two checks of the jobs
# A point may reach its time limit any number of times.
MOST_TIMEOUTS = 10_000
# Options of submitit for every cluster; all others are options of Slurm, with its prefix.
GENERIC = ("name", "timeout_min", "mem_gb", "nodes", "cpus_per_task")


class Job:
    """The callable that submitit runs in a job; submitit calls `checkpoint` before the limit."""

    def __init__(self):
        self.stops = 0

    def __call__(self, task: Task) -> None:
        # On a thread: submitit's signal handler runs in the main one, and must not wait for itself.
        self.thread = threading.Thread(target=execute, args=(task, lambda: self.stops))
        self.thread.start()
        try:
            self._join()
        finally:
            self.stops += 1

    def checkpoint(self, task: Task):
        """Stop the run with a checkpoint; returns the submission that continues it."""
        from submitit.helpers import DelayedSubmission

        self.stops += 1
        self._join()
        return DelayedSubmission(Job(), task)

    def _join(self) -> None:
        while self.thread.is_alive():
            time.sleep(POLL)


def run(
    tasks: Sequence[Task],
    options: Sequence[str],
    jobs: int | None,
    tell: Callable[[Outcome], None],
) -> None:
    """Submit every task, at most `jobs` at once, and wait; `tell` is called with each outcome.

    options: `KEY=VALUE` of submitit, e.g. timeout_min=60, cpus_per_task=4, partition=short;
    cluster=local runs without Slurm. A point has cpus_per_task threads, unless run.threads is
    given. Ctrl-C cancels the jobs; their runs write a checkpoint. Raises ConfigError.
    """
    if not tasks:
        return
    given = _read(options)
    executor = _executor(tasks[0].sweep.logs / "slurm", given, jobs)
    threaded = share_threads(tasks, given.get("cpus_per_task", 1))
    submitted = executor.map_array(Job(), threaded)
    pending = dict(zip(threaded, submitted, strict=True))
    with stop_signals() as came:
        while pending:
            for task in [task for task, job in pending.items() if job.done()]:
                del pending[task]
                tell(standing(task))
            if came:
                _cancel(pending, tell)
                return
            time.sleep(CHECK_SECONDS if pending else 0)


def _cancel(pending: dict, tell: Callable[[Outcome], None]) -> None:
    for job in pending.values():
        job.cancel(check=False)
    for task in pending:
        tell(Outcome(task.point.name, "stopped", "its job was cancelled"))


def _read(options: Sequence[str]) -> dict[str, Any]:
    """{key: value}, numbers as such. Raises ConfigError."""
    found: dict[str, Any] = {}
    for option in options:
        key, equals, value = option.partition("=")
        if not equals or not key:
            raise ConfigError(f"--slurm {option}: expected KEY=VALUE, e.g. timeout_min=60")
        found[key] = int(value) if value.isdecimal() else value
    return found


def _executor(folder, given: dict[str, Any], jobs: int | None):
    try:
        import submitit
    except ImportError:
        raise ConfigError(
            '--slurm needs submitit, which is not installed.\nTry: pip install "sph[slurm]"'
        ) from None
    cluster = given.pop("cluster", "slurm")
    parameters = {key if key in GENERIC else f"slurm_{key}": given[key] for key in given}
    if jobs is not None:
        parameters["slurm_array_parallelism"] = jobs
    try:
        executor = submitit.AutoExecutor(
            folder,
            cluster=cluster,
            slurm_max_num_timeout=MOST_TIMEOUTS,
            local_max_num_timeout=MOST_TIMEOUTS,
        )
        executor.update_parameters(**parameters)
    except (ValueError, NameError, AssertionError, RuntimeError) as error:
        raise ConfigError(f"--slurm: {error}") from None
    return executor
