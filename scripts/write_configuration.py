"""Write docs/configuration.md: every key of every problem, from the definitions themselves.

python scripts/write_configuration.py
"""

from pathlib import Path

from sph import config, registry
from sph.config import restarts
from sph.config.sections import SECTIONS
from sph.problems.base import Problem

TARGET = Path(__file__).parents[1] / "docs" / "configuration.md"
HEAD = """# Configuration

Every key with its meaning, bounds and default, as `sph new PROBLEM` prints it. Written by
`python scripts/write_configuration.py` from the definitions in the sources, not by hand.

A configuration is strict: an unknown key, a wrong type or a value out of bounds is an error that
names file, line and the nearest valid name, all of them at once. A key that is left out takes its
default; a problem may have defaults of its own for keys of the other tables. `--set a.b=VALUE`
sets a key from the command line.

`sph restart --set` may change a key by its class:

{classes}

{tables}. Keys of the other tables each say their class. The lineage is in the checkpoints
written after the restart, and in `summary.json`.
"""


def text() -> str:
    """The whole page: [problem] of each problem, and the tables that all share."""
    pages = {name: config.template(name) for name in registry.names("sph.problems")}
    shared = (
        "\\[physics], [time], [output], [report], [run]: the defaults are those of `shock_tube`"
    )
    parts = [_head()]
    for name, page in pages.items():
        parts.append(f"## {name}\n\n```toml\n{_problem_table(page)}```\n")
    tables = pages["shock_tube"].removeprefix(_problem_table(pages["shock_tube"])).lstrip()
    parts.append(f"## {shared}\n\n```toml\n{tables}```\n")
    return "\n".join(parts)


def _head() -> str:
    """HEAD with the classes of keys in a restart, and the tables whose keys are all of one."""
    classes = "\n".join(f"- **{name}**: {what};" for name, what in restarts.CLASSES.items())
    tables = {"problem": Problem, **SECTIONS}
    alike = [f"[{name}] {table.restart}" for name, table in tables.items() if table.restart]
    return HEAD.format(
        classes=classes.removesuffix(";") + ".",
        tables=f"All keys of these tables have one class: {', '.join(alike)}",
    )


def _problem_table(page: str) -> str:
    """The [problem] table of a template: all before the comment of the next table."""
    lines = page.splitlines(keepends=True)
    next_table = next(
        i for i, line in enumerate(lines) if line.startswith("[") and "[problem]" not in line
    )
    return "".join(lines[: next_table - 1]).rstrip() + "\n"


if __name__ == "__main__":
    TARGET.write_text(text())
