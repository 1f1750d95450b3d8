"""SIGINT (Ctrl-C) and SIGTERM: a run stops after its current step, all else stops at once."""

import os
import signal
import threading
from contextlib import contextmanager, suppress

NUMBERS = (signal.SIGINT, signal.SIGTERM)

_noted: list[int] = []  # signals that `stop_signals` has received


class Ended(BaseException):
    """Work that leaves nothing to continue from ends because of a signal."""


def name(number: int) -> str:
    """Return the name of a signal for messages: "Ctrl-C" or "SIGTERM"."""
    return "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name


def end_at_once() -> None:
    """Install handlers that print one line and end the process by the signal received.

    There is no traceback. A signal that the parent process ignores, as under nohup, stays ignored.
    """
    for number in NUMBERS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)


def _end(number, _frame):
    _say(f"sph: ended by {name(number)}")
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)
    os._exit(128 + number)  # reached as process 1 of a container, which signals do not end


def _say(text: str) -> None:
    """Write a line to descriptor 2, since sys.stderr may be in the middle of a write."""
    with suppress(OSError):
        beginning = "\n" if os.isatty(2) else ""  # a terminal shows "^C"
        os.write(2, f"{beginning}{text}\n".encode())


def heed() -> None:
    """Raise Ended if `stop_signals` has received a signal: it ends the process as if sent again.

    For long work before the first checkpoint.
    """
    if _noted and threading.current_thread() is threading.main_thread():
        raise Ended


@contextmanager
def stop_signals(second=None):
    """Yield a list to which the name of the first SIGINT or SIGTERM is added.

    second: handler of later signals, for users who do not wait for the end of the step. If None,
    later signals are handled as before. Only the main thread can receive signals: elsewhere the
    list stays empty.
    """
    received: list[str] = []
    if threading.current_thread() is not threading.main_thread():
        yield received
        return

    def note(number, _frame):
        received.append(name(number))
        _noted.append(number)
        for one in NUMBERS:
            signal.signal(one, second or before[one])
        _say(f"{received[0]}: stopping after this step; send it again to stop at once")

    before = {number: signal.getsignal(number) for number in NUMBERS}
    for number in NUMBERS:
        signal.signal(number, note)
    is_ended = False
    try:
        yield received
    except Ended:
        is_ended = True
    finally:
        first = [*_noted]
        _noted.clear()
        for number in NUMBERS:
            signal.signal(number, before[number])
    if is_ended:
        signal.raise_signal(first[0])
        raise KeyboardInterrupt  # reached if a handler of the caller ignores the signal
