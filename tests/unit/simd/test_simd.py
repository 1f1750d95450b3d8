"""Every operation on vectors against NumPy: 8 lanes in double precision, 16 in single, and one."""

import functools
import os
import subprocess
import sys

import numpy as np
import pytest
from lanes import LANES, compiled, every_lanes, precision

from sph import compiled as of_sph
from sph import simd
from sph.arrays import CACHE_LINE

N = 32  # a multiple of all widths
EXPRESSIONS = [
    *(f"x {sign} y" for sign in ["+", "-", "*", "/"]),
    *(f"x {sign} 3.0" for sign in ["+", "-", "*", "/"]),
    *(f"2 {sign} x" for sign in ["+", "-", "*", "/"]),
    "-x", "+x", "abs(x)", "np.abs(x)", "x - 0.1", "0.1 * x",
    "y**2", "y**3", "y**-2", "y**0.5", "y**2.5", "y**x", "2.0**x", "np.power(y, 1.5)",
    "larger(x, y)", "larger(x, 1)", "larger(0.5, x)", "smaller(x, y)", "smaller(x, 1)",
    "np.maximum(x, y)", "np.minimum(x, 0.5)",
    "np.sqrt(y)", "np.exp(x)", "np.exp2(x)", "np.log(y)", "np.log2(y)", "np.log10(y)",
    "np.sin(x)", "np.cos(x)", "np.tan(x)", "np.tanh(x)", "np.floor(x)", "np.ceil(x)",
    *(f"select(x {sign} y, 1.0, 0.0)" for sign in ["<", "<=", ">", ">=", "==", "!="]),
    *(f"select(x {sign} 1, x, y)" for sign in ["<", "<=", ">", ">=", "==", "!="]),
    *(f"select(0.5 {sign} x, x, 2)" for sign in ["<", "<=", ">", ">=", "==", "!="]),
    *(f"select((x < 1.0) {sign} (y > x), x, y)" for sign in ["&", "|", "^"]),
    "select(~(x < 1.0), x, y)", "np.where(x < 1.0, x, y)", "np.where(x < 1.0, 1, 0.0) * x",
    "np.where((x < 1.0) & (y > 1.0), 1, y)", "np.where(flag, x, 1)", "select(flag, x, y)",
    "(x < 1.0) * y", "y * (x < 1.0)", "y + (x < 1.0)",
    "select(x == x, x, 7.0)", "select(x != x, 7.0, x)", "select(nan < x, 7.0, x)",
    "select(nan != x, 7.0, x)", "select(x < nan, 7.0, x)", "select(nan == nan, 7.0, x)",
]  # fmt: skip


def operands(lanes):
    """x, y > 0, and NaN; pairs with x = y and x = 1 among them."""
    random = np.random.default_rng(1)
    x, y = random.uniform(-3.0, 3.0, N), random.uniform(0.1, 3.0, N)
    x[::5], x[1::7] = y[::5], 1.0
    return [one.astype(precision(lanes)) for one in (x, y, np.full(N, np.nan))]


@functools.cache
def results(name):
    """The values (N,) of each expression, by expression. By name: all lanes are equal tuples."""
    lanes = LANES[name]
    lines = "".join(f"        store(out, ({k}, i), {one})\n" for k, one in enumerate(EXPRESSIONS))
    if name == "scalar":  # Numba's own np.where makes arrays of numbers
        lines = lines.replace("np.where", "select")
    run = compiled(
        "def run(lanes, flag, a, b, c, out):\n    for i in range(0, a.size, width(lanes)):\n"
        f"        x, y, nan = load(lanes, a, i), load(lanes, b, i), load(lanes, c, i)\n{lines}"
    )
    out = np.full((len(EXPRESSIONS), N), np.nan, precision(lanes))
    run(lanes, True, *operands(lanes), out)
    return dict(zip(EXPRESSIONS, out, strict=True))


@pytest.mark.parametrize("name", LANES)
@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_operations_equal_numpy(expression, name):
    found, kind = results(name)[expression], precision(LANES[name])
    # in double precision: NumPy's own functions in single precision err by more than one ulp
    values = [one.astype(float) for one in operands(LANES[name])]
    space = {**vars(of_sph), "np": np, "select": np.where, "flag": True}
    space.update(zip(("x", "y", "nan"), values, strict=True))
    exact = eval(expression, space)
    # rounding of constants, of sums that a function amplifies (tan x by 1 + tan^2 x), of the result
    steep = 1.0 + exact**2 if "tan(" in expression else 1.0
    bound = 4 * np.finfo(kind).eps * np.maximum(abs(exact), steep)
    assert np.all(abs(found - exact) <= bound)


@every_lanes
def test_numbers_apply_in_precision_of_vector(lanes):
    """Otherwise a constant in a kernel would turn a sum in single precision into double."""
    run = compiled(
        "def run(lanes, a):\n    x = load(lanes, a, 0)\n"
        "    return lane_max(x * 0.1 + 1e-9), lane_max(x + 2 - x), lane_max(x / 3)"
    )
    one = precision(lanes)(1)
    found = run(lanes, np.full(16, one))
    assert found == (one * one.dtype.type(0.1) + one.dtype.type(1e-9), 2, one / 3)


def test_operations_of_different_widths_are_refused():
    run = compiled("def run(a, b):\n    return lane_sum(load(DOUBLE, a, 0) + load(SINGLE, b, 0))")
    with pytest.raises(Exception, match=r"Vec\(float64, 8\), Vec\(float32, 16\)"):
        run(np.zeros(8), np.zeros(16, np.float32))


# --- memory ---


@pytest.mark.parametrize("call", ["load(DOUBLE, a, (0, 0))", "at((0, 0), a, 0)"])
def test_arrays_in_another_order_are_refused(call):
    run = compiled(f"def run(a):\n    {call}")
    run(np.zeros((2, 8)))
    for a in (np.zeros((2, 8), order="F"), np.zeros((2, 16))[:, ::2]):
        with pytest.raises(Exception, match="expected an array in C order"):
            run(a)


@every_lanes
def test_loads_and_stores_at_any_place(lanes):
    run = compiled(
        "def run(lanes, a, b, out, i):\n    store(out, i, load(lanes, a, i + 1))\n"
        "    store(b, (1, i), load(lanes, b, (0, i)))\n"
        "    store(b, (2, i), load_block(lanes, b, (0, i)))"
    )
    a = np.arange(40.0).astype(precision(lanes))
    for i in (0, 1, 3, 15):
        b, out = np.vstack([a, 0 * a, 0 * a]), -np.ones(40)[: a.size].astype(a.dtype)
        run(lanes, a, b, out, i)
        inside = slice(i, i + lanes.width)
        np.testing.assert_array_equal(out[inside], a[1:][inside])
        assert np.all(np.delete(out, inside) == -1)
        np.testing.assert_array_equal(b[1, inside], a[inside])
        block = slice(i, i + lanes.block_width)
        np.testing.assert_array_equal(b[2, block], a[block])
        assert not np.delete(b[1], inside).any()
        assert not np.delete(b[2], block).any()


@every_lanes
def test_partial_loads_and_stores(lanes):
    """Lanes outside the array are neither read nor written."""
    run = compiled(
        "def run(lanes, a, i, inside, fill, out, into):\n"
        "    x = load_inside(lanes, a, i, inside, fill)\n    store(out, 0, x)\n"
        "    store_inside(into, i, inside, 2 * x)"
    )
    a, block = np.arange(20.0), lanes.block_width
    for inside in range(-2, block + 3):
        for i in (0, 1, 5):
            out, into = np.zeros(block), np.full(20, -1.0)
            run(lanes, a, i, inside, 7, out, into)
            n = min(max(inside, 0), block)
            expected = np.full(block, 7.0)
            expected[:n] = a[i : i + n]
            np.testing.assert_array_equal(out, expected)
            np.testing.assert_array_equal(into[i : i + n], 2 * a[i : i + n])
            assert np.all(np.delete(into, slice(i, i + n)) == -1)


def test_partial_load_stops_at_end_of_memory():
    """A field may end where a page ends: lanes beyond would crash the process."""
    import ctypes
    import mmap

    page = mmap.PAGESIZE
    memory = mmap.mmap(-1, 2 * page)
    try:
        start = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    except BufferError:
        pytest.skip("no address of the pages")
    guard = getattr(ctypes.CDLL(None), "mprotect", None)
    if guard is None or guard(ctypes.c_void_p(start + page), page, 0) != 0:
        pytest.skip("no way to protect a page")
    a = np.frombuffer(memory, np.float64, page // 8)
    a[-3:] = 1, 2, 3
    run = compiled(
        "def run(a, i, inside, out):\n    x = load_inside(DOUBLE, a, i, inside, 0.0)\n"
        "    store(out, 0, x)\n    store_inside(a, i, inside, x + 1.0)"
    )
    out = np.zeros(8)
    run(a, a.size - 3, 3, out)
    np.testing.assert_array_equal(out, [1, 2, 3, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(a[-3:], [2, 3, 4])


@every_lanes
def test_rows_are_aligned_in_precision_of_lanes(lanes):
    run = compiled("def run(lanes, number, length):\n    return rows(lanes, number, length)")
    for length in (1, 16, 33):
        made = run(lanes, 3, length)
        assert made.shape == (3, length)
        assert made.dtype == precision(lanes)
        assert made.ctypes.data % CACHE_LINE == 0


@every_lanes
def test_constant_vectors(lanes):
    run = compiled(
        "def run(lanes, out, numbers):\n    store(out, (0, 0), filled(lanes, 3))\n"
        "    store(out, (1, 0), filled_block(lanes, 2.5))\n"
        "    store(out, (2, 0), filled(lanes, filled(lanes, 4.0)))\n"
        "    store(numbers, 0, numbers_from(lanes, 40))\n"
        "    return width(lanes), block_width(lanes)"
    )
    out, numbers = np.zeros((3, 16), precision(lanes)), np.zeros(8, np.int32)
    width, block = lanes.width, lanes.block_width
    assert run(lanes, out, numbers) == (width, block)
    for row, value, number in ((0, 3, width), (1, 2.5, block), (2, 4, width)):
        assert np.all(out[row, :number] == value)
        assert not out[row, number:].any()
    np.testing.assert_array_equal(numbers, np.where(np.arange(8) < block, 40 + np.arange(8), 0))


# --- lanes ---


@every_lanes
def test_sums_and_extremes_of_lanes(lanes):
    run = compiled(
        "def run(lanes, a):\n    x = load(lanes, a, 0)\n    return lane_sum(x), lane_max(x)"
    )
    random = np.random.default_rng(2)
    for _ in range(20):
        a = (random.normal(size=16) * 10.0 ** random.integers(-3, 4, 16)).astype(precision(lanes))
        lane = a[: lanes.width].astype(float)
        total, largest = run(lanes, a)
        # a sum in double precision, in any order, also of lanes in single precision
        assert abs(total - lane.sum()) <= 16 * 2**-53 * abs(lane).sum()
        assert largest == lane.max()


def masks(width):
    """Every mask of 8 lanes, many of 16."""
    bits = np.arange(2**width) if width <= 8 else np.random.default_rng(4).integers(0, 2**16, 500)
    bits = np.append(bits, [0, 1, 2 ** (width - 1), 2**width - 1, 2**width - 2])
    bits = np.append(bits, [0xFF, 0xFF00 % 2**width, 0x0180 % 2**width])
    return (bits[:, None] >> np.arange(width) & 1).astype(bool)


def compaction(loader):
    return compiled(
        f"def run(lanes, a, flags, out, numbers, into):\n"
        f"    mask = {loader}(lanes, flags, 0) > 0.5\n    chosen = front(lanes, mask)\n"
        f"    store(out, 0, pick({loader}(lanes, a, 0), chosen))\n"
        + "    store(numbers, 0, pick(numbers_from(lanes, 5), chosen))\n" * (loader != "load")
        + "    return count(mask), any_lane(mask)"
    )


@every_lanes
@pytest.mark.parametrize("loader", ["load", "load_block"])
def test_selected_lanes_come_to_the_front_in_order(loader, lanes):
    width = lanes.width if loader == "load" else lanes.block_width
    run = compaction(loader)
    a = np.random.default_rng(3).normal(size=16).astype(precision(lanes))
    for mask in masks(width):
        out, numbers, flags = np.zeros_like(a), np.zeros(16, np.int32), np.zeros_like(a)
        flags[:width] = mask
        number, some = run(lanes, a, flags, out, numbers, a)
        assert (number, some) == (mask.sum(), mask.any())
        np.testing.assert_array_equal(out[:number], a[:width][mask])
        if loader == "load_block":
            np.testing.assert_array_equal(numbers[:number], 5 + np.flatnonzero(mask))


# --- inverse roots ---


@every_lanes
def test_inverse_square_root_in_whole_range(lanes):
    run = compiled(
        "def run(lanes, a, out):\n    for i in range(0, a.size, width(lanes)):\n"
        "        store(out, i, inverse_sqrt(load(lanes, a, i)))"
    )
    kind = np.finfo(precision(lanes))
    check_root(lanes, run, 2, kind)


@pytest.mark.parametrize("lanes", [simd.DOUBLE, simd.SCALAR], ids=["double", "scalar"])
def test_inverse_cube_root_in_whole_range(lanes):
    run = compiled(
        "def run(lanes, a, out):\n    for i in range(0, a.size, width(lanes)):\n"
        "        store(out, i, inverse_cbrt(load(lanes, a, i)))"
    )
    check_root(lanes, run, 3, np.finfo(np.float64))


def check_root(lanes, run, n, kind):
    """Every exponent of normal numbers, with mantissas over the whole range and at both ends."""
    exponent = np.arange(kind.minexp, kind.maxexp)[:, None]
    mantissa = np.concatenate([1.0 + np.random.default_rng(6).random(14), [1.0, 2.0 - kind.eps]])
    x = np.ldexp(mantissa, exponent).ravel().astype(kind.dtype)
    out = np.zeros_like(x)
    run(lanes, x, out)
    root = np.longdouble(x) ** (-np.longdouble(1) / n)
    # the last step rounds some products; 1.7 (square root) and 2.4 units (cube root) are seen
    assert np.max(abs(out - root) / np.spacing(root.astype(kind.dtype))) < 4


# --- processors ---

AVX2 = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx2,+fma,+bmi,+bmi2"}
PROCESSORS = {"avx2": AVX2, "generic": {"NUMBA_CPU_NAME": "generic"}}


# what the instructions of a processor decide; of the engine one case, since each is compiled anew
CHOSEN = "partial or come_to_the_front or inverse or columns or (2d-mirror-mirror and fresh)"


@pytest.mark.slow
@pytest.mark.parametrize("name", PROCESSORS)
def test_other_instructions_pass_the_same_tests(name):
    """The vectors and the engine, on this processor, without the newest of its instructions."""
    if simd.INSTRUCTIONS == "" and name == "avx2":
        pytest.skip("this processor has no AVX2")
    here = os.path.dirname(__file__)
    found = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n0", "-m", "not slow", "-k", CHOSEN,
         f"{here}/test_simd.py", f"{here}/test_spatial.py", f"{here}/../test_engine.py"],
        env=os.environ | PROCESSORS[name], capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert found.returncode == 0, found.stdout[-3000:]
    chosen = subprocess.run(
        [sys.executable, "-c", "from sph import simd; print(simd.INSTRUCTIONS)"],
        env=os.environ | PROCESSORS[name], capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert chosen.stdout.strip() == ("avx2" if name == "avx2" else "")


TUBE = '[problem]\nname = "shock_tube"\nn = 60\n[time]\nend = 0.02\n[output]\ninterval = 0.01\n'


@pytest.mark.slow
def test_restart_with_other_instructions_names_them(tmp_path):
    """Bits differ between processors; a restart says so."""
    (tmp_path / "tube.toml").write_text(TUBE)
    run, other = tmp_path / "run", tmp_path / "other"

    def sph_(environment, *arguments):
        found = subprocess.run(
            [sys.executable, "-m", "sph", *map(str, arguments)],
            env=os.environ | environment, capture_output=True, text=True, timeout=300, check=True,
        )  # fmt: skip
        return found.stderr

    sph_({}, "run", tmp_path / "tube.toml", "-o", run)
    source = run / "checkpoints" / "checkpoint_000001.h5"
    assert "digits" not in sph_({}, "restart", source, "-o", tmp_path / "same")
    said = sph_(PROCESSORS["generic"], "restart", source, "-o", other)
    assert "may differ in their last digits" in said
    assert "NUMBA_CPU_NAME (None, here generic)" in said
