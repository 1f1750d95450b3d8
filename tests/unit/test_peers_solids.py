"""Parts of scripts/peers_solids.py that need no PySPH: settings, particles, figures, table."""

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"


@pytest.fixture(scope="module")
def peers():
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("peers_solids")
    sys.path.remove(str(SCRIPTS))


@pytest.fixture
def plate(peers):
    case = peers.CASES["plate"]
    config = peers.config_of(case, case.sizes[0])
    return case, config, peers.initial_state(config)


def frames_of(start, displacements):
    """A result of PySPH: the plate moves up by each of these, the jaws stay."""
    moving = start.held == 0.0
    x, y = start.position[:, moving]
    rows = len(displacements)
    return {
        "x": np.tile(x, (rows, 1)),
        "y": y + np.array(displacements)[:, None],
        "u": np.zeros((rows, x.size)),
        "v": np.ones((rows, x.size)),
        "held": ~moving,
    }


def test_every_case_has_valid_configuration_for_all_sizes_and_settings(peers):
    for case in peers.CASES.values():
        for overrides in case.settings.values():
            for n in case.sizes:
                found = peers.config_of(case, n, overrides)
                assert found.problem.n == n
                assert found.physics.formulation == "continuum"


def test_job_has_particles_material_and_step_of_example(peers, plate, tmp_path):
    case, config, start = plate
    job = peers.job_of(case, config, start, tmp_path / "pysph_290", share=0.5)
    given = np.load(job["particles"])
    np.testing.assert_array_equal(given["x"], start.position[0])
    np.testing.assert_array_equal(given["v"], start.velocity[1])
    # the jaws are the particles whose velocity is zero, of the length that they hold
    assert 0 < given["held"].sum() < given["held"].size
    assert np.all(given["x"][given["held"] > 0] < 0)
    # the example's material (E = 2e6, nu = 0.3975), to the digits of our configuration
    assert job["youngs"] == pytest.approx(2e6, rel=1e-9)
    assert job["poisson"] == pytest.approx(0.3975, rel=1e-9)
    # and its step at its spacing
    assert job["step"] / job["spacing"] == pytest.approx(1e-5 / 0.002)
    assert job["end"] == 0.5 * config.time.end
    json.dumps(job)


def test_period_of_frames_is_that_of_the_plate(peers, plate):
    """Frames of a plate that goes up and down at a known period are judged by the same fit."""
    case, config, start = plate
    times, period = np.linspace(0.0, 0.5, 100), 0.27
    found = frames_of(start, 0.01 * np.sin(2 * np.pi * times / period))
    states = [peers.state_of(case, start, found, k) for k in range(times.size)]
    held = start.held > 0
    np.testing.assert_array_equal(states[7].position[:, held], start.position[:, held])
    assert np.all(states[7].velocity[1, ~held] == 1.0)
    rows = [config.problem.diagnostics(one) for one in states]
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]} | {"t": times}
    figures = peers.figures(config, columns, states[0])
    assert figures["period"] == pytest.approx(period, rel=1e-4)  # of the fit
    assert figures["pieces"] == 1


def test_pieces_counts_a_plate_torn_apart(peers, plate):
    case, _, start = plate
    found = frames_of(start, [0.0])
    found["x"][0, found["x"][0] > 0.1] += 0.1
    state = peers.state_of(case, start, found, 0)
    config = plate[1]
    assert peers.figures(config, {"t": np.zeros(1), "tip_displacement": np.zeros(1)}, state) == {
        "pieces": 2
    }


def test_table_has_a_line_for_results_and_failures(peers, tmp_path):
    case = peers.CASES["rings"]
    ended = {"number": 1104, "steps": 7, "cpu_seconds": 1.25, "process_seconds": 2.0}
    rows = [
        peers.row(case, "sph", 1100, ended | {"figures": {"restitution": 0.51, "pieces": 2}}),
        peers.row(case, "PySPH", 1100, {"failure": "crashed (SIGSEGV)"}),
    ]
    peers.write(rows, tmp_path)
    lines = (tmp_path / "solids.md").read_text().splitlines()
    assert lines[2] == "| Rubber rings | sph | 1104 | 7 | 1.2 | 2.0 | restitution 0.51, pieces 2 |"
    assert lines[3] == "| Rubber rings | PySPH | 1100 | **crashed (SIGSEGV)** | | | |"
    assert len({line.count("|") for line in lines}) == 1
    assert len(json.loads((tmp_path / "solids.json").read_text())) == 2


def test_every_size_of_every_setting_runs_after_a_short_run_that_compiles(
    peers, tmp_path, monkeypatch, capsys
):
    calls = []

    def run(case, n, *rest, share=1.0, **_):
        calls.append((n, share))
        return {"number": n, "steps": 1, "cpu_seconds": 1.0, "process_seconds": 2.0, "figures": {}}

    monkeypatch.setattr(peers, "own_run", run)
    monkeypatch.setattr(peers, "pysph_run", run)
    monkeypatch.setattr(peers, "require_pysph", lambda python: None)
    monkeypatch.setattr(sys, "argv", ["peers_solids.py", "--only", "rings", "-o", str(tmp_path)])
    peers.main()
    case = peers.CASES["rings"]
    sizes = [(case.sizes[0], peers.SHORT), *((n, 1.0) for n in case.sizes)]
    assert calls == sizes * (len(case.settings) + 1)
    table = (tmp_path / "solids.md").read_text().splitlines()[2:]
    assert capsys.readouterr().out.splitlines()[: len(table)] == table
