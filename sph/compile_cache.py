"""Cache of compiled code on disk: one file with a checksum for each function and signature.

This replaces Numba's cache. Numba's does not notice an edit to a called function, a changed setting
of Numba or another source directory, and it fails in all later processes once a file is damaged or
its directory is not writable. Here the directory is named by everything that affects the code
(`sph.fingerprint`), a damaged entry is compiled again, and if no directory is safe to use, code is
compiled in every process.
"""

import functools
import hashlib
import inspect
import io
import os
import pickle
import sys
from pathlib import Path

from llvmlite import binding
from numba.core import caching, compiler, dispatcher, environment
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from sph import fingerprint
from sph.cache_directory import Directory, place
from sph.version import __version__


def install() -> None:
    """Make Numba use this cache for functions that are compiled with cache=True from now on."""
    directory()  # before the modules are imported whose sources it is named by
    dispatcher.FunctionCache = _of_function  # type: ignore[attr-defined]


@functools.cache
def directory() -> Directory:
    """Return the cache directory of this process."""
    where = place()
    return Directory(where and where / f"sph-{__version__}-{fingerprint.key()}")


def start_numba() -> None:
    """Start what loaded code needs of Numba: its memory manager.

    Numba's own cache imports all modules of Numba with functions that compiled code may call, and
    SciPy's linear algebra with them, which takes 0.3 CPU seconds. Only compilation needs these.
    """
    rtsys.initialize(cpu_target.target_context)


class _Unpickler(pickle.Unpickler):
    """Loads compiled code without an import of the modules of Numba whose functions it includes."""

    def find_class(self, module, name):
        if (module, name) == (environment.__name__, "_rebuild_env"):
            return _environment
        return super().find_class(module, name)


def _environment(module, constants, name):
    """Return the environment of a compiled function, as numba.core.environment._rebuild_env does.

    Only object mode uses the globals in it, thus of no function whose module is not imported.
    """
    if module in sys.modules:
        return environment._rebuild_env(module, constants, name)
    found = environment.lookup_environment(name)
    if found is None:
        found = environment.Environment({"__name__": module})  # from which it is stored again
        found.consts[:] = constants
        found.env_name = name
        environment.Environment._memo[name] = found
    return found


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
        if directory().descriptor is None:
            return None
        key = self._whole_key(sig, target_context.codegen())
        content = directory().read(self._name(key))
        if content is None:
            return None
        start_numba()
        try:
            stored, external, payload = _Unpickler(io.BytesIO(content)).load()
            if stored != key:
                return None
            if not all(map(binding.address_of_symbol, external)):
                target_context.refresh()  # imports all modules of Numba, some of which define some
            return compiler.CompileResult._rebuild(target_context, *payload)
        except Exception:  # a damaged entry is compiled again
            return None

    def save_overload(self, sig, data):
        if directory().descriptor is None:
            directory().warn()
        # if sources were edited after the start, this code does not belong in the directory
        elif fingerprint.are_sources_unchanged():
            key = self._whole_key(sig, data.codegen)
            content = dumps((key, _external(data.library), data._reduce()))
            directory().write(self._name(key), content)

    def enable(self): ...

    def disable(self): ...

    def flush(self): ...

    def _whole_key(self, sig, codegen):
        return directory().name, self._key, repr(sig), codegen.magic_tuple()

    def _name(self, key) -> str:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()
        return f"{self._function.__module__}.{self._function.__name__}-{digest[:20]}.code"


def _external(library) -> list[str]:
    """Return the symbols that compiled code takes from elsewhere."""
    module = library._final_module
    return [
        symbol.name for symbol in (*module.functions, *module.global_variables)
        if symbol.is_declaration and not symbol.name.startswith("llvm.")
    ]  # fmt: skip


@functools.cache
def _file_hash(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
