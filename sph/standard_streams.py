"""Standard output and error: what cannot be written there is dropped, and never ends a run."""

import io
import os
import sys
from contextlib import suppress

from sph.errors import FileError


class _Dropping(io.FileIO):
    """A descriptor to write to that drops what cannot be written: full disk, closed pipe."""

    def __init__(self, descriptor: int):
        super().__init__(descriptor, "w", closefd=False)
        self.failure: OSError | None = None  # the first one, but for a reader who has gone

    def write(self, content) -> int:
        try:
            written = super().write(content)
        except BrokenPipeError:
            written = None
        except OSError as error:
            self.failure = self.failure or error
            written = None
        return len(content) if written is None else written


def secure() -> None:
    """Let no write to stdout or stderr raise, also none of Python itself, NumPy or tqdm.

    Descriptors 0 to 2 that are closed become /dev/null: else the next file that is opened, a
    history for instance, would be stdout or stderr, and messages would be written into that file.
    """
    _fill_closed_descriptors()
    for name, descriptor in (("stdout", 1), ("stderr", 2)):
        stream = getattr(sys, name)
        if stream is None or stream is getattr(sys, f"__{name}__"):  # else a caller's own
            setattr(sys, name, _dropping(stream, descriptor))


def note(text: str) -> None:
    """A line on stderr, dropped where it cannot be written."""
    if sys.stderr is not None:  # print() would take stdout in place of None
        with suppress(OSError, ValueError):  # ValueError: the stream is closed
            print(text, file=sys.stderr, flush=True)


def deliver(text: str) -> None:
    """Write `text` to stdout where it is all that a command makes. Raises FileError.

    A reader who has gone, as `head` does, has had enough: no error.
    """
    with suppress(BrokenPipeError):
        print(text, end="", flush=True)
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    if isinstance(raw, _Dropping) and raw.failure is not None:
        raise FileError(f"standard output cannot be written: {raw.failure.strerror}.")


def _dropping(stream: io.TextIOBase | None, descriptor: int) -> io.TextIOWrapper:
    if stream is not None:
        with suppress(OSError, ValueError):
            stream.flush()
    encoding = getattr(stream, "encoding", None) or "utf-8"
    # paths that are not UTF-8 come out as their own bytes; other encodings escape what they lack
    exact = encoding.lower().replace("-", "") == "utf8"
    return io.TextIOWrapper(
        io.BufferedWriter(_Dropping(descriptor)),
        encoding,
        "surrogateescape" if exact else "backslashreplace",
        line_buffering=descriptor == 2 or getattr(stream, "line_buffering", False),
    )


def _fill_closed_descriptors() -> None:
    with suppress(OSError):  # no /dev/null here
        while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
            pass
        os.close(descriptor)
