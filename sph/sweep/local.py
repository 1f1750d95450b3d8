"""Run points on this machine: a few processes at a time, which share its processors."""

import signal
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import replace

from sph.stop_signals import stop_signals
from sph.sweep.task import POLL, Outcome, Task, chooses_threads, execute
from sph.threads import available_processors


def run(tasks: Sequence[Task], jobs: int | None, tell: Callable[[Outcome], None]) -> None:
    """Run every task, `jobs` at once (None: the number of processors); calls `tell` with outcomes.

    After a first SIGINT or SIGTERM, runs write a checkpoint and end, and no further run starts. A
    second signal ends all runs at once and raises KeyboardInterrupt.
    """
    processors = available_processors()
    jobs = min(jobs or processors, len(tasks)) or 1
    asked = 0
    with stop_signals(signal.default_int_handler) as came, ThreadPoolExecutor(jobs) as pool:
        pending = {
            pool.submit(execute, task, lambda: asked)
            for task in share_threads(tasks, max(1, processors // jobs))
        }
        try:
            while pending:
                ended, pending = wait(pending, POLL, FIRST_COMPLETED)
                asked = len(came)
                for future in ended:
                    tell(future.result())
        except BaseException:
            asked = 2
            raise


def share_threads(tasks: Sequence[Task], threads: int) -> list[Task]:
    """The tasks with `threads` threads each, unless the user gave run.threads."""
    return [task if chooses_threads(task) else replace(task, threads=threads) for task in tasks]
