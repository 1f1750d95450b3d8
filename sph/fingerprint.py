"""Everything besides the configuration that can change the bits of a result.

These are the sources of sph, the versions of Python and libraries, the processor and the settings
of the compiler.
"""

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
from sph import registry

# Settings of Numba that do not change compiled code: debugging output, paths, CUDA, the number of
# threads (for parallel=True, which sph does not use). All others count, including those that a
# later Numba adds: a needless entry costs a compilation, a missing one gives wrong results.
_NOT_CODE = re.compile(
    r"DEBUG(?!INFO).*|(DUMP|CACHE|IS)_.*|.*(CUDA|TRACE|WARN|DIAGNOSTICS).*|.*NUM_THREADS|_.*"
    r"|THREADING_LAYER.*|NRT_STATS|LLVM_PASS_TIMINGS|FUNCTION_CACHE_SIZE|HIGHLIGHT_DUMPS|ANNOTATE"
    r"|HTML|DIFF_IR|GDB_BINARY|COLOR_SCHEME|SHOW_HELP|DEVELOPER_MODE|PYVERSION|MACHINE_BITS"
)
# NumPy chooses loops by the features of the processor; these variables restrict the choice.
_NUMPY_SETTINGS = ("NPY_DISABLE_CPU_FEATURES", "NPY_ENABLE_CPU_FEATURES")


def sources() -> str:
    """Return a hash of all source files of the package, 16 digits; "" if there are none."""
    return _hash_of_sources(Path(sph.__file__).parent)


def extensions() -> dict[str, str]:
    """Return the hash of the source files in `sph_extensions`, if there are any."""
    hashes = [_hash_of_sources(Path(folder)) for folder in registry.extension_folders()]
    return {"sources of sph_extensions": " ".join(hashes)} if any(hashes) else {}


def are_sources_unchanged() -> bool:
    """Return whether the source files are those of the first call of `facts`."""
    now = {"sources of sph": sources(), **extensions()}
    return all(facts().get(name) == value for name, value in now.items())


def _hash_of_sources(root: Path) -> str:
    digest, files = hashlib.sha256(), sorted(root.rglob("*.py"))
    for path in files:
        digest.update(str(path.relative_to(root)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16] if files else ""


@functools.cache
def facts() -> dict[str, str]:
    """Return name and value of everything that can change bits, as found at the first call."""
    features = binding.get_host_cpu_features()
    return {
        "sources of sph": sources(),
        **extensions(),
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
    """Return name and value of each setting that changes code: Numba's, and NumPy's if set."""
    values = sorted(vars(numba.core.config).items())
    found = {
        f"NUMBA_{name}": _plain(value)
        for name, value in values
        if name.isupper() and not _NOT_CODE.fullmatch(name)
    }
    return found | {name: os.environ[name] for name in _NUMPY_SETTINGS if name in os.environ}


def _plain(value) -> str:
    """Return a setting's value as text, equal for a default and for a value from a variable."""
    value = getattr(value, "_raw_value", value)  # for NUMBA_OPT, which may be "max"
    return str(int(value) if isinstance(value, bool) else value)


def key() -> str:
    """Return a hash of `facts`, 16 digits."""
    return hashlib.sha256(as_json().encode()).hexdigest()[:16]


def as_json() -> str:
    """Return `facts` as one line of JSON, which is stored in checkpoints."""
    return json.dumps(facts(), sort_keys=True)


def differences(then: str | None) -> str | None:
    """Return why results may differ in bits from those of a checkpoint, or None.

    then: the result of `as_json` stored in the checkpoint. None is returned if the facts are equal
    or the checkpoint has none.
    """
    try:
        before = json.loads(then or "")
    except (ValueError, TypeError, RecursionError):
        return None
    if not isinstance(before, dict) or before == facts():
        return None
    now = facts()
    changed = [name for name in {**now, **before} if before.get(name) != now.get(name)]
    listed = ", ".join(_change(name, before.get(name), now.get(name)) for name in changed)
    return (
        "the results may differ in their last digits from those of the uninterrupted run, because "
        f"the checkpoint was computed with other {listed}"
    )


def _change(name: str, before, now) -> str:
    """Return a fact that differs, with both values if they are short."""
    shown = ["not set" if value is None else ascii(value).strip("'") for value in (before, now)]
    if name.startswith("sources of") or max(map(len, shown)) > 40:
        return ascii(name).strip("'")
    return "{} ({}, here {})".format(ascii(name).strip("'"), *shown)


def _c_library() -> str:
    try:
        return os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (AttributeError, ValueError, OSError):
        return platform.platform() if platform.system() == "Darwin" else ""
