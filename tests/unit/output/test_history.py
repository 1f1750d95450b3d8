import timeit

import numpy as np
import pytest
from columns import as_columns

from sph.columns import shared as columns
from sph.errors import FileError
from sph.output.history import History, read


def row(history, step):
    """Numbers with all their digits, of the types that a simulation has at hand."""
    random = np.random.default_rng(step)
    numbers = {name: random.normal() for name in history.columns}
    numbers["min_density"] = np.float64(1) / 3
    return numbers | {"step": step, "limiter_particle": np.int64(7), "limiter": "signal_speed"}


@pytest.fixture
def history(tmp_path):
    history = History.create(tmp_path / "history.csv", 2, ["mode_amplitude"])
    yield history
    history.close()


def append(history, steps):
    for step in steps:
        history.extend(as_columns(row(history, step)))


def test_columns_by_dimension():
    expected = "step t dt limiter_particle limiter kinetic_energy "
    expected += "kinetic_energy_without_bulk internal_energy total_energy energy_drift "
    expected += "energy_injected momentum_x momentum_y min_density max_density min_internal_energy "
    expected += "max_internal_energy wall_seconds cpu_seconds"
    assert columns(2) == expected.split()
    assert [name for name in columns(3) if name not in columns(1)] == ["momentum_y", "momentum_z"]


def test_numbers_read_back_bit_for_bit(history):
    append(history, range(20))
    history.flush()
    found = read(history.path)
    assert list(found) == [*columns(2), "mode_amplitude"]
    rows = [row(history, step) for step in range(20)]
    for name, array in found.items():
        if name == "limiter":
            assert array.dtype == object
        else:
            assert array.dtype == np.float64
        assert array.tolist() == [each[name] for each in rows], name


def test_non_finite_numbers_and_text_with_comma_read_back(history):
    values = {"t": np.nan, "dt": np.float64("inf"), "limiter": 'energy, "cold"'}
    history.extend(as_columns(row(history, 0) | values))
    history.flush()
    found = read(history.path)
    assert np.isnan(found["t"][0])
    assert found["dt"][0] == np.inf
    assert found["limiter"][0] == 'energy, "cold"'


def test_read_history_without_steps_is_empty(history):
    assert {array.size for array in read(history.path).values()} == {0}


def test_disk_has_whole_lines_only(history):
    append(history, range(3))
    assert history.path.read_text().count("\n") == 1
    history.flush()
    append(history, [3])
    text = history.path.read_text()
    assert text.endswith("\n")
    assert text.count("\n") == 1 + 3


def test_append_row_missing_column_is_refused(history):
    incomplete = row(history, 0)
    del incomplete["mode_amplitude"]
    with pytest.raises(KeyError, match="mode_amplitude"):
        history.extend(as_columns(incomplete))


def test_resume_keeps_rows_up_to_step_and_appends(history):
    append(history, range(10))
    history.flush()
    whole = history.path.read_bytes()
    resumed = History.resume(history.path, 4)
    assert read(history.path)["step"].tolist() == [0, 1, 2, 3, 4]
    append(resumed, range(5, 10))
    resumed.close()
    assert history.path.read_bytes() == whole


def test_truncated_last_line_is_ignored_and_overwritten(history):
    append(history, range(10))
    history.flush()
    whole = history.path.read_bytes()
    history.path.write_bytes(whole[:-30])
    assert read(history.path)["step"].tolist() == list(range(9))
    resumed = History.resume(history.path, 9)
    append(resumed, [9])
    resumed.close()
    assert history.path.read_bytes() == whole


@pytest.mark.parametrize(
    ("content", "fact"),
    [
        (None, ""),
        (b"", ""),
        (b"x,y\n1,2\n", ""),
        (b"step,t\n1,2\n3\n", "line 3"),
        (b"step,t\n1,two\n", "line 2"),
        (b"\xff\xfe\n", ""),
    ],
    ids=["missing", "empty", "other columns", "short row", "word for number", "not text"],
)
def test_read_invalid_history_is_refused(messages, tmp_path, content, fact):
    path = tmp_path / "history.csv"
    if content is not None:
        path.write_bytes(content)
    for use in (read, lambda path: History.resume(path, 0)):
        with messages.raised(FileError, path, fact):
            use(path)
    assert content is None or path.read_bytes() == content


def test_create_in_unwritable_directory_is_refused(messages, tmp_path):
    (tmp_path / "run").touch()
    with messages.raised(FileError):
        History.create(tmp_path / "run" / "history.csv", 1)


def test_rows_at_once_are_written_as_one_after_another(history):
    rows = [row(history, step) | {"limiter": f"no, {step}"} for step in range(3)]
    for one in rows:
        history.extend(as_columns(one))
    history.flush()
    header, *lines = history.path.read_text().splitlines()
    history.extend({name: [one[name] for one in rows] for name in rows[0]})
    history.flush()
    assert history.path.read_text().splitlines() == [header, *lines, *lines]


def test_append_row_costs_little(history):
    numbers = row(history, 0)
    seconds = (
        min(timeit.repeat(lambda: history.extend(as_columns(numbers)), number=200, repeat=20)) / 200
    )
    # measured: 10 microseconds; a step of the smallest runs is of some hundred, and a machine
    # may be three times slower
    assert seconds < 30e-6


def test_rows_are_synced_before_checkpoint(history, monkeypatch):
    synced = []
    monkeypatch.setattr("sph.output.history.os.fsync", synced.append)
    append(history, range(3))
    history.flush()
    assert synced == [history._descriptor]
    assert read(history.path)["step"].tolist() == [0, 1, 2]


def test_append_to_replaced_history_is_refused(messages, history):
    append(history, range(2))
    history.path.rename(history.path.with_name("moved"))
    history.path.write_text("of another run")
    with messages.raised(FileError):
        history.flush()
    assert history.path.read_text() == "of another run"
    history._lines.truncate(0)  # for the end of the test, which closes


@pytest.mark.parametrize("header", ["step,t", "step,t,t", "t,step"])
def test_read_truncated_header_is_refused(messages, tmp_path, header):
    path = tmp_path / "history.csv"
    path.write_text(f"{header}\n")
    with messages.raised(FileError):
        read(path)
