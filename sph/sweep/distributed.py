"""Run points on the workers of a Dask scheduler; all see the same files and paths.

A worker runs each point in a process of its own, one process for each thread of the worker.
"""

import time
import uuid
from collections.abc import Callable, Sequence

from sph.errors import ConfigError, FileError
from sph.stop_signals import stop_signals
from sph.sweep.local import share_threads
from sph.sweep.task import Outcome, Task, execute

CONNECT_SECONDS = 10
CHECK_SECONDS = 1.0  # between two checks whether the user asked to stop


def run(tasks: Sequence[Task], address: str, tell: Callable[[Outcome], None]) -> None:
    """Run every task on the scheduler at `address`; `tell` is called with each outcome.

    A point has one thread, unless run.threads is given. Ctrl-C stops all points.
    Raises ConfigError where Dask is not installed, FileError where no scheduler answers.
    """
    distributed = _distributed()
    with _client(distributed, address) as client, stop_signals() as came:
        event = f"sph-sweep-stop-{uuid.uuid4()}"
        futures = {
            client.submit(_on_worker, task, event, pure=False): task.point.name
            for task in share_threads(tasks, 1)
        }
        pending = set(futures)
        while pending:
            ended, pending = _wait(distributed, pending)
            for future in ended:
                tell(_outcome(future, futures[future]))
            if came:
                distributed.Event(event, client=client).set()


def _on_worker(task: Task, event: str) -> Outcome:
    from distributed import Event

    stop, asked, last = Event(event), 0, -CHECK_SECONDS

    def stops() -> int:
        nonlocal asked, last
        if time.monotonic() - last > CHECK_SECONDS:  # each check is a request to the scheduler
            asked, last = int(stop.is_set()), time.monotonic()
        return asked

    return execute(task, stops)


def _outcome(future, name: str) -> Outcome:
    """The outcome of a task that ended, or whose worker was lost."""
    if future.status == "finished":
        return future.result()
    reason = future.exception() if future.status == "error" else future.status
    return Outcome(name, "stopped", f"the worker was lost ({type(reason).__name__}: {reason})")


def _wait(distributed, pending: set) -> tuple[set, set]:
    try:
        ended, rest = distributed.wait(pending, CHECK_SECONDS, return_when="FIRST_COMPLETED")
    except (TimeoutError, distributed.TimeoutError):
        return set(), pending
    return set(ended), set(rest)


def _client(distributed, address: str):
    try:
        return distributed.Client(address, timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise FileError(
            f"no Dask scheduler answers at {address} ({error}).\n"
            "Try: the address that `dask scheduler` printed, e.g. tcp://127.0.0.1:8786."
        ) from None


def _distributed():
    try:
        import distributed
    except ImportError:
        raise ConfigError(
            '--scheduler needs Dask, which is not installed.\nTry: pip install "sph[dask]"'
        ) from None
    return distributed
