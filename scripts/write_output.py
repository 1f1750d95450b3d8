"""Write docs/output.md: every column of history.csv and entry of summary.json, from their sources.

python scripts/write_output.py
"""

from collections.abc import Mapping
from pathlib import Path

from sph import columns, meanings, registry
from sph.config.physics import FORMULATIONS
from sph.quantity import Quantity

TARGET = Path(__file__).parents[1] / "docs" / "output.md"
HEAD = """# Output: history and summary

The meaning and unit of every column of `history.csv` and of every entry of `summary.json`. The
command `python scripts/write_output.py` writes this page from the definitions in the sources.
`sph info RUN` prints the figures of a run with these meanings. [snapshot.md](snapshot.md)
describes the checkpoints.

Length, mass and time are those of the configuration (code units). D is the number of dimensions:
the mass of a run in 1-D is mass per area, in 2-D mass per length. Entries without a unit are
ratios, counts or texts. `history.csv` has full precision; a number that JSON cannot express is
`"nan"`, `"inf"` or `"-inf"` in `summary.json`.
"""


def text() -> str:
    """Return the whole page."""
    of_some = {name: one for name, (one, _) in columns.OF_SOME.items()}
    conditions = {name: when for name, (_, when) in columns.OF_SOME.items()}
    parts = [
        HEAD,
        "## history.csv\n\nOne row for each step, and one for the initial state.\n",
        _table("column", columns.OF_ALL),
        "Columns of some runs:\n",
        _table("column", of_some | _of_parts(), conditions | _owners()),
        "Criteria in the column `limiter`:\n",
        _lines(("criterion", "what limits the step"), meanings.criteria().items()),
        "Problems add columns: see below.\n",
        "## summary.json\n\nEntries of tables are written TABLE.NAME, those of lists TABLE[].NAME; "
        "FIELD is the name of a field.\n",
        _table("entry", meanings.of_summary()),
        "## Columns and figures of problems\n\nFigures stand in the table `report` of the summary, "
        "and columns in the history. Many figures exist\nonly at some times and settings. `*` "
        "stands for any text.\n",
    ]
    for name in registry.names("sph.problems"):
        if quantities := registry.load("sph.problems", name).Problem.quantities:
            parts += [f"### {name}\n", _table("name", quantities)]
    return "\n".join(parts)


def _of_parts() -> dict[str, Quantity]:
    names = registry.names(FORMULATIONS, folders=True)
    return {column: one for name in names for column, one in meanings.of_part_columns(name).items()}


def _owners() -> dict[str, str]:
    """Return which scenes have the columns of parts."""
    found = {}
    for folder in (FORMULATIONS, "sph.parts"):
        for name in registry.names(folder, folders=True):
            is_formulation = folder == FORMULATIONS
            key = f'formulation = "{name}"' if is_formulation else f"{name} is given"
            for column in registry.part_class(folder, name).columns:
                found[column] = f"physics.{key}"
    return found


def _table(title: str, quantities: Mapping[str, Quantity], conditions=None) -> str:
    header = (title, "unit", "meaning", *(["only if"] if conditions else []))
    rows = [
        (f"`{name}`", _unit(one.unit), one.help, *([conditions[name]] if conditions else []))
        for name, one in quantities.items()
    ]
    return _lines(header, rows)


def _unit(unit: str) -> str:
    return f"`{unit}`" if "^" in unit else unit


def _lines(header, rows) -> str:
    lines = [header, ["---"] * len(header), *rows]
    cells = [" | ".join(str(cell).replace("|", "\\|") for cell in line) for line in lines]
    return "".join(f"| {line} |\n" for line in cells)


if __name__ == "__main__":
    TARGET.write_text(text())
