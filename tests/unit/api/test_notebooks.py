"""The notebooks run from the first cell to the last, without Jupyter, and show what they say."""

import contextlib
import io
import json
from pathlib import Path

import matplotlib
import pytest

NOTEBOOKS = Path(__file__).parents[3] / "docs" / "notebooks"


@pytest.fixture
def executed(monkeypatch):
    """Execute the code cells of a notebook in its directory; return its names, and its output."""
    matplotlib.use("Agg")
    monkeypatch.chdir(NOTEBOOKS)

    def execute(name):
        names, said = {"__name__": "__main__"}, io.StringIO()
        for number, cell in enumerate(cells(NOTEBOOKS / name)):
            if cell["cell_type"] == "code":
                code = compile("".join(cell["source"]), f"{name}, cell {number}", "exec")
                with contextlib.redirect_stdout(said):
                    exec(code, names)
        return names, said.getvalue()

    yield execute
    from matplotlib import pyplot

    pyplot.close("all")


def cells(path):
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.name)
def test_notebook_is_of_format_4_5(path):
    found = json.loads(path.read_text(encoding="utf-8"))
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)
    identities = [cell["id"] for cell in found["cells"]]
    assert len(set(identities)) == len(identities)
    for cell in found["cells"]:
        keys = {"cell_type", "id", "metadata", "source"}
        more = {"execution_count", "outputs"} if cell["cell_type"] == "code" else set()
        assert set(cell) == keys | more
        outputs = cell.get("outputs", [])
        assert not any(one["output_type"] == "error" for one in outputs)


@pytest.mark.slow
def test_exercise_measures_first_order(executed):
    names, said = executed("sod_error.ipynb")
    # jumps are smeared over a fixed number of particles: order 1, less what coarse runs lack
    assert 0.7 < names["order"] < 1.1
    assert f"measured order: {names['order']:.2f}" in said
    assert names["share"] > 0.4  # of the error is at the two jumps


@pytest.mark.slow
def test_own_initial_state_is_equal_by_arrays_and_by_file(executed):
    names, said = executed("two_clouds.ipynb")
    assert names["equal"]
    assert 0.3 < names["centre"] < 0.5
    highest = [float(line.split()[-1]) for line in said.splitlines() if "highest density" in line]
    assert highest == sorted(highest)
