"""TOML text: the line of each key, which tomllib does not give, and values written as TOML."""

import re
import tomllib
from collections.abc import Callable
from typing import Any, NamedTuple

import tomli_w

Path = tuple[str | int, ...]

# The longest form of a string comes first. Up to two quotes may precede a closing triple quote.
_TOKEN = re.compile(
    r'''
    (?P<blank> [ \t\r]+ | \#[^\n]* )
  | (?P<string> """(?:\\.|[^\\])*?"""(?!") | \'\'\'.*?\'\'\'(?!\')
              | "(?:\\.|[^"\\\n])*" | '[^'\n]*' )
  | (?P<mark> [\n\[\]{}=,.] )
  | (?P<word> [^\s\[\]{}=,."'\#]+ )
    ''',
    re.VERBOSE | re.DOTALL,
)


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


def _tokens(text: str) -> list[_Token]:
    found, line = [], 1
    for match in _TOKEN.finditer(text):
        if match.lastgroup != "blank":
            found.append(_Token(match.lastgroup or "", match.group(), line))
        line += match.group().count("\n")
    found.append(_Token("mark", "\n", line))
    return found


class _Reader:
    """Finds the lines of keys in a text that is known to be valid TOML."""

    def __init__(self, text: str):
        self.tokens = _tokens(text)
        self.at = 0
        self.lines: dict[Path, int] = {}
        self.tables: dict[Path, int] = {}  # index of the last table [[...]] of each array

    @property
    def next(self) -> str:
        return self.tokens[self.at].text

    def take(self) -> _Token:
        self.at += 1
        return self.tokens[self.at - 1]

    def key(self) -> tuple[Path, int]:
        """Read a dotted key up to its `=` or `]`; return its parts and its line."""
        parts, line = [], self.tokens[self.at].line
        while self.next not in "=]":
            token = self.take()
            if token.kind == "string":
                parts.append(tomllib.loads(f"key = {token.text}")["key"])
            elif token.kind == "word":
                parts.append(token.text)
        return tuple(parts), line

    def note(self, path: Path, start: int, line: int) -> None:
        for end in range(start + 1, len(path) + 1):
            self.lines.setdefault(path[:end], line)

    def statements(self) -> None:
        table: Path = ()
        while self.at < len(self.tokens):
            if self.next == "\n":
                self.take()
            elif self.next == "[":
                table = self.header()
            else:
                self.pair(table)

    def header(self) -> Path:
        brackets = 0
        while self.next == "[":
            brackets += 1
            self.take()
        parts, line = self.key()
        while self.next == "]":
            self.take()
        path: Path = ()
        for i, part in enumerate(parts, start=1):
            path += (part,)
            if brackets == 2 and i == len(parts):
                self.tables[path] = self.tables.get(path, -1) + 1
            if path in self.tables:
                path += (self.tables[path],)
        self.note(path, 0, line)
        return path

    def pair(self, table: Path) -> None:
        key, line = self.key()
        self.take()  # =
        self.note(table + key, len(table), line)
        self.value(table + key)

    def value(self, path: Path) -> None:
        """Skip a value; note the keys of inline tables, also of those in arrays."""
        if self.next == "{":
            self.entries("}", lambda _: self.pair(path))
        elif self.next == "[":
            self.entries("]", lambda index: self.entry((*path, index)))
        else:
            while self.next not in ("\n", ",", "]", "}"):
                self.take()

    def entry(self, path: Path) -> None:
        """Skip an entry of an array; note where it begins if it is an inline table."""
        if self.next == "{":
            self.note(path, len(path) - 1, self.tokens[self.at].line)
        self.value(path)

    def entries(self, close: str, read: Callable[[int], None]) -> None:
        self.take()
        index = 0
        while self.next != close:
            if self.next in ("\n", ","):
                self.take()
            else:
                read(index)
                index += 1
        self.take()


def key_lines(text: str) -> dict[Path, int]:
    """Return the line (from 1) at which each table and key of a valid TOML text begins, by path.

    Tables in an array are listed with their index, e.g. ("problem", "body", 0); other entries of an
    array are not, but the array's key is.
    """
    reader = _Reader(text)
    reader.statements()
    return reader.lines


def value_text(value: Any) -> str:
    """Return a value as TOML on one line, with inline tables."""
    if isinstance(value, dict):
        pairs = (f"{key_text(key)} = {value_text(entry)}" for key, entry in value.items())
        return "{ " + ", ".join(pairs) + " }" if value else "{}"
    if isinstance(value, list):
        return "[" + ", ".join(value_text(entry) for entry in value) + "]"
    return tomli_w.dumps({"k": value}).removeprefix("k = ").rstrip("\n")


def key_text(key: str) -> str:
    """Return a key as TOML, quoted if necessary."""
    return tomli_w.dumps({key: 0}).removesuffix(" = 0\n")
