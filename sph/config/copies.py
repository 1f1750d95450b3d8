"""Copies of configuration files in other directories, from which relative paths still hold."""

import os
import re
from pathlib import Path

from sph.config import problem_choice
from sph.config.reading import parse, read
from sph.config.toml_text import value_text


def read_to_copy(path: str | Path) -> str:
    """Return the text of a configuration file, with absolute paths, for a copy elsewhere.

    Raises FileError and ConfigError, and DeclarationError for a problem of a wrong class.
    """
    text, directory = read(path), Path(path).parent
    source, lines = parse(text, str(path)), text.splitlines(keepends=True)
    given = source.tables.get("problem")
    given = given if isinstance(given, dict) else {}
    problem = problem_choice.chosen(dict(given), str(directory), [])
    for key in problem.paths if problem else ():
        value, line = given.get(key), source.places.get(("problem", key))
        if isinstance(value, str) and value and isinstance(line, int):
            absolute = f"{key} = {value_text(os.path.abspath(directory / value))}"
            found = re.search(rf"""\b{key}\s*=\s*("[^"]*"|'[^']*')""", lines[line - 1])
            if found:
                lines[line - 1] = lines[line - 1].replace(found[0], absolute, 1)
    return "".join(lines)
