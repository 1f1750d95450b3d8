"""Compiled code on disk: one checked file for each function and signature.

In place of Numba's cache, which does not see an edit to a function that is called, nor its own
settings, nor another developer's directory, and which fails in every later process once one of its
files is damaged or its directory cannot be written. Here the directory is named by all that decides
the code (`sph.fingerprint`), an entry that is not what it should be is compiled anew, and without a
directory that is safe to use code is compiled in every process.
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

# Directories of other sources, versions, processors or settings that are kept, last used first.
KEPT = 16
NAME = re.compile(r"sph-\d[\w.+]*-[0-9a-f]{16}")
DIGEST = hashlib.sha256().digest_size


def install() -> None:
    """Make Numba keep what is compiled with cache=True from now on here."""
    directory()  # before the modules are imported that it is named by
    dispatcher.FunctionCache = _of_function  # type: ignore[attr-defined]


def place() -> Path | None:
    """The directory that holds those of all versions, or None where the user has none.

    NUMBA_CACHE_DIR if that is set, else the user's cache directory: $XDG_CACHE_HOME/sph or
    ~/.cache/sph, on macOS ~/Library/Caches/sph.
    """
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen).absolute()
    base = Path(platformdirs.user_cache_dir("sph"))
    return base / "compiled" if base.is_absolute() else None  # "~" stays for a user without a home


@functools.cache
def directory() -> "Directory":
    """The directory of this process's code."""
    where = place()
    return Directory(where and where / f"sph-{__version__}-{fingerprint.key()}")


class Directory:
    """A directory of entries, opened when one is first asked for.

    It is used only if nobody else can write to it: an entry is code. What it is, is asked of the
    open directory, through which all files are then reached.
    """

    def __init__(self, path: Path | None):
        self.path = path
        self.reason = ""  # why it cannot be used, or not be written to
        self._told = False

    @functools.cached_property
    def descriptor(self) -> int | None:
        """The open directory, held by a shared lock for as long as the process lives, or None."""
        if self.path is None or not fingerprint.facts()["sources of sph"]:
            self._refuse("there is none: no home directory, or no source files")
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
        with suppress(OSError):  # a file system without locks, or without leave to write
            fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
            os.utime(opened)
        if is_new:
            prune(self.path.parent)
        return opened

    @property
    def name(self) -> str:
        return self.path.name if self.path else ""

    def read(self, name: str) -> bytes | None:
        """The content of an entry, or None where there is none that is whole and ours."""
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
        """Write an entry, all or nothing; where that fails the reason is told."""
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
            self.tell()

    def tell(self) -> None:
        """Say once why code that has been compiled cannot be kept."""
        if not self._told:
            self._told = True
            print(
                f"sph: compiled code cannot be kept in {self.path or 'a cache directory'}: "
                f"{self.reason}. Every process compiles anew.\nTry: the variable NUMBA_CACHE_DIR, "
                "naming a directory of your own that has 50 MB of space left.",
                file=sys.stderr,
                flush=True,
            )

    def _refuse(self, reason: str | None) -> None:
        self.reason = reason or "no reason is known"


def _danger(status: os.stat_result) -> str | None:
    """Why code from there might be somebody else's, or None."""
    if status.st_uid != os.geteuid():
        return f"it belongs to another user (number {status.st_uid})"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "other users can write to it"
    return None


def prune(place: Path, kept: int = KEPT) -> None:
    """Remove the directories in `place` that were used longest ago, and that no process uses."""
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
    """What a dispatcher keeps its code in; Numba's own cache for what comes from no file."""
    if os.path.isfile(inspect.getfile(function)):
        return Entries(function)
    return caching.FunctionCache(function)


class Entries(caching._Cache):
    """The entries of one function, as Numba's dispatcher asks for them."""

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
        """The compiled function, or None where it must be compiled."""
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
        except Exception:  # whatever is wrong with it, it can be compiled
            return None

    def save_overload(self, sig, data):
        if directory().descriptor is None:
            directory().tell()
        # an edit while the program started: what was compiled is not of the directory's sources
        elif fingerprint.sources() == fingerprint.facts()["sources of sph"]:
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
