"""Arithmetic expressions in coordinates, evaluated without Python's `eval`.

Allowed are numbers, names of coordinates, pi, + - * / **, comparisons, `and`, `or`, `not`, and the
functions in FUNCTIONS. All else is an error with the column at which it begins.
"""

import ast
import difflib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

LONGEST = 500  # characters
DEEPEST = 50  # levels of nested operations
LARGEST = 1e300  # number; a float holds no more than 1.8e308

CONSTANTS = {"pi": np.pi}
# name: function, fewest and most arguments
FUNCTIONS: dict[str, tuple[Any, int, float]] = {
    "where": (np.where, 3, 3),
    "min": (lambda *each: np.minimum.reduce(np.broadcast_arrays(*each)), 2, np.inf),
    "max": (lambda *each: np.maximum.reduce(np.broadcast_arrays(*each)), 2, np.inf),
    "sin": (np.sin, 1, 1),
    "cos": (np.cos, 1, 1),
    "tan": (np.tan, 1, 1),
    "tanh": (np.tanh, 1, 1),
    "exp": (np.exp, 1, 1),
    "log": (np.log, 1, 1),
    "sqrt": (np.sqrt, 1, 1),
    "abs": (np.abs, 1, 1),
}
OPERATORS: dict[type, Any] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
    ast.Pow: np.power, ast.USub: np.negative, ast.UAdd: np.positive, ast.Not: np.logical_not,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
    ast.Eq: np.equal, ast.NotEq: np.not_equal, ast.And: np.logical_and, ast.Or: np.logical_or,
}  # fmt: skip


class Expression(NamedTuple):
    """A checked expression."""

    text: str
    tree: ast.expr

    @property
    def names(self) -> set[str]:
        """The coordinates in the expression."""
        found = {one.id for one in ast.walk(self.tree) if isinstance(one, ast.Name)}
        return found - CONSTANTS.keys() - FUNCTIONS.keys()

    def __call__(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the values (N,) for coordinates (N,) by name; NaN or infinite where undefined."""
        size = len(next(iter(values.values())))
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(_value(self.tree, values), dtype=float), (size,))


def parsed(text: str, coordinates: Sequence[str]) -> Expression:
    """Return the expression in a text.

    coordinates: the names that may occur. Raises ValueError that tells the column, from 1, of what
    is wrong.
    """
    if len(text) > LONGEST:
        raise ValueError(f"has {len(text)} characters; expected at most {LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        raise ValueError(
            f"is no expression: {error.msg} at column {error.offset or 1}; expected, for example, "
            f"1 + 0.1*sin(2*pi*{coordinates[0]})"
        ) from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f"is no expression: {error}") from None
    _check(tree, tuple(coordinates), 0)
    return Expression(text.strip(), tree)


def _check(node: ast.AST, coordinates: tuple[str, ...], depth: int) -> None:
    """Raise ValueError for anything in the tree that is not allowed."""
    if depth > DEEPEST:
        raise ValueError(f"is nested deeper than {DEEPEST} levels")
    for one in _operands(node, coordinates):
        _check(one, coordinates, depth + 1)


def _operands(node: ast.AST, coordinates: tuple[str, ...]) -> list[ast.expr]:
    """Return the operands of an allowed operation."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            if value > LARGEST:
                raise ValueError(f"has {_source(node)} at column {_column(node)}; expected less")
            return []
        case ast.Name(id=name):
            if name in CONSTANTS or name in coordinates:
                return []
            raise _unknown("name", name, node, [*coordinates, *CONSTANTS])
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in OPERATORS:
            return [left, right]
        case ast.UnaryOp(op=operator, operand=operand) if type(operator) in OPERATORS:
            return [operand]
        case ast.BoolOp(values=values):
            return values
        case ast.Compare(left=left, ops=operators, comparators=others):
            if all(type(one) in OPERATORS for one in operators):
                return [left, *others]
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            _check_call(name, arguments, node)
            return arguments
    raise ValueError(
        f"has {_source(node)} at column {_column(node)}; expected numbers, "
        f"{', '.join([*coordinates, *CONSTANTS])}, + - * / **, comparisons, and, or, not, and "
        f"the functions {', '.join(FUNCTIONS)}"
    )


def _check_call(name: str, arguments: list[ast.expr], node: ast.Call) -> None:
    if name not in FUNCTIONS:
        raise _unknown("function", name, node, list(FUNCTIONS))
    _, fewest, most = FUNCTIONS[name]
    if not fewest <= len(arguments) <= most:
        expected = str(fewest) if fewest == most else f"at least {fewest}"
        raise ValueError(
            f"has {name} with {len(arguments)} argument(s) at column {_column(node)}; expected "
            f"{expected}"
        )


def _unknown(kind: str, name: str, node: ast.AST, valid: list[str]) -> ValueError:
    close = difflib.get_close_matches(name, valid, n=1)
    hint = f"did you mean {close[0]}?" if close else f"expected one of {', '.join(valid)}"
    return ValueError(f"has the unknown {kind} {name} at column {_column(node)}; {hint}")


def _column(node: ast.AST) -> int:
    return getattr(node, "col_offset", 0) + 1


def _source(node: ast.AST) -> str:
    text = ast.unparse(node)
    return text if len(text) <= 40 else text[:37] + "..."


def _value(node: ast.expr, values: Mapping[str, np.ndarray]) -> Any:
    """Return the value of a checked tree: a number, or an array (N,)."""
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return CONSTANTS[name] if name in CONSTANTS else values[name]
        case ast.UnaryOp(op=operator, operand=operand):
            return OPERATORS[type(operator)](_value(operand, values))
        case ast.BinOp(left=left, op=operator, right=right):
            return OPERATORS[type(operator)](_value(left, values), _value(right, values))
        case ast.BoolOp(op=operator, values=operands):
            first, *others = (_value(one, values) for one in operands)
            for other in others:
                first = OPERATORS[type(operator)](first, other)
            return first
        case ast.Compare(left=left, ops=operators, comparators=others):
            sides = [_value(one, values) for one in (left, *others)]
            each = [
                OPERATORS[type(operator)](sides[i], sides[i + 1])
                for i, operator in enumerate(operators)
            ]
            return np.logical_and.reduce(np.broadcast_arrays(*each))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name][0](*(_value(one, values) for one in arguments))
    raise AssertionError(f"{ast.dump(node)} was not checked")
