"""The code blocks of a Markdown document and the commands in them, in the order of the page."""

import re
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
BLOCK = re.compile(
    r"^```(?P<info>\w*)\n(?P<fenced>(?:.*\n)*?)```$"  # fenced
    r"|(?<=\n\n)(?P<indented>(?: {4}.*\n|\n(?= {4}))+)"  # indented by four spaces
    r"|(?<!`)`(?P<inline>[^`\n]+)`(?!`)",
    re.MULTILINE,
)
FILE = r"`([\w./-]+\.(?:toml|py))`"
NAMED = re.compile(rf"Create {FILE}|{FILE}(?: beside it)?:")
FIRST_WORDS = ("sph", "python", "python3", "pip", "dask", "eval", "source", "git", "mkdocs",
               "ruff", "lint-imports", "mypy", "pre-commit", "grep", "for")  # fmt: skip


@dataclass(frozen=True)
class Block:
    """A piece of code of a page.

    kind: sh, toml, python, output (what the command before it prints), inline or other
    name: the file that the page tells the reader to create with this text; empty if none
    """

    page: Path
    line: int
    kind: str
    text: str
    name: str = ""

    @property
    def place(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def commands(self) -> list[str]:
        """The commands, without comments and without what a list says beside them."""
        if self.kind == "inline":
            return [self.text] if _is_command(self.text) else []
        if self.kind != "sh":
            return []
        is_loop = self.text.startswith("for ")
        lines = (_of_loop(self.text) if is_loop else self.text).splitlines()
        plain = (re.split(r" {2,}", one.strip())[0] for one in lines)
        parts = (part.strip() for one in plain for part in one.split("&&"))
        return [part for part in parts if part]


def blocks(page: Path) -> list[Block]:
    """All blocks of a page, those of inline code too."""
    text, found = page.read_text(encoding="utf-8"), []
    for match in BLOCK.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if match["inline"]:
            found.append(Block(page, line, "inline", match["inline"]))
            continue
        body = match["fenced"]
        if body is None:
            body = re.sub(r"^ {4}", "", match["indented"], flags=re.MULTILINE)
        named = NAMED.search(text[: match.start()].rstrip().rpartition("\n\n")[2])
        name = (named[1] or named[2]) if named else ""
        kind = _kind(match["info"] or "", body, found)
        found.append(Block(page, line, kind, body, name))
    return found


def _of_loop(script: str) -> str:
    """The commands `sph …` of a loop of the shell, with the values of its variables."""
    shown = 'sph() { printf "%q " sph "$@"; echo; }\n'
    return subprocess.run(
        ["bash", "-c", shown + script], check=True, capture_output=True, text=True
    ).stdout


def words(command: str) -> list[str]:
    """The words of a command, without a comment."""
    return shlex.split(command, comments=True)


def _is_command(line: str) -> bool:
    first, _, rest = line.partition(" ")
    known = first.removeprefix(".venv/bin/") in FIRST_WORDS or first.startswith("_SPH_COMPLETE=")
    return known and bool(rest)


def _kind(info: str, body: str, before: list[Block]) -> str:
    if info in ("sh", "toml", "python"):
        return info
    if all(_is_command(line) for line in body.splitlines()):
        return "sh"
    if body.startswith("["):
        return "toml"
    if re.match(r"import |from |numpy\.", body):
        return "python"
    last = next((one for one in reversed(before) if one.kind != "inline"), None)
    return "output" if info == "text" and last and last.kind == "sh" else "other"
