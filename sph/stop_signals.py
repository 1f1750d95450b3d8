"""Signals that ask a run to stop: noted when they come, acted upon between two steps."""

import os
import signal
from contextlib import contextmanager, suppress


@contextmanager
def stop_signals():
    """A list that holds the name of the first SIGINT or SIGTERM once one has come.

    A second one acts as it would without us, for those who cannot wait for the end of a step.
    """
    came: list[str] = []
    numbers = (signal.SIGINT, signal.SIGTERM)

    def note(number, _frame):
        came.append("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
        for one in numbers:
            signal.signal(one, before[one])
        # not through sys.stderr, which may be in the middle of a write
        with suppress(OSError):
            os.write(2, f"\n{came[0]}: stopping after this step; again to stop at once\n".encode())

    before = {number: signal.getsignal(number) for number in numbers}
    for number in numbers:
        signal.signal(number, note)
    try:
        yield came
    finally:
        for number in numbers:
            signal.signal(number, before[number])
