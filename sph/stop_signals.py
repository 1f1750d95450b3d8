"""Signals that ask the program to stop.

A run notes them and acts between two steps. Anything else ends at once, in one line.
"""

import os
import signal
from contextlib import contextmanager, suppress

NUMBERS = (signal.SIGINT, signal.SIGTERM)


def name(number: int) -> str:
    """The signal in a user's words."""
    return "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name


def end_at_once() -> None:
    """From now on SIGINT and SIGTERM end the process: one line, no traceback, by that very signal.

    A signal that the caller has set to be ignored, as nohup and shells do, stays so.
    """
    for number in NUMBERS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)


def _end(number, _frame):
    _say(f"sph: ended by {name(number)}")
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)
    os._exit(128 + number)  # the first process of a container is not ended by a signal


def _say(text: str) -> None:
    """Write a line to stderr, not through sys.stderr, which may be in the middle of a write."""
    with suppress(OSError):
        beginning = "\n" if os.isatty(2) else ""  # a terminal shows "^C"
        os.write(2, f"{beginning}{text}\n".encode())


@contextmanager
def stop_signals(second=None):
    """A list that holds the name of the first SIGINT or SIGTERM once one has come.

    second: the handler of all later ones, for those who cannot wait for the end of a step; they
    act as they would without us if None.
    """
    came: list[str] = []

    def note(number, _frame):
        came.append(name(number))
        for one in NUMBERS:
            signal.signal(one, second or before[one])
        _say(f"{came[0]}: stopping after this step; again to stop at once")

    before = {number: signal.getsignal(number) for number in NUMBERS}
    for number in NUMBERS:
        signal.signal(number, note)
    try:
        yield came
    finally:
        for number in NUMBERS:
            signal.signal(number, before[number])
