"""Standard output and error; output that cannot be written is dropped."""

import io
import os
import sys
from contextlib import suppress

from sph.errors import FileError


class _Dropping(io.FileIO):
    """A file descriptor whose writes never raise: on a full disk or closed pipe, output is lost."""

    def __init__(self, descriptor: int):
        super().__init__(descriptor, "w", closefd=False)
        self.failure: OSError | None = None  # the first one, other than a closed pipe

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
    """Replace sys.stdout and sys.stderr by streams whose writes never raise.

    This covers messages of Python, NumPy and tqdm as well. Descriptors 0 to 2 that are closed are
    opened on /dev/null: otherwise the next file opened, such as a history, would get one of these
    numbers, and messages would be written into that file.
    """
    _fill_closed_descriptors()
    for name, descriptor in (("stdout", 1), ("stderr", 2)):
        stream = getattr(sys, name)
        if stream is None or stream is getattr(sys, f"__{name}__"):  # not one set by a caller
            setattr(sys, name, _dropping(stream, descriptor))


def note(text: str) -> None:
    """Write a line to stderr, or drop it if stderr cannot be written."""
    if sys.stderr is not None:  # print(file=None) would write to stdout
        with suppress(OSError, ValueError):  # ValueError: the stream is closed
            print(text, file=sys.stderr, flush=True)


def deliver(text: str) -> None:
    """Write `text`, a command's whole result, to stdout. Raises FileError if that fails.

    A reader such as `head` that closes the pipe early is not an error.
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
    # UTF-8 writes the original bytes of paths that are not UTF-8; other encodings escape characters
    # that they do not have
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
