"""A restart begins only where all that it continues or replaces is of the same run."""

import dataclasses

import h5py
import numpy as np
import pytest
from columns import as_columns

from sph.columns import shared as columns
from sph.errors import FileError
from sph.output import checkpoint, files
from sph.output.history import History
from sph.output.run_directory import RunDirectory


def at_step(state, step, **changes):
    changes = {"step": step, "time": 0.25 * step, "lineage": ()} | changes
    return dataclasses.replace(state, **changes)


def row(state):
    p = state.particles
    shared = dict.fromkeys(columns(p.dimension), 1.0) | {"limiter": "energy"}
    return shared | {
        "step": state.step,
        "t": state.time,
        "kinetic_energy": float(np.sum(0.5 * (p.mass * (p.velocity**2).sum(axis=0)))),
        "internal_energy": float(np.sum(p.mass * p.internal_energy)),
    }


@pytest.fixture
def state(make_state):
    return make_state(dimension=1)


@pytest.fixture
def run(tmp_path, state):
    """A run of steps 0 to 6, with a checkpoint every second."""
    run = RunDirectory.create(tmp_path / "run")
    run.write_config(state.config.to_toml())
    history = History.create(run.history, 1, state.config.problem.diagnostics(state.particles))
    for step in range(7):
        history.extend(as_columns(row(at_step(state, step))))
        if step % 2 == 0:
            checkpoint.write(run.checkpoint_path(step // 2), at_step(state, step))
    history.close()
    return run


def check(run, number=2, into=None):
    path = run.checkpoint_path(number)
    run.check_belongs(path, checkpoint.read(path), into)


@pytest.fixture
def refused(messages):
    """refused(run, *facts): the run is not consistent, and the error has these facts."""

    def checked(run, *facts, **settings):
        # sums over particles, whose last digits vary by processor
        sums = r"(?<=but )\d+\.\d{6,}"
        with messages.raised(FileError, *facts, "\nTry: ", mask=sums) as caught:
            check(run, **settings)
        assert caught.value.exit_code == 4

    return checked


def lines(run, change):
    """Rewrite the lines of the history, the header first."""
    text = run.history.read_text().splitlines(keepends=True)
    run.history.write_text("".join(change(text)))


def with_value(run, step, column, value):
    def change(text):
        names, values = text[0].rstrip().split(","), text[step + 1].rstrip().split(",")
        values[names.index(column)] = value
        text[step + 1] = ",".join(values) + "\n"
        return text

    lines(run, change)


def test_unchanged_run_is_consistent(run):
    for number in range(4):
        check(run, number)


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda text: text[:3] + text[4:], "step 2"),
        (lambda text: text[:-2], None),
        (lambda text: text[:5], "step 4"),
        (lambda text: text[:1], "step 4"),
        (lambda text: [*text[:4], text[3], *text[4:]], "step 3"),
        (lambda text: ["step,t\n"], " dt"),
        (lambda text: [text[0].replace("energy_drift,", "drift,"), *text[1:]], " energy_drift"),
        (lambda text: [text[0].replace("cpu_seconds\n", "cpu_seconds,strange\n"),
                       *(one[:-1] + ",1.0\n" for one in text[1:])], " strange"),
    ],
    ids=["gap", "last row missing", "checkpoint's row missing", "no rows", "row twice",
         "two columns", "column renamed", "column added"],
)  # fmt: skip
def test_history_with_gap_or_other_columns_is_refused(refused, run, change, fact):
    lines(run, change)
    if fact is None:  # what comes after the checkpoint is done anew
        check(run)
    else:
        refused(run, fact)


@pytest.mark.parametrize(
    ("step", "column", "value"),
    [
        (0, "energy_drift", "nan"),
        (0, "kinetic_energy_without_bulk", "inf"),
        (3, "cpu_seconds", "nan"),
        (4, "t", "1.0000000000000002e0"),
        (4, "internal_energy", "1.0"),
        (4, "kinetic_energy", "1.0"),
    ],
)
def test_history_of_other_values_is_refused(refused, run, step, column, value):
    if column == "t":
        value = "1.00001"
    with_value(run, step, column, value)
    refused(run, f"{column} = {float(value)}", f"step {step}")


def test_missing_history_is_refused(refused, run):
    run.history.unlink()
    refused(run, "history")
    check(run, 0)  # as a copied checkpoint that was not gone on from yet


def test_configuration_of_other_problem_is_refused(refused, run, make_state):
    run.write_config(make_state(dimension=2).config.to_toml())
    refused(run, "config.toml", "problem.dimension", "problem.domain")


@pytest.mark.parametrize("number", [1, 3])  # the one before the checkpoint and the one after
@pytest.mark.parametrize("what", ["dimension", "alpha", "step", "time", "lineage", "particles"])
def test_checkpoint_of_other_run_is_refused(refused, run, state, make_state, number, what):
    step = 2 * number
    others = {
        "dimension": at_step(make_state(dimension=2), step),
        "alpha": at_step(state, step, config=state.config.override(["physics.alpha=3.0"])),
        "step": at_step(state, 4, time=0.25 * step),
        "time": at_step(state, step, time=1.0),
        "lineage": at_step(state, step, lineage=("another run", "and more")[: 5 - step]),
        "particles": at_step(make_state(dimension=1, number=49), step),
    }
    if what == "lineage" and number == 3:
        checkpoint.write(run.checkpoint_path(2), at_step(state, 4, lineage=("ours",)))
    checkpoint.write(run.checkpoint_path(number), others[what])
    facts = {"dimension": "problem.dimension", "alpha": "alpha = 3.0", "lineage": "lineage",
             "particles": "particle"}  # fmt: skip
    refused(run, facts.get(what, "step"))


def test_other_settings_accepted_only_with_lineage(run, state):
    later = at_step(
        state, 6, lineage=("restarted",), config=state.config.override(["physics.alpha=3.0"])
    )
    checkpoint.write(run.checkpoint_path(3), later)
    check(run)


def test_newer_format_is_refused_not_skipped(refused, messages, run):
    with h5py.File(run.checkpoint_path(3), "r+") as file:
        file["Checkpoint"].attrs["format_version"] = 1000
    with messages.raised(FileError, "(1000)"):
        run.latest()
    refused(run, "(1000)")
    check(run, into=run.path.parent / "elsewhere")  # where nothing is replaced
    refused(run, "(1000)", into=run.path / "." / "")


def test_damaged_files_are_skipped(run):
    for number in (1, 3):
        run.checkpoint_path(number).write_bytes(b"damaged")
    check(run)
    assert run.latest() == run.checkpoint_path(2)


def test_unreadable_checkpoint_is_refused_not_skipped(messages, run, monkeypatch):
    last = run.checkpoint_path(3)
    last.unlink()
    last.symlink_to(run.path)  # reading a directory fails, whoever reads
    with messages.raised(FileError) as caught:
        run.latest()
    assert not isinstance(caught.value, files.Damaged)
