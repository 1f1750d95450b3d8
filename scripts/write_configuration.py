"""Write docs/configuration.md: every key of every problem, from the definitions themselves.

python scripts/write_configuration.py
"""

from pathlib import Path

from sph import config, registry
from sph.config import commented, physics, restarts
from sph.config.sections import SECTIONS
from sph.problems.base import Problem

TARGET = Path(__file__).parents[1] / "docs" / "configuration.md"
HEAD = """# Configuration

Every key with its meaning, bounds and default, as `sph new PROBLEM` prints it. The command
`python scripts/write_configuration.py` writes this page from the definitions in the sources.

A configuration is checked strictly: an unknown key, a wrong type and a value out of bounds are
errors. The messages give file, line and the nearest valid name, and `sph` reports all errors
together. A key that is not given has its default. A problem may have its own defaults for keys of
other tables. `--set TABLE.KEY=VALUE` sets a key from the command line. `--set TABLE.KEY=none`
leaves out a key that has no default.

In place of `problem.name`, `problem.file` names a Python file with a problem of your own
([own_problem.md](own_problem.md)); `sph new FILE.py` prints its keys.

The class of a key says whether `sph restart --set` may change the key:

{classes}

{tables}. In the other tables each key states its class. The lineage is stored in the checkpoints
that the restarted run writes, and in `summary.json`.
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
    for name in registry.names(physics.FORMULATIONS, folders=True):
        if name != physics.DEFAULT:
            parts.append(
                f'## \\[physics] with formulation = "{name}"\n\n```toml\n{_physics(name)}```\n'
            )
    return "\n".join(parts)


def _physics(formulation: str) -> str:
    """The table [physics] of a formulation, with its own defaults."""
    of_it = f'[problem]\nname = "shock_tube"\n[physics]\nformulation = "{formulation}"\n'
    return commented.text({"physics": config.from_text(of_it).physics})


def _head() -> str:
    """HEAD with the classes of keys in a restart, and the tables whose keys are all of one."""
    classes = "\n".join(f"- **{name}**: {what};" for name, what in restarts.CLASSES.items())
    tables = {"problem": Problem, **SECTIONS}
    alike = [f"[{name}] is {table.restart}" for name, table in tables.items() if table.restart]
    return HEAD.format(
        classes=classes.removesuffix(";") + ".",
        tables=f"The class of all keys of {', of '.join(alike)}",
    )


def _problem_table(page: str) -> str:
    """The [problem] table of a template: all before the comment of the next table."""
    lines = page.splitlines(keepends=True)
    next_table = next(
        i for i, line in enumerate(lines) if line.startswith("[") and "[problem]" not in line
    )
    while lines[next_table - 1].startswith("#"):
        next_table -= 1
    return "".join(lines[:next_table]).rstrip() + "\n"


if __name__ == "__main__":
    TARGET.write_text(text())
