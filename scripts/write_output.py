"""Write docs/output.md: columns of history.csv, entries of summary.json, datasets of frames.

python scripts/write_output.py
"""

from collections.abc import Mapping
from pathlib import Path

from sph import columns, meanings, registry
from sph.config.physics import FORMULATIONS
from sph.output.frames import CONTENTS, OF_ALL
from sph.quantity import Quantity

TARGET = Path(__file__).parents[1] / "docs" / "output.md"
HEAD = """# Output: history, summary and frames

The meaning and unit of every column of `history.csv`, of every entry of `summary.json`, and of
every dataset of the frames for movies. The command `python scripts/write_output.py` writes this
page from the definitions in the sources.
`sph info RUN` prints the figures of a run with these meanings. [snapshot.md](snapshot.md)
describes the checkpoints.

Length, mass and time are those of the configuration (code units). D is the number of dimensions:
the mass of a run in 1-D is mass per area, in 2-D mass per length. Entries without a unit are
ratios, counts or texts. `history.csv` has full precision; a number that JSON cannot express is
`"nan"`, `"inf"` or `"-inf"` in `summary.json`.
"""


FRAMES = """## Frames

With `output.frames = N` a run writes N frames for movies, evenly spaced from t = 0 to `time.end`:
`frames/frame_00000123.h5` holds the end of step 123. Frames change no step and no result: a frame
shows the end of the step that first reaches its time, and states the true time. Steps that are
longer than the spacing make fewer frames. A frame has a seventh of the bytes of a checkpoint.
`sph` writes a frame under a temporary name and renames it, so a frame is either complete or absent,
and a run that is killed keeps its frames. A restart removes frames of later steps than its
checkpoint, and continues.

A frame is an HDF5 file with the attributes `time`, `step` and `format_version`. Each dataset has an
attribute `offset`, one number for each component: **the value is the dataset plus its offset**. The
offset is zero unless the values differ by less than a tenth of their size, where single precision
alone would lose digits. A dataset is in double precision if its largest value is above 1e38 or
below 1e-30. Particles are in memory order, which changes from frame to frame.

    import h5py
    with h5py.File("frames/frame_00000123.h5") as frame:
        time = frame.attrs["time"]
        density = frame["density"][:] + frame["density"].attrs["offset"]
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
        FRAMES,
        _frames(),
        "## Columns and figures of problems\n\nFigures stand in the table `report` of the summary, "
        "and columns in the history. Many figures exist\nonly at some times and settings. `*` "
        "stands for any text.\n",
    ]
    for name in registry.names("sph.problems"):
        if quantities := registry.load("sph.problems", name).Problem.quantities:
            parts += [f"### {name}\n", _table("name", quantities)]
    return "\n".join(parts)


def _frames() -> str:
    """Return the table of the datasets of a frame."""
    rows = [
        (f"`{name}`", shape, _unit(one.unit), one.help, "" if name in OF_ALL else "a solid")
        for name, (one, shape) in CONTENTS.items()
    ]
    return _lines(("dataset", "shape", "unit", "meaning", "only if"), rows)


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
