"""The line for each point that ends, and the closing words."""

import pytest

from sph.errors import NumericalError, Stopped
from sph.sweep import command
from sph.sweep.command import _Told
from sph.sweep.task import Outcome, Task

DONE = Outcome("a", "done", how="run")
WARNED = Outcome("b", "done", how="restart", warnings=("limit", "paired"))
FAILED = Outcome("c", "failed", "no more\nTry: less", how="run", code=3)
STOPPED = Outcome("d", "stopped", "with a checkpoint", how="run")


@pytest.fixture
def printed_of(capsys):
    """printed_of(*outcomes): what was said of twelve points, two of which were done before."""

    def after(*outcomes):
        one = _Told(12, 2)
        for outcome in outcomes:
            one(outcome)
        one.shown.close()
        return one, capsys.readouterr().err

    return after


def test_each_point_has_line_with_number_mark_and_reason(printed_of):
    _, said = printed_of(DONE, WARNED, FAILED, STOPPED)
    lines = [line for line in said.splitlines() if line.startswith("[")]
    assert "2 of 12 points are done already" in said
    assert lines == [
        "[ 3/12] a done",
        "[ 4/12] b done, restarted from its last checkpoint, with warnings: limit, paired",
        "[ 5/12] c FAILED: no more",
        "[ 6/12] d stopped: with a checkpoint",
    ]


def test_finished_points_and_points_with_warnings_are_counted(printed_of):
    assert printed_of(DONE)[0].closing() == "3 of 12 points are done."
    both = printed_of(DONE, WARNED)[0].closing()
    assert both == "4 of 12 points are done, 1 of them ended with warnings."


def test_failed_points_listed_before_stopped_points(printed_of):
    with pytest.raises(NumericalError) as caught:
        printed_of(DONE, STOPPED, FAILED)[0].closing()
    assert str(caught.value) == "3 of 12 points are done, 1 failed:\n  c: no more"
    with pytest.raises(Stopped, match=r"^4 of 12 points are done; the same command"):
        printed_of(DONE, WARNED, STOPPED)[0].closing()


def test_sweep_runs_unfinished_points_and_counts_rest(tmp_path, monkeypatch, capsys):
    (tmp_path / "tube.toml").write_text('[problem]\nname = "shock_tube"\nn = 40\n')
    names = [f"physics.C={value}" for value in (0.1, 0.2, 0.3)]
    statuses = dict(zip(names, ("done", "failed", None), strict=True))
    monkeypatch.setattr(Task, "status", property(lambda task: statuses[task.point.name]))
    begun = []

    def run(missing, tell):
        for task in missing:
            begun.append(task.point.name)
            tell(Outcome(task.point.name, "done", how="run"))

    monkeypatch.setattr(command, "_runner", lambda *_: run)
    target = tmp_path / "sweep"
    said = command.run(tmp_path / "tube.toml", ["physics.C=0.1,0.2,0.3"], [], target)
    assert begun == names[1:]
    assert said == "3 of 3 points are done."
    assert "1 of 3 points are done already" in capsys.readouterr().err
