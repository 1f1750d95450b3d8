"""Docstrings that the program shows, also where Python runs without them (-OO)."""

import ast
import inspect
import textwrap
from typing import Any


def docstring(thing) -> str:
    """The docstring of a module, class or function, indentation removed; empty if it has none.

    Under `python -OO`, or PYTHONOPTIMIZE=2, it is read from the source.
    """
    if thing.__doc__:
        return inspect.cleandoc(thing.__doc__)
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(thing)))
    except (OSError, TypeError):  # there is no source
        return ""
    documented: Any = tree if inspect.ismodule(thing) else tree.body[0]
    return ast.get_docstring(documented) or ""
