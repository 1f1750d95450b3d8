"""Write docs/problems/: a page for each problem, from the sources.

python scripts/write_problems.py
"""

import ast
import inspect
import json
import re
import tomllib
from functools import cache
from pathlib import Path

from sph import columns, registry
from sph.problems import base

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "docs" / "problems"
HEAD = """# Problems

Each problem has a page. The command `python scripts/write_problems.py` writes these pages from the
sources. `sph list` prints the first column.

| problem | what it is |
| --- | --- |
"""
PICTURES = {
    "shock_tube": ("sod.png", "Sod's shock tube and the exact solution"),
    "kelvin_helmholtz_smooth": ("shear_layer.png", "Billows of a shear layer"),
    "point_explosion": ("blast.png", "Dense shell of a blast wave"),
}
PACKAGE = "sph.problems"


def pages() -> dict[str, str]:
    """Return the text of each page by its file name."""
    names = registry.names(PACKAGE)
    rows = (f"| [`{one}`]({one}.md) | {_about(one)[0]} |" for one in names)
    return {"README.md": HEAD + "\n".join(rows) + "\n"} | {f"{one}.md": _page(one) for one in names}


def _page(name: str) -> str:
    first, rest = _about(name)
    kind = registry.load(PACKAGE, name).Problem
    parts = [f"# {name}", first, rest, _picture(name)]
    parts += ["## Run", _block(_commands(name)), _links(name, kind)]
    if theory := _theory(name):
        parts += ["## Theory", "These equations are in [equations](../equations.md), too.", *theory]
    if kind.defaults:
        rows = [
            f"| `{key}` | `{json.dumps(value)}` |" for key, value in sorted(kind.defaults.items())
        ]
        parts += [
            "## Defaults of other tables",
            "| key | default |\n| --- | --- |\n" + "\n".join(rows),
        ]
    if kind.limits:
        rows = [_limit(kind, key, one) for key, one in kind.limits.items()]
        head = "| figure | limit | why |\n| --- | --- | --- |\n"
        said = "The summary warns beyond these limits. Some settings change or remove them."
        parts += ["## Limits", said, head + "\n".join(rows)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _about(name: str) -> tuple[str, str]:
    """Return the first line and the rest of the docstring of a problem's file."""
    first, _, rest = inspect.getdoc(registry.load(PACKAGE, name)).partition("\n")
    return first, rest.strip()


def _picture(name: str) -> str:
    """Return a picture: one with a caption of its own, or one of scripts/problem_pictures.py."""
    own = (f"problems/{name}.png", f"The run of configs/{name}.toml")
    file, shown = PICTURES.get(name, own)
    exists = (ROOT / "docs" / "images" / file).exists()
    return f"![{shown}](../images/{file})" if exists else ""


def _commands(name: str) -> str:
    """Return the commands that run the shipped configurations of a problem."""
    files = sorted((ROOT / "configs").glob("*.toml"))
    found = (
        one for one in files if tomllib.loads(one.read_text("utf-8"))["problem"]["name"] == name
    )
    runs = [f"sph run configs/{one.name}" for one in found]
    return "\n".join([*runs, f"sph new {name}    # prints a configuration with every key"])


def _block(commands: str) -> str:
    return f"```sh\n{commands}\n```"


def _links(name: str, kind: type) -> str:
    """Return where keys and figures of a problem are explained."""
    keys = f"[Keys of `[problem]`](../configuration.md#{name})"
    return f"{keys} · [columns and figures](../output.md#{name})" if kind.quantities else keys


def _theory(name: str) -> list[str]:
    """Return the equations from 200 on that name a file of the problem, or that its file cites."""
    path = ROOT / "sph" / "problems" / f"{name}.py"
    files = {f"{one}.py" for one in (name, *_exact_modules(path))}
    cited = _numbers(path.read_text("utf-8"))
    return [
        text
        for number, text in _equations().items()
        if number in cited or files & set(re.findall(r"`(\w+\.py)`", _first_line(text)))
    ]


def _first_line(text: str) -> str:
    return text.partition("\n")[0]


def _exact_modules(path: Path) -> set[str]:
    """Return the modules of sph.exact that a file imports, and those that these import."""
    tree = ast.parse(path.read_text("utf-8"))
    froms = [one for one in ast.walk(tree) if isinstance(one, ast.ImportFrom)]
    names = {alias.name for one in froms if one.module == "sph.exact" for alias in one.names}
    names |= {one.module.split(".")[2] for one in froms if f"{one.module}".startswith("sph.exact.")}
    files = {one: ROOT / "sph" / "exact" / f"{one}.py" for one in names}
    found = {one for one, file in files.items() if file.exists()}
    return found.union(*(_exact_modules(files[one]) for one in found))


def _numbers(text: str) -> set[int]:
    """Return the numbers from 200 on that a text cites: "eq 200", "eqs 200, 201 and 203-205"."""
    found = set()
    for group in re.findall(r"\beqs? ((?:\d{3}(?:[-, ]|and)*)+)", text):
        for first, last in re.findall(r"(\d{3})(?:-(\d{3}))?", group):
            found |= set(range(int(first), int(last or first) + 1))
    return {number for number in found if number >= 200}


@cache
def _equations() -> dict[int, str]:
    text = (ROOT / "docs" / "equations.md").read_text("utf-8")
    blocks = re.findall(r"^(\*\*\((\d+)\)\*\*.*?)(?=^\*\*\(|^#)", text, re.MULTILINE | re.DOTALL)
    return {int(number): block.strip() for block, number in blocks if int(number) >= 200}


def _limit(kind: type, key: str, limit: base.Limit) -> str:
    meaning = kind.quantities.get(key) or columns.OF_ALL.get(key)
    shown = f"`{key}`" + (f": {meaning.help}" if meaning else "")
    bound = f"{'≥' if limit.at_least else '≤'} {limit.bound:g}"
    return "| " + " | ".join(one.replace("|", "\\|") for one in (shown, bound, limit.reason)) + " |"


if __name__ == "__main__":
    TARGET.mkdir(exist_ok=True)
    for name, text in pages().items():
        (TARGET / name).write_text(text, encoding="utf-8")
