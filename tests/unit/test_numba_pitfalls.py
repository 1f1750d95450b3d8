"""What the compiled code relies on of Numba: such faults are silent, in numbers or in speed."""

import importlib
import json
import os
import pkgutil
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from llvmlite import binding
from numba import njit
from numba.core.dispatcher import Dispatcher

import sph
from sph import fingerprint
from sph.compiled import COMPILED, FASTMATH, FLAGS, INLINED, larger, smaller, verb
from sph.integrators.leapfrog import ROUNDED
from sph.simd.compaction import AVX512
from sph.steps import driver

PACKAGE = Path(sph.__file__).parent

FIRST_STEP = """
import json, re
from sph import config
from sph.clock import Clock
from sph.formulations.gas.density import density
from sph.formulations.gas.rates import rates
from sph.scene import Scene
from sph.simulation import Simulation

text = '''
[problem]
name = "uniform"
dimension = 2
n = 64
noise = 0.3
[physics]
alpha = {min = 0.1, max = 1.0}
density_passes = "converged"
'''
clock = Clock()
run = Simulation.start(Scene(config.from_text(text, "a test")), 1, clock)
run.advance(1.0)
passes = {"density": density, "rates": rates}
packed = {
    name: {
        operation: len(re.findall(rf"\\b{operation}\\s[^\\n]*%[yz]mm", text))
        for operation in (r"vfn?m\\w+pd", "vrsqrt14pd", "vmaxpd", "vminpd", "vsqrtpd", "vdivpd")
    }
    for name, function in passes.items()
    for text in function.inspect_asm().values()
}
print(json.dumps({
    "packed": packed,
    "hits": [f.stats.cache_hits.total() for f in passes.values()],
    "misses": [f.stats.cache_misses.total() for f in passes.values()],
    "compiling": clock.compiling,
    "arrays": {name: array.tobytes().hex() for name, array in run.particles.arrays().items()},
}))
"""

CALLER = """
from numba import njit
from sph.compiled import COMPILED
from sph.kernels import make, w

@njit(**COMPILED)
def value(kernel, dim, q):
    return w(kernel, dim, q)
"""
CALL = """
import json, caller
from sph.compile_cache import directory
found = caller.value(caller.make("wendland_c2"), (0, 0), 0.0)
stats = caller.value.stats
print(json.dumps({
    "value": found, "hits": stats.cache_hits.total(), "misses": stats.cache_misses.total(),
    "directory": str(directory().path),
}))
"""


def in_new_process(code, directory=None, **environment):
    """What `code` prints as JSON, run in `directory` with these variables in its environment."""
    inherited = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=directory or PACKAGE.parent,
        env=inherited | {k: str(v) for k, v in environment.items()},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def first_steps(tmp_path_factory):
    """A first step in 2-D in two processes, one after the other, that share an empty cache."""
    cache = tmp_path_factory.mktemp("cache")
    return [in_new_process(FIRST_STEP, NUMBA_CACHE_DIR=cache) for _ in range(2)]


def dispatchers():
    """Every compiled function of the package, by the name it is found under."""
    for module in pkgutil.walk_packages(sph.__path__, "sph."):
        if not module.name.endswith("__main__"):
            for name, value in vars(importlib.import_module(module.name)).items():
                if isinstance(value, Dispatcher):
                    yield f"{module.name}.{name}", value


def has_avx2():
    return platform.machine() in ("x86_64", "AMD64") and binding.get_host_cpu_features()["avx2"]


avx2_only = pytest.mark.skipif(not has_avx2(), reason="looks for AVX2 instructions of x86-64")


# --- the cache on disk ---


@pytest.mark.slow
def test_passes_are_cached_across_processes(first_steps):
    first, second = first_steps
    assert first["hits"] == [0, 0]
    assert first["misses"] == [1, 1]
    assert second["hits"] == [1, 1]
    assert second["misses"] == [0, 0]
    # nothing else compiles either: the first took seconds
    assert second["compiling"] < 0.05 * first["compiling"]


@pytest.mark.slow
def test_compiled_and_cached_code_give_equal_bits(first_steps):
    """A callee that is not inlined is compiled twice: on its own, and within its caller.

    The process that compiles them calls the one, a process that loads the caller from the cache
    the other, and they may round differently: a run and its restart would part.
    """
    first, second = first_steps
    for name, array in first["arrays"].items():
        assert array == second["arrays"][name], name


def test_cache_directory_follows_environment_variable(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER)
    paths = {"PYTHONPATH": PACKAGE.parent, "NUMBA_CACHE_DIR": tmp_path / "mine"}
    directory = Path(in_new_process(CALL, tmp_path, **paths)["directory"])
    assert directory.parent == tmp_path / "mine"
    assert list(directory.glob("caller.value-*.code"))
    # nothing of Numba's own cache, whose index is not safe against damage
    assert not list(tmp_path.rglob("*.nb[ci]"))


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="the user's cache directory is moved by HOME")
def test_edit_of_called_function_is_recompiled(tmp_path):
    copy = tmp_path / "sph"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "caller.py").write_text(CALLER)
    home = {"HOME": tmp_path, "XDG_CACHE_HOME": tmp_path / "cache"}
    before, again = (in_new_process(CALL, tmp_path, **home) for _ in range(2))
    assert (before["value"], before["hits"], before["misses"]) == (1.0, 0, 1)
    assert (again["value"], again["hits"], again["misses"]) == (1.0, 1, 0)
    assert Path(before["directory"]).is_relative_to(tmp_path)

    kernel = copy / "kernels" / "wendland_c2.py"
    source = kernel.read_text()
    kernel.write_text(source.replace("return (u * u)", "return 3.0 * (u * u)"))
    after = in_new_process(CALL, tmp_path, **home)
    assert (after["value"], after["hits"], after["misses"]) == (3.0, 0, 1)
    assert after["directory"] != before["directory"]


def test_source_hash_depends_on_contents_and_names(tmp_path, monkeypatch):
    monkeypatch.setattr(sph, "__file__", str(tmp_path / "__init__.py"))
    (tmp_path / "part").mkdir()
    one, other = tmp_path / "part" / "one.py", tmp_path / "part" / "other.py"
    hashes = []
    for contents in ("x = 1", "x = 2", "x = 1"):
        one.write_text(contents)
        hashes.append(fingerprint.sources())
    assert hashes[0] == hashes[2] != hashes[1]
    one.rename(other)
    assert fingerprint.sources() not in hashes
    other.unlink()
    assert fingerprint.sources() == ""


def test_compiled_functions_share_their_flags_and_are_all_cached():
    found = dict(dispatchers())
    assert "sph.formulations.gas.rates.rates" in found
    plain = {"nopython": True, "boundscheck": None}
    for name, function in found.items():
        # those of compiled steps do no arithmetic of floating point that could be rearranged
        allowed = [COMPILED, INLINED]
        allowed += [ROUNDED] * name.startswith("sph.integrators.leapfrog.")
        allowed += [driver.OPTIONS, driver.HELPER] * name.startswith("sph.steps.driver.")
        given = {k: v for k, v in function.targetoptions.items() if k not in plain}
        given["pipeline_class"] = function._compiler.pipeline_class
        if function.stats.cache_path is not None:  # the others are cached with their callers
            given["cache"] = True
        given["pipeline_class"] = function._compiler.pipeline_class
        assert given in allowed, name
        # neither the cache nor its key sees through a function that is closed over
        assert function.py_func.__closure__ is None, name
    by_function = {}
    for function in found.values():
        by_function.setdefault(function.py_func, set()).add(id(function))
    # of two sets of flags on one function, the second would load the code of the first
    assert all(len(compiled) == 1 for compiled in by_function.values())


# --- dispatch ---


@verb
def twice_or_half(self, x):
    return self.twice_or_half(x)


class Twice(NamedTuple):
    factor: float

    def twice_or_half(self, x):
        return self.factor * x


class Half(NamedTuple):
    factor: float

    def twice_or_half(self, x):
        return x / self.factor


@njit(**COMPILED)
def _call(model, x):
    return twice_or_half(model, x)


def test_verb_resolves_to_method_of_model():
    assert _call(Twice(2.0), 3.0) == Twice(2.0).twice_or_half(3.0) == 6.0
    assert _call(Half(2.0), 3.0) == 1.5
    assert len(_call.signatures) == 2
    assert _call(Twice(5.0), 3.0) == 15.0  # another value is no other type
    assert len(_call.signatures) == 2


def test_models_are_distinct_to_dispatcher():
    """From Python, Numba tells named tuples apart by class name and fields' types, not by class.

    A second class of that name with the fields of the first would silently run with its formulas,
    once both are used in one process. Where this fails, give the new class a name of its own.
    """
    seen = {}
    for module in pkgutil.walk_packages(sph.__path__, "sph."):
        if not module.name.startswith(("sph.kernels", "sph.eos", "sph.parts", "sph.formulations")):
            continue
        for name, kind in vars(importlib.import_module(module.name)).items():
            if hasattr(kind, "_fields") and kind.__module__ == module.name:
                assert name not in seen, f"{module.name}.{name} looks like {seen[name]}"
                seen[name] = f"{module.name}.{name}"
    models = {"CubicSpline", "IdealGas", "GradH", "CullenDehnen", "Balsara", "Approach", "ByMass"}
    assert models < seen.keys()


@njit(**COMPILED)
def _with_extra(x, extra):
    if extra is not None:
        x = x + extra.no_such_field
    return x


def test_branch_on_none_argument_is_pruned():
    # had it been compiled, the field that does not exist would be an error
    assert _with_extra(1.0, None) == 1.0


# --- floating point and vectors ---


@njit(**FLAGS)
def _seen_as_strange(x):
    return np.isnan(x), np.isinf(x), x != x, x < np.inf


def test_non_finite_numbers_detected_in_compiled_code():
    assert {"nnan", "ninf", "fast"}.isdisjoint(FASTMATH)
    assert _seen_as_strange(np.nan) == (True, False, True, False)
    assert _seen_as_strange(np.inf) == (False, True, False, False)
    assert _seen_as_strange(1.0) == (False, False, False, True)


@njit(**FLAGS)
def _extremes(x):
    highest, lowest = x[0], x[0]
    for value in x:
        highest = larger(highest, value)
        lowest = smaller(lowest, value)
    return highest, lowest


@njit(**FLAGS)
def _quotients(x, y):
    for i in range(x.size):
        x[i] = x[i] / y[i]


def packed_instructions(function, name):
    (text,) = function.inspect_asm().values()
    return sum(name in line and ("%ymm" in line or "%zmm" in line) for line in text.splitlines())


def test_larger_and_smaller_give_extremes():
    x = np.random.default_rng(1).normal(size=1003)
    assert _extremes(x) == (x.max(), x.min())
    np.testing.assert_array_equal(larger(x, 0 * x), np.maximum(x, 0))
    np.testing.assert_array_equal(smaller(x, 0 * x), np.minimum(x, 0))


@avx2_only
def test_running_extremes_and_divisions_are_vectorised():
    x = np.ones(9)
    _extremes(x)
    _quotients(x, x)
    assert packed_instructions(_extremes, "vmaxpd") > 0
    assert packed_instructions(_extremes, "vminpd") > 0
    assert packed_instructions(_quotients, "vdivpd") > 0


@pytest.mark.slow
@avx2_only
def test_pair_loops_of_the_passes_are_packed_instructions(first_steps):
    packed = first_steps[0]["packed"]
    assert packed["density"]["vmaxpd"] >= 2  # the kernel, for the support and for the divergence
    assert packed["rates"]["vminpd"] >= 1  # eq 26
    assert packed["rates"]["vmaxpd"] >= 3  # the kernel at both supports, and the signal speed
    for counts in packed.values():
        # sums of products; an estimate refined by them replaces roots and divisions
        assert counts[r"vfn?m\w+pd"] >= 20
        if AVX512:
            assert counts["vrsqrt14pd"] >= 1


def test_division_by_zero_gives_infinity_and_no_exception():
    x = np.array([1.0, -1.0])
    _quotients(x, np.zeros(2))
    np.testing.assert_array_equal(x, [np.inf, -np.inf])
