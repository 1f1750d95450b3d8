"""Docstrings that the program prints, available also under `python -OO`."""

import ast
import inspect
import textwrap
from typing import Any


def docstring(thing) -> str:
    """Return the docstring of a module, class or function without indentation, or "".

    Under `python -OO`, or PYTHONOPTIMIZE=2, the docstring is read from the source file.
    """
    if thing.__doc__:
        return inspect.cleandoc(thing.__doc__)
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(thing)))
    except (OSError, TypeError):  # the source is not available
        return ""
    documented: Any = tree if inspect.ismodule(thing) else tree.body[0]
    return ast.get_docstring(documented) or ""
