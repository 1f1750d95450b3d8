"""What a session writes down of a simulation, each number in its place; without a run."""

import math
from collections.abc import Mapping
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from columns import as_columns

from sph import config as configuration
from sph import restarting, runner
from sph.analysis import summary
from sph.clock import PLACING
from sph.integrators.step_size import StepLimit
from sph.output.history import History
from sph.output.history import read as read_history
from sph.output.run_directory import RunDirectory
from sph.part import Part
from sph.quantity import Quantity
from sph.runner import Runner
from sph.scene import Scene
from sph.simulation import Simulation
from sph.steps import rows
from sph.totals import Baseline, Budget, Totals

CONFIG = configuration.from_text('[problem]\nname = "kelvin_helmholtz"\nn = 100\n')
TOTALS = Totals(
    kinetic_energy=1.0, kinetic_energy_without_bulk=2.0, internal_energy=3.0,
    energies={"potential_energy": 4.0},
    momentum=np.array([5.0, 6.0]), volume=7.0, min_density=8.0, max_density=9.0,
    min_internal_energy=10.0, max_internal_energy=11.0, rates=12.0,
)  # fmt: skip
OF_EVERY_RUN = {
    "step": 20, "t": 0.25, "dt": 0.125, "limiter_particle": 17, "limiter": "energy",
    "kinetic_energy": 1.0, "kinetic_energy_without_bulk": 2.0, "internal_energy": 3.0,
    "total_energy": 8.0, "energy_drift": -0.01, "energy_injected": 13.0,
    "momentum_x": 5.0, "momentum_y": 6.0, "min_density": 8.0, "max_density": 9.0,
    "min_internal_energy": 10.0, "max_internal_energy": 11.0,
}  # fmt: skip


class Clock:
    """A clock that stands at 2 s of wall-clock and 3 s of CPU time, and knows its phases."""

    wall, cpu, compiling = 2.0, 3.0, 1.0

    def __init__(self):
        self.seconds, self.phases = {"rates": 0.5, "density": 0.25}, []

    @contextmanager
    def phase(self, name):
        self.phases.append(name)
        yield


@pytest.fixture
def simulation():
    scene = SimpleNamespace(
        config=CONFIG, max_support=math.inf, is_filled=False, adds_energy=False, all_parts=(),
        columns=(), physics=CONFIG.physics,
    )  # fmt: skip
    made = SimpleNamespace(
        step=20, steps_here=15, time=0.25, limit=StepLimit(0.125, 17, "energy"), totals=TOTALS,
        energy_drift=-0.01, energy_injected=13.0, energy_added=14.0, held_supports=3,
        individual=None, updates_here=1500,
        volume_ratio=0.97, columns=dict, list_builds=6, clock=Clock(), scene=scene,
        team=SimpleNamespace(threads=2), check_fields=lambda: None, end=lambda: None,
        particles=SimpleNamespace(
            number=100, position=np.ones((2, 4)), velocity=np.ones((2, 4)), mass=np.ones(4),
            density=np.ones(4),
        ),
    )  # fmt: skip
    kept = []
    made.keep_row = lambda: kept.append(rows.of_simulation(made))
    made.take_rows = lambda: [kept.pop(0) for _ in list(kept)]
    return made


@pytest.fixture
def session(tmp_path, simulation):
    """session(past=()): a runner whose history has these rows of `OF_EVERY_RUN` changed."""
    directory = RunDirectory(tmp_path)

    def made(past=(), extra=()):
        history = History.create(directory.history, 2, [*extra, "mode_amplitude"])
        start = OF_EVERY_RUN | {"wall_seconds": 1.0, "cpu_seconds": 1.5, "mode_amplitude": 0.0}
        for row in past:
            history.extend(as_columns(start | row))
        history.flush()
        progress = SimpleNamespace(notes=[], closed=0)
        one = Runner(CONFIG, directory, simulation, history, progress, [])
        one.past = lambda: read_history(directory.history)
        return one

    return made


def recorded(one):
    """The row that a runner adds to its history, without the seconds and what the problem adds."""
    one.simulation.keep_row()
    one._record()
    one.history.flush()
    row = {name: values[-1] for name, values in one.past().items()}
    return {
        name: row[name]
        for name in row
        if name not in ("wall_seconds", "cpu_seconds", "mode_amplitude")
    }


def test_history_row_has_each_sum_in_its_column(session, simulation):
    assert recorded(session()) == OF_EVERY_RUN
    assert simulation.clock.phases == ["diagnostics"]


PULL = 'physics.external={ name = "point_mass", mass = 1.0 }'
HEATING = 'physics.heating={ name = "relaxation", energy = 1.0, time = 0.1 }'
OF_SOME_RUNS = {
    "held_supports": ("problem.boundary=open", 3),
    "volume_ratio": ("problem.boundary=periodic", 3.5),  # 7 of a box of 2
    "potential_energy": (PULL, 4.0),
    "energy_added": (HEATING, 14.0),
}
# A box of 1 by 2 whose scene has none of them.
NONE_OF_THEM = configuration.from_text(
    '[problem]\nname = "uniform"\ndimension = 2\nn = 100\nvelocity = [0.0, 0.0]\n'
    'domain = [[0.0, 1.0], [0.0, 2.0]]\nboundary = ["mirror", "open"]\n'
)


def counted(simulation, *overrides):
    """Give the stand-in the scene of these settings, and what `Simulation.columns` makes of it."""
    scene = Scene(NONE_OF_THEM.override(overrides))
    simulation.scene = scene
    simulation.volume_ratio = simulation.totals.volume / scene.domain.volume
    simulation.columns = lambda: Simulation.columns(simulation)
    return scene.columns


@pytest.mark.parametrize("column", OF_SOME_RUNS)
def test_optional_columns_present_only_where_meaningful(session, simulation, column):
    setting, expected = OF_SOME_RUNS[column]
    assert counted(simulation) == ()
    assert simulation.columns() == {}
    assert counted(simulation, setting) == (column,)
    assert simulation.columns() == {column: expected}
    assert recorded(session(extra=[column])) == OF_EVERY_RUN | {column: expected}


def test_columns_of_part_are_recorded(session, simulation):
    class Turning(Part):
        columns: Mapping[str, Quantity] = {
            name: Quantity("x") for name in ("turning_energy", "turns")
        }

        def sums(self, state):
            return {"turns": float(state.mass.sum())}

    counted(simulation)
    parts = (*simulation.scene.all_parts, Turning())
    simulation.scene.__dict__["all_parts"] = parts  # a cached property
    del simulation.scene.__dict__["columns"]
    simulation.totals = TOTALS._replace(energies={"turning_energy": 0.5})
    expected = {"turning_energy": 0.5, "turns": 4.0}
    assert simulation.columns() == expected
    # the energy belongs to the total
    assert recorded(session(extra=[*expected])) == OF_EVERY_RUN | expected | {"total_energy": 4.5}


def test_restart_seconds_continue_from_last_row(session, simulation):
    past = [
        {"wall_seconds": 1.0, "cpu_seconds": 1.5},
        {"wall_seconds": 4.0, "cpu_seconds": 6.0, "energy_injected": 0.75},
    ]
    one = session(past)
    one._closing = contextmanager(lambda: (yield))
    one._to_end = lambda: "ended"
    assert one.from_checkpoint() == "ended"
    assert simulation.energy_injected == 13.0  # which the checkpoint has
    assert len(one.past()["step"]) == 2  # the checkpoint's row is there
    simulation.keep_row()
    one._record()
    one.history.flush()
    # 4 + 2 and 6 + 3
    assert (one.past()["wall_seconds"][-1], one.past()["cpu_seconds"][-1]) == (6.0, 9.0)


@pytest.fixture
def place(tmp_path):
    """place(*rows): a run directory whose history has these rows of `OF_EVERY_RUN` changed."""
    directory = RunDirectory(tmp_path)

    def made(*rows, extra=("energy_added",)):
        history = History.create(directory.history, 2, [*extra])
        for row in rows:
            start = OF_EVERY_RUN | {"wall_seconds": 1.0, "cpu_seconds": 1.5}
            history.extend(as_columns(start | row))
        history.close()
        return directory

    return made


def test_checkpoint_without_budget_takes_it_from_history(place):
    """What it injected and added is of the checkpoint's step, its baseline of the first row."""
    directory = place(
        {"step": 0, "energy_injected": 0.5, "energy_added": 0.25,
         "kinetic_energy_without_bulk": 30.0, "internal_energy": 40.0},
        {"step": 5, "energy_injected": 0.75, "energy_added": -0.5},
        {"step": 9, "energy_injected": 9.0, "energy_added": 9.0},
    )  # fmt: skip
    found = restarting._budget(SimpleNamespace(budget=None, step=5), directory)
    assert found == Budget(0.75, -0.5, Baseline(70.0, 70.0))
    kept = Budget(1.0, 2.0, Baseline(3.0, 4.0))
    assert restarting._budget(SimpleNamespace(budget=kept, step=5), directory) is kept


def test_checkpoint_without_budget_and_history_has_none(place, tmp_path):
    lone = SimpleNamespace(budget=None, step=5)
    assert restarting._budget(lone, RunDirectory(tmp_path)) is None
    assert restarting._budget(lone, place(extra=())) is None


def test_checkpoint_without_run_starts_new_history(session, simulation):
    one = session()
    one._closing = contextmanager(lambda: (yield))
    one._to_end = lambda: "ended"
    assert one.from_checkpoint() == "ended"
    one.history.flush()
    assert (one.past()["wall_seconds"], one.past()["cpu_seconds"]) == ([2.0], [3.0])
    assert simulation.energy_injected == 13.0


def test_session_end_closes_history_progress_and_threads(session, simulation):
    one, closed = session(), []
    for name, thing in (("history", one.history), ("progress", one.progress),
                        ("simulation", simulation)):  # fmt: skip
        thing.close = lambda name=name: closed.append(name)
    with pytest.raises(ZeroDivisionError), one._closing():
        raise ZeroDivisionError
    assert closed == ["history", "progress", "simulation"]


def test_checkpoint_written_after_its_history_rows(session, simulation, monkeypatch):
    one, written = session(), []
    monkeypatch.setattr(
        runner.checkpoints,
        "write",
        lambda path, state: written.append((path, len(one.past()["step"]))),
    )
    monkeypatch.setattr(runner, "state_of", lambda *_: None)
    one.progress.wrote = lambda path, simulation: None
    simulation.check_fields = lambda: written.append("checked")
    simulation.keep_row()
    for _ in range(2):
        one._write_checkpoint()
    paths = [one.directory.checkpoint_path(number) for number in (0, 1)]
    assert written == ["checked", (paths[0], 1), "checked", (paths[1], 1)]
    assert (one.number, one.saved_step) == (2, 20)
    assert simulation.clock.phases == ["diagnostics", "output", "output"]


@pytest.fixture
def closing(session, monkeypatch):
    """A runner whose closing is told: ("summary" or "warn", what it was given), in order."""
    told = []

    def of_run(simulation, history, **given):
        told.append(("summary", given | {"rows": len(history["step"])}))
        return {"errors": None, "warnings": []}

    monkeypatch.setattr(summary, "of_run", of_run)
    monkeypatch.setattr(summary, "warn", lambda result, _: told.append(("warn", dict(result))))
    monkeypatch.setattr(runner.reference, "Reference", lambda path: f"reference {path}")
    monkeypatch.setattr(
        runner.reference, "errors_against", lambda state, fine, where: (state, fine, where)
    )
    monkeypatch.setattr(runner, "state_of", lambda *given: "state")
    one = session()
    one.simulation.keep_row()
    one.lineage, one.told = ("one line",), told
    one.written = []
    monkeypatch.setattr(
        RunDirectory, "write_summary", lambda _, result: one.written.append(dict(result))
    )
    return one


def test_summary_covers_all_rows_with_status_reason_and_lineage(closing):
    closing._close("failed", "it broke")
    given = {
        "status": "failed",
        "reason": "it broke",
        "lineage": ("one line",),
        "relaxation": None,
        "rows": 1,
    }
    assert closing.told == [("summary", given)]
    assert len(closing.written) == 1


@pytest.mark.parametrize("status", ["done", "stopped", "failed"])
def test_errors_against_reference_computed_at_end_of_run(closing, status):
    closing.config = CONFIG.override(["report.reference=fine"])
    result = closing._close(status)
    if status != "done":
        assert result["errors"] is None
        assert len(closing.told) == len(closing.written) == 1
        return
    fine = closing.config.report.reference
    assert fine.endswith("fine")
    errors = ("state", f"reference {fine}", str(closing.directory.path))
    assert result["errors"] == errors
    # the summary is kept should the reference have gone
    assert [one["errors"] for one in closing.written] == [None, errors]
    assert closing.told[-1] == ("warn", closing.written[-1])


@pytest.mark.parametrize(("saved_step", "number"), [(20, 3), (19, 4), (None, 4)])
def test_stop_writes_missing_checkpoint_and_names_last(
    closing, simulation, monkeypatch, saved_step, number
):
    written = []
    monkeypatch.setattr(runner.checkpoints, "write", lambda path, state: written.append(path))
    closing.progress.wrote = lambda path, simulation: None
    closing.number, closing.saved_step = 3, saved_step
    with pytest.raises(runner.Stopped) as caught:
        closing._stop("SIGTERM")
    assert len(written) == number - 3
    last = closing.directory.checkpoint_path(number - 1)
    assert "SIGTERM at t = 0.25, step 20" in str(caught.value)
    assert f"{last}." in str(caught.value)
    assert closing.told[0][1]["reason"] == "SIGTERM"
    assert closing.told[0][1]["status"] == "stopped"


def test_progress_shows_each_step_of_session(closing, simulation, monkeypatch):
    shown = []
    closing.config = CONFIG.override(["time.end=0.5", "output.interval=0.125"])
    simulation.scene.step_bounds = SimpleNamespace(courant=CONFIG.physics.C)

    def proceed(until, most, pause):
        assert most == 1  # of a problem with diagnostics
        simulation.time, simulation.step = min(until, simulation.time + 0.0625), simulation.step + 1
        simulation.keep_row()

    simulation.proceed = proceed
    closing.progress.start = lambda *given: shown.append(given)
    closing.progress.step = lambda given: shown.append(given.time)
    closing.progress.wrote = lambda path, given: shown.append(path.name)
    monkeypatch.setattr(runner.checkpoints, "write", lambda path, state: None)
    closing._to_end()
    assert shown == [
        (0.25, 0.5), 0.3125, 0.375, "checkpoint_000000.h5", 0.4375, 0.5, "checkpoint_000001.h5",
    ]  # fmt: skip
    assert closing.told[-1][1]["rows"] == 5
    assert closing.saved_step == 24


def test_session_silences_numpy_and_notes_too_many_threads(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "available_processors", lambda: 7)
    notes = []
    progress = SimpleNamespace(note=notes.append)
    for number in (7, 8):
        config = CONFIG.override([f"run.threads={number}"])
        directory = RunDirectory.create(tmp_path / f"{number}")
        with runner.session(directory, config, progress) as (stopped_by, clock):
            assert set(np.geterr().values()) == {"ignore"}
            assert stopped_by == []
            clock.on_compilation()
        assert clock.cpu >= 0.0
    assert [note.partition(" ")[0] for note in notes] == ["compiling", "run.threads", "compiling"]
    assert " 7 processor" in notes[1]
    assert runner.threads_of(CONFIG.override(["run.threads=all"])) == 7
    assert runner.threads_of(CONFIG.override(["run.threads=3"])) == 3


# --- what it cost -----------------------------------------------------------------------------


def test_cost_reports_session_and_total_seconds(simulation):
    history = {"cpu_seconds": np.array([1.0, 8.0]), "wall_seconds": np.array([2.0, 9.0])}
    history["step"] = np.array([0, 20])
    found = summary.cost(simulation, history)
    assert found["session"].pop("peak_memory_bytes") > 1e6
    assert found == {
        "cpu_seconds": 8.0,
        "wall_seconds": 9.0,
        "threads": 2,
        "updates": 2000,
        "session": {
            "steps": 15,
            "updates": 1500,
            "updates_per_cpu_second": 500,  # compilation takes none of the 3 s
            "cpu_seconds": 3.0,
            "wall_seconds": 2.0,
            "compile_cpu_seconds": 1.0,
            "phases_cpu_seconds": {"rates": 0.5, "density": 0.25},
            "list_builds": 6,
        },
    }
    simulation.clock.seconds = {PLACING: 1.5}  # relaxation to a glass, which updates no particle
    assert summary.cost(simulation, history)["session"]["updates_per_cpu_second"] == 1000
    simulation.updates_here = 0
    assert summary.cost(simulation, history)["session"]["updates_per_cpu_second"] is None
    simulation.updates_here, simulation.clock.cpu = 1500, 0.0
    assert summary.cost(simulation, history)["session"]["updates_per_cpu_second"] is None


def test_peak_memory_is_in_bytes():
    # of Python with NumPy: between 20 MB and 20 GB
    assert 2e7 < summary.peak_memory() < 2e10
