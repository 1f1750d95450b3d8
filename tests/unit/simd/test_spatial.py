"""Every operation on vectors of space against NumPy."""

import functools

import numpy as np
import pytest
from lanes import LANES, compiled, precision

from sph import simd
from sph.neighbours.order import BLOCK
from sph.passes import blocks

SCENES = [(3, "double"), (3, "single"), (3, "scalar"), (2, "double"), (1, "single")]
every_scene = pytest.mark.parametrize(("dimension", "name"), SCENES)


def compile_spatial(body, arguments):
    return compiled(
        f"def run(lanes, dim, {arguments}):\n" + "".join(f"    {one}\n" for one in body),
        **vars(blocks),
    )


def scene(dimension, name):
    """The lanes, dim, and the width of the lanes."""
    return LANES[name], (0,) * dimension, LANES[name].width


def numbers(lanes, *shape):
    return np.random.default_rng(1).normal(size=shape).astype(precision(lanes))


# name of a result: expression in compiled code, and in NumPy with a, b (D, lanes); v: (D,) numbers
ALGEBRA = {
    "plus(a, b)": lambda a, b, v: a + b,
    "minus(a, b)": lambda a, b, v: a - b,
    "minus(v, a)": lambda a, b, v: v[:, None] - a,
    "times(a, b)": lambda a, b, v: a * b,
    "times(a, 2.5)": lambda a, b, v: a * 2.5,
    "times(a, s)": lambda a, b, v: a * b[0],
    "larger_each(a, b)": lambda a, b, v: np.maximum(a, b),
    "larger_each(a, 0.0)": lambda a, b, v: np.maximum(a, 0.0),
    "larger_each(a, v)": lambda a, b, v: np.maximum(a, v[:, None]),
    "plus(zeros(lanes, dim), a)": lambda a, b, v: a,
}
PRODUCTS = {
    "dot(a, b)": lambda a, b, v: (a * b).sum(axis=0),
    "dot(a, v)": lambda a, b, v: (a * v[:, None]).sum(axis=0),
}


@functools.cache
def algebra(dimension, name):
    """Inputs a, b, v, and the results of ALGEBRA and PRODUCTS."""
    lanes, dim, width = scene(dimension, name)
    body = [
        "a, b = load_spatial(lanes, dim, ab, 0, 0), load_spatial(lanes, dim, ab, len(dim), 0)",
        "v, s = at(dim, field, 3), load(lanes, ab, (len(dim), 0))",
        *(f"store_spatial(out, {k * dimension}, 0, {one})" for k, one in enumerate(ALGEBRA)),
        *(f"store(dots, ({k}, 0), {one})" for k, one in enumerate(PRODUCTS)),
    ]
    ab, field = numbers(lanes, 2 * dimension, width), numbers(simd.DOUBLE, dimension, 5)
    if width == 1:
        ab, field = ab.astype(float), field.astype(float)
    out = np.zeros((len(ALGEBRA) * dimension, width), ab.dtype)
    dots = np.zeros((len(PRODUCTS), width), ab.dtype)
    compile_spatial(body, "ab, field, out, dots")(lanes, dim, ab, field, out, dots)
    results = {
        **dict(zip(ALGEBRA, out.reshape(-1, dimension, width), strict=True)),
        **dict(zip(PRODUCTS, dots, strict=True)),
    }
    return ab[:dimension].astype(float), ab[dimension:].astype(float), field[:, 3], results


@every_scene
@pytest.mark.parametrize("expression", [*ALGEBRA, *PRODUCTS])
def test_algebra_equals_numpy(expression, dimension, name):
    a, b, v, results = algebra(dimension, name)
    expected = {**ALGEBRA, **PRODUCTS}[expression](a, b, v)
    # one rounding of an operand and of each product and sum of numbers up to 3
    eps = np.finfo(precision(LANES[name])).eps
    np.testing.assert_allclose(results[expression], expected, rtol=4 * eps, atol=20 * eps)


@pytest.mark.parametrize(("dimension", "name"), [one for one in SCENES if one[0] > 1])
def test_cross_products_and_curl(dimension, name):
    lanes, dim, width = scene(dimension, name)
    run = compile_spatial(
        [
            "a, b = load_spatial(lanes, dim, ab, 0, 0), load_spatial(lanes, dim, ab, len(dim), 0)",
            "store_spatial(out, 0, 0, cross(a, b))",
            "return len(curl_dim(dim))",
        ],
        "ab, out",
    )
    ab = numbers(lanes, 2 * dimension, width)
    out = np.zeros((3 if dimension == 3 else 1, width), ab.dtype)
    assert run(lanes, dim, ab, out) == len(out)
    a, b = ab[:dimension].astype(float), ab[dimension:].astype(float)
    expected = np.cross(a, b, axis=0) if dimension == 3 else [a[0] * b[1] - a[1] * b[0]]
    np.testing.assert_allclose(out, expected, atol=20 * np.finfo(ab.dtype).eps)


@every_scene
def test_numbers_of_particles(dimension, name):
    """A particle's vector is read in double precision and written, and lanes are added up."""
    lanes, dim, width = scene(dimension, name)
    run = compile_spatial(
        [
            "put(field, 2, plus(at(dim, field, 1), times(at(dim, field, 0), 2.0)))",
            "put(field, 3, lane_sums(load_spatial(lanes, dim, near, 1, 1)))",
            "put(field, 4, corner(dim, corners, 1, len(dim)))",
        ],
        "field, near, corners",
    )
    field, near = (
        numbers(simd.DOUBLE, dimension, 6).astype(float),
        numbers(lanes, dimension + 2, 20),
    )
    corners = numbers(simd.DOUBLE, 3, 2 * dimension)
    before = field.copy()
    run(lanes, dim, field, near, corners)
    # 3e-16: one rounding of numbers up to 8, or none where contracted
    np.testing.assert_allclose(field[:, 2], before[:, 1] + 2 * before[:, 0], atol=2e-15)
    sums = near[1 : dimension + 1, 1 : 1 + width].astype(float).sum(axis=1)
    np.testing.assert_allclose(field[:, 3], sums, atol=1e-14)  # 16 numbers up to 3, in any order
    np.testing.assert_array_equal(field[:, 4], corners[1, dimension:])
    np.testing.assert_array_equal(field[:, [0, 1, 5]], before[:, [0, 1, 5]])


@every_scene
def test_rows_and_columns_of_scratch(dimension, name):
    lanes, dim, width = scene(dimension, name)
    block = lanes.block_width
    run = compile_spatial(
        [
            "store_spatial(out, 0, 0, load_spatial(lanes, dim, near, 1, 3))",
            "store_spatial(rows_of, 1, 2, load_rows(lanes, dim, near, 2, 5))",
            "store_spatial(columns, 0, 0, load_column(lanes, dim, copied, 16))",
        ],
        "near, copied, out, rows_of, columns",
    )
    near, copied = numbers(lanes, dimension + 3, 24), numbers(lanes, 16 + dimension * BLOCK)
    out = np.zeros((dimension, width), near.dtype)
    rows_of, columns = (
        np.zeros((dimension + 1, block + 2), near.dtype),
        np.zeros((dimension, block), near.dtype),
    )
    run(lanes, dim, near, copied, out, rows_of, columns)
    np.testing.assert_array_equal(out, near[1 : dimension + 1, 3 : 3 + width])
    np.testing.assert_array_equal(rows_of[1:, 2:], near[2 : dimension + 2, 5 : 5 + block])
    assert not rows_of[0].any()
    assert not rows_of[:, :2].any()
    expected = copied[16:].reshape(dimension, BLOCK)[:, :block]
    np.testing.assert_array_equal(columns, expected)


@every_scene
def test_chosen_lanes_move_to_columns(dimension, name):
    """`move` and `pick_spatial` bring the chosen lanes of all components to the front."""
    lanes, dim, width = scene(dimension, name)
    block, count = lanes.block_width, dimension + 2
    run = compile_spatial(
        [
            "mask = load_block(lanes, flags, 0) > 0.5",
            "move(lanes, dim + (0, 0), copied, 8, front(lanes, mask), near, 3)",
            "wide = load(lanes, flags, 0) > 0.5",
            "a = load_spatial(lanes, dim, given, 0, 0)",
            "store_spatial(out, 0, 0, pick_spatial(a, front(lanes, wide)))",
        ],
        "flags, copied, near, given, out",
    )
    random = np.random.default_rng(8)
    copied, given = numbers(lanes, 8 + count * BLOCK), numbers(lanes, dimension, 16)
    for _ in range(40):
        flags = random.integers(0, 2, 16).astype(copied.dtype)
        near, out = np.zeros((count, 3 + BLOCK), copied.dtype), np.zeros_like(given)
        run(lanes, dim, flags, copied, near, given, out)
        chosen = np.flatnonzero(flags[:block])
        expected = copied[8:].reshape(count, BLOCK)[:, chosen]
        np.testing.assert_array_equal(near[:, 3 : 3 + chosen.size], expected)
        assert not near[:, :3].any()
        chosen = np.flatnonzero(flags[:width])
        np.testing.assert_array_equal(out[:, : chosen.size], given[:, chosen])
