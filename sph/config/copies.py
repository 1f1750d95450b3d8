"""Copies of configuration files in other directories, from which relative paths still hold."""

import os
import re
from pathlib import Path

from sph.config.reading import parse, read
from sph.config.toml_text import value_text

# Keys of [problem] whose relative paths begin at the directory of the configuration file.
PATHS = ("file", "path")


def read_to_copy(path: str | Path) -> str:
    """Return the text of a configuration file, with absolute paths, for a copy elsewhere.

    Raises FileError and ConfigError.
    """
    text, directory = read(path), Path(path).parent
    source, lines = parse(text, str(path)), text.splitlines(keepends=True)
    given = source.tables.get("problem")
    for key, value in given.items() if isinstance(given, dict) else ():
        line = source.places.get(("problem", key))
        if key in PATHS and isinstance(value, str) and value and isinstance(line, int):
            absolute = f"{key} = {value_text(os.path.abspath(directory / value))}"
            found = re.search(rf"""\b{key}\s*=\s*("[^"]*"|'[^']*')""", lines[line - 1])
            if found:
                lines[line - 1] = lines[line - 1].replace(found[0], absolute, 1)
    return "".join(lines)
