"""What is left out of Numba's compiler, and what still works; arrays made in compiled code."""

import json
import subprocess
import sys

import numpy as np
import pytest
from numba import njit
from numba.core.compiler import DefaultPassBuilder

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.lean_compiler import UNUSED, Lean, Library

CALLED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": Lean}


def test_unused_passes_have_numbas_names(monkeypatch):
    """A pass that Numba renames would be run again without notice."""
    seen = set()
    ordinary = DefaultPassBuilder.define_nopython_pipeline

    def noted(state):
        passes = ordinary(state)
        seen.update(one.__name__ for one, _ in passes.passes)
        return passes

    monkeypatch.setattr(DefaultPassBuilder, "define_nopython_pipeline", noted)
    assert njit(pipeline_class=Lean)(lambda x: x + 1.0)(1.0) == 2.0
    assert seen >= UNUSED


def test_function_with_another_inside_gets_all_passes():
    @njit(pipeline_class=Lean)
    def total(n):
        return sum([k * k for k in range(n)])

    assert total(4) == 14


def _libraries(function):
    return [one.library for one in function.overloads.values()]


def test_only_functions_that_python_calls_become_machine_code():
    @njit(**CALLED)
    def helper(x):
        return 2.0 * x

    @njit(**COMPILED | {"cache": False})
    def caller(x):
        return helper(x) + 1.0

    assert caller(3.0) == 7.0
    for function, is_translated in ((helper, False), (caller, True)):
        (library,) = _libraries(function)
        assert isinstance(library, Library)
        assert library._is_translated == is_translated


def test_helper_becomes_machine_code_when_its_address_is_taken():
    @njit(**CALLED)
    def helper(x):
        return 2.0 * x

    helper.compile("float64(float64)")
    (found,) = helper.overloads.values()
    assert found.library.get_pointer_to_function(found.fndesc.llvm_func_name) != 0
    assert found.library._is_translated


RAISES = """
import json
from numba import njit
from sph.compiled import COMPILED, INLINED

@njit(**INLINED)
def checked(x):
    if x < 0.0:
        raise ValueError("below zero", x)
    return x

@njit(**COMPILED)
def root(x):
    return checked(x) ** 0.5

if __name__ == "__main__":
    from raises import root
    try:
        root(-1.0)
    except ValueError as error:
        print(json.dumps([root(4.0), list(error.args), root.stats.cache_hits.total()]))
"""


def test_constants_of_inlined_function_reach_its_caller(tmp_path):
    """An exception with a value takes constants from the environment of the inlined function."""
    (tmp_path / "raises.py").write_text(RAISES)
    for hits in (0, 1):  # compiled, then loaded
        done = subprocess.run(
            [sys.executable, str(tmp_path / "raises.py")], capture_output=True, text=True
        )
        assert json.loads(done.stdout) == [2.0, ["below zero", -1.0], hits], done.stderr


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64, np.int32])
def test_empty_is_like_numpys(kind):
    @njit(**COMPILED | {"cache": False})
    def made(n, m):
        a, b = empty(n, kind), empty((n, m), kind)
        for i in range(n):
            a[i] = i
            for j in range(m):
                b[i, j] = 10 * i + j
        return a, b, empty(0, kind)

    row, field, none = made(5, 3)
    np.testing.assert_array_equal(row, np.arange(5, dtype=kind))
    np.testing.assert_array_equal(field, np.add.outer(10 * np.arange(5), np.arange(3)))
    for array in (row, field):
        assert array.dtype == kind
        assert array.flags.c_contiguous
        assert array.ctypes.data % 64 == 0
    assert none.size == 0


def test_empty_without_memory_raises():
    @njit(**COMPILED | {"cache": False})
    def made(n):
        return empty(n, np.float64).size

    with pytest.raises(MemoryError):
        made(1 << 58)


def test_minimum_and_maximum_of_numbers():
    @njit(**INLINED | {"no_cpython_wrapper": False})
    def bounds(a, b):
        return smaller(a, b), larger(a, b)

    assert bounds(2.0, -3.0) == (-3.0, 2.0)
    assert bounds(1, 2.5) == (1.0, 2.5)
    np.testing.assert_array_equal(larger(np.array([1.0, 4.0]), 2.0), [2.0, 4.0])
