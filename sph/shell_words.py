"""Paths in commands that a message tells the user to run."""

import shlex
from pathlib import Path


def quoted(path: str | Path) -> str:
    """`path` as one word of a shell, which no command takes for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)
