"""A sweep over a lattice and a glass, and the report on it."""

import pytest
from click.testing import CliRunner

from sph.analysis import report as reports
from sph.analysis.report import table, words
from sph.cli import main
from sph.output.history import read as read_history

VORTEX = """\
[problem]
name = "gresho"
[time]
end = 0.01
[output]
interval = 0.01
[run]
threads = 1
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    directory = tmp_path_factory.mktemp("sweep")
    config = directory / "vortex.toml"
    config.write_text(VORTEX)
    arguments = ["--vary", "problem.n=64,144", "--vary", "problem.relax=none,{residual=2e-3}"]
    called = ["sweep", str(config), *arguments, "--jobs", "1", "-o", str(directory / "runs")]
    result = CliRunner().invoke(main, called)
    assert result.exit_code == 0, result.output
    return reports.make([directory / "runs"], reports.Question(field="velocity"))


@pytest.mark.slow
def test_lattice_and_glass_are_two_lines(report):
    assert [line.label for line in report.series] == ["relax = given", "relax = none"]
    numbers = [[report.rows[i].n for i in line.members] for line in report.series]
    assert numbers == [[64, 144], [64, 144]]
    relaxed = [bool(row.relaxation) for row in report.rows]
    assert relaxed == [True, True, False, False]
    assert all(row.relaxation["density_error"] <= 2e-3 for row in report.rows[:2])


@pytest.mark.slow
def test_cost_of_relaxation_is_in_the_cost(report):
    for row, cost in zip(report.rows[:2], report.cost[:2], strict=True):
        spent = row.relaxation["cpu_seconds"]
        session = row.ended["cost"]["session"]
        phases = dict(session["phases_cpu_seconds"])
        del phases["start of Numba"], phases["output"]  # the last output follows the last row
        # four digits after the point are kept of each phase
        assert phases["initial state"] == pytest.approx(spent, abs=1e-4)
        assert cost >= sum(phases.values()) - 1e-3 > spent
        # 10 iterations and more of Python over thousands of pairs
        assert read_history(row.path / "history.csv")["cpu_seconds"][0] >= spent > 0.01


@pytest.mark.slow
def test_cost_of_relaxation_is_stated_apart(report):
    header, *lines = table.cells(report)
    at = header.index(table.RELAXATION)
    assert header[at - 1] == "CPU s"
    assert [line[at] for line in lines[2:]] == ["–", "–"]
    assert all(float(line[at - 1]) > float(line[at]) > 0.0 for line in lines[:2])
    assert "Times include relaxation to a glass: " in "\n".join(words.sentences(report))
