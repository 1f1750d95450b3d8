"""Cache of compiled code on disk: one file with a checksum for each function and signature.

This replaces Numba's cache. Numba's does not notice an edit to a called function, a changed setting
of Numba or another source directory, and it fails in all later processes once a file is damaged or
its directory is not writable. Here the directory is named by everything that affects the code
(`sph.fingerprint`), a damaged entry is compiled again, and if no directory is safe to use, code is
compiled in every process.
"""

import fcntl
import functools
import hashlib
import inspect
import os
import pickle
import re
import shutil
import stat
import sys
import uuid
from contextlib import suppress
from pathlib import Path

import platformdirs
from numba.core import caching, compiler, dispatcher
from numba.core.serialize import dumps

from sph import fingerprint
from sph.version import __version__

# Number of directories (of other sources, versions, processors or settings) that are kept.
KEPT = 16
NAME = re.compile(r"sph-\d[\w.+]*-[0-9a-f]{16}")
DIGEST = hashlib.sha256().digest_size


def install() -> None:
    """Make Numba use this cache for functions that are compiled with cache=True from now on."""
    directory()  # before the modules are imported whose sources it is named by
    dispatcher.FunctionCache = _of_function  # type: ignore[attr-defined]


def place() -> Path | None:
    """Return the parent of all cache directories, or None if the user has no cache directory.

    This is NUMBA_CACHE_DIR if that is set, otherwise a subdirectory of the user's cache directory:
    $XDG_CACHE_HOME/sph or ~/.cache/sph, on macOS ~/Library/Caches/sph.
    """
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen).absolute()
    base = Path(platformdirs.user_cache_dir("sph"))
    return base / "compiled" if base.is_absolute() else None  # "~" stays for a user without a home


@functools.cache
def directory() -> "Directory":
    """Return the cache directory of this process."""
    where = place()
    return Directory(where and where / f"sph-{__version__}-{fingerprint.key()}")


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
        try:
            is_new = not self.path.is_dir()
            if is_new:
                self.path.parent.mkdir(0o700, parents=True, exist_ok=True)
                self.path.mkdir(0o700, exist_ok=True)
            opened = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        except OSError as error:
            self._refuse(error.strerror)
            return None
        if danger := _danger(os.fstat(opened)):
            os.close(opened)
            self._refuse(danger)
            return None
        with suppress(OSError):  # a file system without locks, or read-only
            fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
            os.utime(opened)
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


def _danger(status: os.stat_result) -> str | None:
    """Return why another user could have written the file or directory, or None."""
    if status.st_uid != os.geteuid():
        return f"it belongs to another user (UID {status.st_uid})"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "other users can write to it"
    return None


def prune(place: Path, kept: int = KEPT) -> None:
    """Remove the least recently used directories in `place` that no process uses; keep `kept`."""
    with suppress(OSError), os.scandir(place) as entries:
        ours = [
            (entry.stat(follow_symlinks=False).st_mtime, entry.path)
            for entry in entries
            if NAME.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False)
        ]
        for _, path in sorted(ours, reverse=True)[kept:]:
            _remove_unused(path)


def _remove_unused(path: str) -> None:
    with suppress(OSError):
        opened = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path)
        finally:
            os.close(opened)


def _of_function(function):
    """Return the cache of a function: this one, or Numba's if its source is not in a file."""
    if os.path.isfile(inspect.getfile(function)):
        return Entries(function)
    return caching.FunctionCache(function)


class Entries(caching._Cache):
    """The cache entries of one function, with the interface that Numba's dispatcher uses."""

    def __init__(self, function):
        self._function = function
        code = function.__code__
        cells = tuple(cell.cell_contents for cell in function.__closure__ or ())
        self._key = (
            _file_hash(code.co_filename), function.__qualname__, code.co_firstlineno,
            hashlib.sha256(code.co_code).hexdigest(),
            hashlib.sha256(dumps(cells)).hexdigest() if cells else "",
        )  # fmt: skip

    @property
    def cache_path(self):
        return str(directory().path)

    def load_overload(self, sig, target_context):
        """Return the compiled function, or None if it must be compiled."""
        target_context.refresh()
        if directory().descriptor is None:
            return None
        key = self._whole_key(sig, target_context.codegen())
        content = directory().read(self._name(key))
        if content is None:
            return None
        try:
            stored, payload = pickle.loads(content)
            if stored != key:
                return None
            return compiler.CompileResult._rebuild(target_context, *payload)
        except Exception:  # a damaged entry is compiled again
            return None

    def save_overload(self, sig, data):
        if directory().descriptor is None:
            directory().warn()
        # if sources were edited after the start, this code does not belong in the directory
        elif fingerprint.are_sources_unchanged():
            key = self._whole_key(sig, data.codegen)
            directory().write(self._name(key), dumps((key, data._reduce())))

    def enable(self): ...

    def disable(self): ...

    def flush(self): ...

    def _whole_key(self, sig, codegen):
        return directory().name, self._key, repr(sig), codegen.magic_tuple()

    def _name(self, key) -> str:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()
        return f"{self._function.__module__}.{self._function.__name__}-{digest[:20]}.code"


@functools.cache
def _file_hash(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
