"""Locks of run directories, so that only one process writes to each."""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sph.errors import FileError
from sph.output.files import explained, holding

DIRECTORY = os.O_RDONLY | os.O_DIRECTORY

# Times that a lock is tried, and seconds between: `is_held` of another process has it for a moment.
ATTEMPTS, PAUSE = 5, 0.01


def is_held(directory: Path) -> bool | None:
    """Return whether a process has locked `directory`; None on file systems without locks."""
    try:
        descriptor = os.open(directory, DIRECTORY)
    except OSError:  # moved or removed
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return None
    else:
        return False
    finally:
        os.close(descriptor)


@contextmanager
def held(home: Path, inside: Path) -> Iterator[None]:
    """Lock the directory `inside` the directory `home` within the block.

    Files in both are written there even if other directories take their places. On file systems
    without locks, nothing is locked. Raises FileError if another process has locked it.
    """
    with explained(f"cannot open {home}"):
        outer = os.open(home, DIRECTORY)
        inner = os.open(inside.name, DIRECTORY | os.O_NOFOLLOW, dir_fd=outer)
    try:
        with suppress(OSError):  # a file system without locks
            if not _lock(inner):
                raise FileError(
                    f"{home} is in use by another run of sph.\n"
                    "Try: wait until that run has ended, or another directory, with -o."
                )
        with holding({home: outer, inside: inner}):
            yield
    finally:
        os.close(inner)
        os.close(outer)


def _lock(descriptor: int) -> bool:
    """Lock an open directory; return whether no other process has locked it."""
    for attempt in range(ATTEMPTS):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if attempt < ATTEMPTS - 1:
                time.sleep(PAUSE)
        else:
            return True
    return False
