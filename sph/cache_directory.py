"""Directories of compiled code on disk: whose they are, and which old ones are removed.

An entry is executable code, so a directory is used only if no other user can write to it. Each
process holds a shared lock on its directory until it ends; only a directory without such a lock is
removed.
"""

import errno
import fcntl
import functools
import hashlib
import os
import re
import shutil
import stat
import sys
import time
import uuid
from contextlib import suppress
from pathlib import Path

import platformdirs

from sph import fingerprint

# Most directories (of other sources, versions, processors or settings) that are kept, and most
# bytes in them. A scene takes 2 MB, all tests together 50 MB.
KEPT = 16
KEPT_BYTES = 400_000_000

NAME = re.compile(r"sph-\d[\w.+]*-[0-9a-f]{16}")
DIGEST = hashlib.sha256().digest_size

# How often a directory is opened that another process is removing, and the seconds in between.
ATTEMPTS, PAUSE = 100, 0.02


def place() -> Path | None:
    """Return the parent of all cache directories, or None if the user has no cache directory.

    This is NUMBA_CACHE_DIR if that is set, otherwise a subdirectory of the user's cache directory:
    $XDG_CACHE_HOME/sph or ~/.cache/sph, on macOS ~/Library/Caches/sph.
    """
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen).absolute()
    base = Path(platformdirs.user_cache_dir("sph"))
    return base / "compiled" if base.is_absolute() else None  # "~" stays for a user without a home


class Directory:
    """A cache directory, opened when an entry is first needed.

    An entry is executable code, so the directory is used only if no other user can write to it.
    Owner and permissions are read from the open descriptor, through which all files are accessed.
    """

    def __init__(self, path: Path | None):
        self.path = path
        self.reason = ""  # why the directory cannot be used or written
        self._has_warned = False

    @functools.cached_property
    def descriptor(self) -> int | None:
        """Descriptor of the directory, under a shared lock until the process ends, or None."""
        if self.path is None or not fingerprint.facts()["sources of sph"]:
            self._refuse("there is no home directory, or there are no source files of sph")
            return None
        is_new = not self.path.is_dir()
        try:
            opened = _open(self.path)
        except OSError as error:
            self._refuse(error.strerror)
            return None
        if danger := _danger(os.fstat(opened)):
            os.close(opened)
            self._refuse(danger)
            return None
        if is_new:
            prune(self.path.parent)
        return opened

    @property
    def name(self) -> str:
        return self.path.name if self.path else ""

    def read(self, name: str) -> bytes | None:
        """Return the content of an entry, or None if it is missing, damaged or not the user's."""
        try:
            entry = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK,
                            dir_fd=self.descriptor)  # fmt: skip
            with open(entry, "rb") as file:
                status = os.fstat(entry)
                if _danger(status) or not stat.S_ISREG(status.st_mode):
                    return None
                digest, content = file.read(DIGEST), file.read()
        except OSError:
            return None
        return content if hashlib.sha256(content).digest() == digest else None

    def write(self, name: str, content: bytes) -> None:
        """Write an entry atomically. If that fails, print a warning once."""
        unfinished = f"{name}.{uuid.uuid4().hex}"
        try:
            entry = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600,
                            dir_fd=self.descriptor)  # fmt: skip
            try:
                with open(entry, "wb") as file:
                    file.write(hashlib.sha256(content).digest() + content)
                os.replace(unfinished, name, src_dir_fd=self.descriptor, dst_dir_fd=self.descriptor)
            except BaseException:
                with suppress(OSError):
                    os.unlink(unfinished, dir_fd=self.descriptor)
                raise
        except OSError as error:
            self._refuse(error.strerror)
            self.warn()

    def warn(self) -> None:
        """Print once why compiled code cannot be cached."""
        if not self._has_warned:
            self._has_warned = True
            print(
                f"sph: compiled code cannot be cached in {self.path or 'a cache directory'}: "
                f"{self.reason}. Every process will compile again.\nTry: set the environment "
                "variable NUMBA_CACHE_DIR to a directory of your own with 50 MB of free space.",
                file=sys.stderr,
                flush=True,
            )

    def _refuse(self, reason: str | None) -> None:
        self.reason = reason or "no reason is known"


def _open(path: Path) -> int:
    """Return a descriptor of a directory, made if it is missing, under a shared lock.

    Raises OSError.
    """
    for _ in range(ATTEMPTS):
        with suppress(FileNotFoundError):  # another process has removed it in the meantime
            if not path.is_dir():
                path.parent.mkdir(0o700, parents=True, exist_ok=True)
                path.mkdir(0o700, exist_ok=True)
            opened = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            if _hold(opened, path):
                return opened
            os.close(opened)
        time.sleep(PAUSE)
    raise OSError(errno.EBUSY, "another process is removing it")


def _hold(opened: int, path: Path) -> bool:
    """Lock a directory and mark it as used now. Return False if another process removes it."""
    try:
        fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks, from which no process removes a directory
        pass
    with suppress(OSError):  # read-only
        os.utime(opened)
    return os.path.samestat(os.fstat(opened), os.stat(path))


def _danger(status: os.stat_result) -> str | None:
    """Return why another user could have written the file or directory, or None."""
    if status.st_uid != os.geteuid():
        return f"it belongs to another user (UID {status.st_uid})"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "other users can write to it"
    return None


def prune(place: Path, kept: int = KEPT, kept_bytes: int = KEPT_BYTES) -> None:
    """Remove the least recently used directories in `place` that no process uses.

    The last `kept` directories remain, or fewer, if these have more than `kept_bytes` bytes.
    """
    with suppress(OSError), os.scandir(place) as entries:
        ours = [
            (entry.stat(follow_symlinks=False).st_mtime, entry.path)
            for entry in entries
            if NAME.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False)
        ]
        size = 0
        for number, (_, path) in enumerate(sorted(ours, reverse=True)):
            size += _size(path)
            if number >= kept or size > kept_bytes:
                _remove_unused(path)


def _size(path: str) -> int:
    with suppress(OSError), os.scandir(path) as entries:
        return sum(entry.stat(follow_symlinks=False).st_size for entry in entries)
    return 0


def _remove_unused(path: str) -> None:
    with suppress(OSError):
        opened = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # another process may have removed it, and a third one made it again
            if os.path.samestat(os.fstat(opened), os.stat(path)):
                shutil.rmtree(path)
        finally:
            os.close(opened)
