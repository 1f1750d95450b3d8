"""Expressions in coordinates: their values, and the position of what is not allowed."""

import math

import numpy as np
import pytest

from sph.problems.support import expressions

X = np.array([0.0, 0.25, 0.5, 1.0])
PLACES = {"x": X, "y": 2.0 * X, "r": X}
VALUES = {
    "1": lambda x, y: 1.0,
    "2.5e-1 + x": lambda x, y: 0.25 + x,
    "-x**2": lambda x, y: -(x**2),
    "2**3**2": lambda x, y: 512.0,
    "x - 1 - 2": lambda x, y: x - 3.0,
    "1/(1 + x)*2": lambda x, y: 2.0 / (1.0 + x),
    "1 + 0.1*sin(2*pi*x)": lambda x, y: 1.0 + 0.1 * np.sin(2.0 * math.pi * x),
    "where(x < 0.5, 1, y)": lambda x, y: np.where(x < 0.5, 1.0, y),
    "where(0.2 < x <= 0.5, 1, 2)": lambda x, y: np.where((x > 0.2) & (x <= 0.5), 1.0, 2.0),
    "where(x < 0.2 or not x < 0.6, 1, 2)": lambda x, y: np.where((x < 0.2) | (x >= 0.6), 1.0, 2.0),
    "where(x > 0.2 and y < 1.5, 1, 2)": lambda x, y: np.where((x > 0.2) & (y < 1.5), 1.0, 2.0),
    "min(x, y, 0.3) + max(1, 2)": lambda x, y: np.minimum(x, 0.3) + 2.0,
    "sqrt(abs(x - 1)) + exp(-r) + log(1 + x)": lambda x, y: (
        np.sqrt(np.abs(x - 1.0)) + np.exp(-x) + np.log(1.0 + x)
    ),
    "tanh(x) + cos(x) + tan(x)": lambda x, y: np.tanh(x) + np.cos(x) + np.tan(x),
}


@pytest.mark.parametrize("text", VALUES)
def test_value_is_that_of_numpy(text):
    found = expressions.parsed(text, ["x", "y", "r"])(PLACES)
    expected = np.broadcast_to(VALUES[text](X, 2.0 * X), X.shape)
    # the same operations of NumPy, but for powers and signs in another order: two roundings
    np.testing.assert_allclose(found, expected, rtol=4e-16, atol=1e-300)


@pytest.mark.parametrize("text", ["1/x", "log(x - 1)", "1e300*1e300", "9**9**9**9", "x/x"])
def test_undefined_value_is_not_finite_and_raises_nothing(text):
    found = expressions.parsed(text, ["x"])(PLACES)
    assert not np.isfinite(found).all()


WRONG = {
    "1 + sni(x)": "unknown function sni at column 5; did you mean sin?",
    "1 + q": "unknown name q at column 5; expected one of x, y, r, pi",
    "z": "unknown name z at column 1",
    "min": "unknown name min at column 1",
    "x + min(x)": "min with 1 argument(s) at column 5; expected at least 2",
    "sin(x, y)": "sin with 2 argument(s)",
    "sin(x, out=y)": "has sin(x, out=y) at column 1",
    "sin(*x)": r"has *x at column 5",
    "1 +": "no expression",
    "": "no expression",
    "x y": "no expression",
    "x\n+ 1": "no expression",
    "x\0": "no expression",
    "__import__('os').system('ls')": "has __import__('os').system('ls') at column 1",
    "x.real": "has x.real at column 1",
    "2*x[0]": "has x[0] at column 3",
    "(lambda: 1)()": "has (lambda: 1)() at column 1",
    "[x for x in y]": "at column 1",
    "x if x > 0 else 1": "at column 1",
    "y := 1": "no expression",
    "'a'*9": "has 'a' at column 1",
    "True": "has True at column 1",
    "1j": "has 1j at column 1",
    "...": "has ... at column 1",
    "f'{x}'": "at column 1",
    "x // 2": "has x // 2 at column 1",
    "x @ y": "has x @ y",
    "x in y": "has x in y",
    "~x": "has ~x",
    "1" + "0" * 400: "expected less",
    "1e999": "expected less",
    "-" * 100 + "x": "nested deeper than 50 levels",
    "(" * 300: "no expression",
    "x + " * 200 + "x": "expected at most 500",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_wrong_expression_is_refused_with_its_position(text):
    with pytest.raises(ValueError) as caught:  # noqa: PT011 (compared below)
        expressions.parsed(text, ["x", "y", "r"])
    assert WRONG[text] in str(caught.value)


def test_names_of_expression_are_its_coordinates():
    assert expressions.parsed("pi*x + sin(r)", ["x", "y", "r"]).names == {"x", "r"}
