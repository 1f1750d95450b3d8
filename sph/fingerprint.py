"""What decides the bits of a result besides the configuration: sources, versions, processor,
settings of the compiler."""

import functools
import hashlib
import json
import os
import platform
import re
from pathlib import Path

import llvmlite
import numba
import numba.core.config
import numpy as np
from llvmlite import binding

import sph

# Settings of Numba that change no compiled number: output for debugging, paths, CUDA, the number of
# threads (of parallel=True, which sph does not use). All others count, also those that a later
# Numba adds: a setting that counts needlessly costs a compilation, one that is missing wrong bits.
_NOT_CODE = re.compile(
    r"DEBUG(?!INFO).*|(DUMP|CACHE|IS)_.*|.*(CUDA|TRACE|WARN|DIAGNOSTICS).*|.*NUM_THREADS|_.*"
    r"|THREADING_LAYER.*|NRT_STATS|LLVM_PASS_TIMINGS|FUNCTION_CACHE_SIZE|HIGHLIGHT_DUMPS|ANNOTATE"
    r"|HTML|DIFF_IR|GDB_BINARY|COLOR_SCHEME|SHOW_HELP|DEVELOPER_MODE|PYVERSION|MACHINE_BITS"
)
# NumPy chooses among its loops by the processor's features; these variables narrow the choice.
_NUMPY_SETTINGS = ("NPY_DISABLE_CPU_FEATURES", "NPY_ENABLE_CPU_FEATURES")


def sources() -> str:
    """Hash of every source file of the package, 16 digits; empty where there is no source file."""
    root = Path(sph.__file__).parent
    digest, files = hashlib.sha256(), sorted(root.rglob("*.py"))
    for path in files:
        digest.update(str(path.relative_to(root)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16] if files else ""


@functools.cache
def facts() -> dict[str, str]:
    """Name and value of each thing that decides bits, as it was at the first call."""
    features = binding.get_host_cpu_features()
    return {
        "sources of sph": sources(),
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "Numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
        "C library": _c_library(),
        "machine": platform.machine(),
        "processor": binding.get_host_cpu_name(),
        "features of the processor": " ".join(sorted(name for name in features if features[name])),
        **settings(),
    }


def settings() -> dict[str, str]:
    """Name and value of each setting that changes code: Numba's, and NumPy's where one is set."""
    values = sorted(vars(numba.core.config).items())
    found = {
        f"NUMBA_{name}": _plain(value)
        for name, value in values
        if name.isupper() and not _NOT_CODE.fullmatch(name)
    }
    return found | {name: os.environ[name] for name in _NUMPY_SETTINGS if name in os.environ}


def _plain(value) -> str:
    """A setting's value, the same whether it is a default or was read from a variable."""
    value = getattr(value, "_raw_value", value)  # of NUMBA_OPT, which may be "max"
    return str(int(value) if isinstance(value, bool) else value)


def key() -> str:
    """16 digits that no two sets of facts share."""
    return hashlib.sha256(as_json().encode()).hexdigest()[:16]


def as_json() -> str:
    """The facts as one line of JSON, which a checkpoint keeps."""
    return json.dumps(facts(), sort_keys=True)


def differences(then: str | None) -> str | None:
    """Why bits may differ from those of a checkpoint, whose facts are `then` as `as_json` gave it.

    None where the facts are equal, or where the checkpoint names none.
    """
    try:
        before = json.loads(then or "")
    except (ValueError, TypeError, RecursionError):
        return None
    if not isinstance(before, dict) or before == facts():
        return None
    now = facts()
    changed = [name for name in {**now, **before} if before.get(name) != now.get(name)]
    told = ", ".join(_told(name, before.get(name), now.get(name)) for name in changed)
    return (
        "the results may differ in their last digits from those of the uninterrupted run, because "
        f"the checkpoint was computed with other {told}"
    )


def _told(name: str, before, now) -> str:
    """A fact that differs, with both values where these are short."""
    shown = ["not set" if value is None else ascii(value).strip("'") for value in (before, now)]
    if name == "sources of sph" or max(map(len, shown)) > 40:
        return ascii(name).strip("'")
    return "{} ({}, here {})".format(ascii(name).strip("'"), *shown)


def _c_library() -> str:
    try:
        return os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (AttributeError, ValueError, OSError):
        return platform.platform() if platform.system() == "Darwin" else ""
