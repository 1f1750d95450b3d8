"""Quoting of paths in commands that a message suggests."""

import shlex
from pathlib import Path


def quoted(path: str | Path) -> str:
    """Return `path` quoted as one shell word that no command mistakes for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)
