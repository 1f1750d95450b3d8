"""Parts of scripts/peers.py that need no PySPH: the comparison, the grid judge, the settings."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"


@pytest.fixture(scope="module", autouse=True)
def scripts_in_reach():
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def report():
    return importlib.import_module("peers_report")


@pytest.fixture(scope="module")
def grid():
    return importlib.import_module("peers_grid")


@pytest.fixture(scope="module")
def peers():
    return importlib.import_module("peers")


def row(code, n, cpu, error, case="Tube", failure=None):
    figures = {"steps": 7, "cpu_seconds": cpu, "process_seconds": cpu + 1.0, "energy_ratio": 1.0}
    L1 = dict.fromkeys(("density", "velocity", "pressure"), error)
    return {"case": case, "code": code, "n": n, "failure": failure, "L1": L1} | figures


# error = 1/cpu: at an error of 0.2 we need 5 seconds
OURS = [row("sph", 50, 1.0, 1.0), row("sph", 100, 4.0, 0.25), row("sph", 200, 16.0, 0.0625)]


def test_cost_between_runs_follows_power_law(report):
    seconds, known = report.cost_at(OURS, 0.2, "density")
    assert (seconds, known) == (pytest.approx(5.0, rel=1e-12), "equal")
    assert report.cost_at(OURS[::-1], 0.0625, "density") == (
        pytest.approx(16.0, rel=1e-12),
        "equal",
    )


def test_cost_outside_our_runs_is_a_bound(report):
    assert report.cost_at(OURS, 2.0, "density") == (1.0, "less")
    assert report.cost_at(OURS, 0.01, "density") == (0.0, "more")


def test_ratio_is_other_code_over_ours(report):
    assert report.ratio_to(row("PySPH a", 50, 60.0, 0.2), OURS, "density")[0] == pytest.approx(12.0)
    assert report.ratio_to(row("PySPH a", 50, 60.0, 0.01), OURS, "density") == (0.0, "more")


def test_verdict_states_where_aim_is_met(report):
    theirs = [
        row("PySPH a", 60, 60.0, 0.2),
        row("PySPH a", 30, 30.0, 5.0),
        row("PySPH b", 60, 10.0, 0.2),
        row("PySPH c", 60, 99.0, 0.01),
        row("PySPH d", 60, 0.0, 0.0, failure="crashed (SIGSEGV)"),
        row("PySPH a", 60, 60.0, 0.2, case="Nothing of ours"),
    ]
    theirs[0]["L1"] = theirs[0]["L1"] | {"velocity": 0.01, "pressure": 3.0}
    said = report.verdict([*OURS, *theirs]).splitlines()
    assert said[2:6] == [
        "| Tube | PySPH a | 60 | 12 | not reached | ≥ 60 |",
        "| Tube | PySPH a | 30 | ≥ 30 | ≥ 30 | ≥ 30 |",
        "| Tube | PySPH b | 60 | 2 | 2 | 2 |",
        "| Tube | PySPH c | 60 | not reached | not reached | not reached |",
    ]
    assert said[7:] == [
        "- 10 times less CPU time at the same L1 of density: met by 2 of 4 runs of PySPH, "
        "not by Tube, PySPH b, 60; Tube, PySPH c, 60.",
        "- 10 times less CPU time at the same L1 of velocity: met by 1 of 4 runs of PySPH, "
        "not by Tube, PySPH a, 60; Tube, PySPH b, 60; Tube, PySPH c, 60.",
        "- 10 times less CPU time at the same L1 of pressure: met by 2 of 4 runs of PySPH, "
        "not by Tube, PySPH b, 60; Tube, PySPH c, 60.",
    ]


def test_verdict_without_other_code_is_missing(report):
    assert report.verdict(OURS) == ""


def test_table_line_has_figures(report):
    found = row("PySPH a", 60, 1.5, 0.2) | {"energy_ratio": 1.001}
    assert report.line(found) == (
        "| Tube | PySPH a | 60 | 7 | 1.50 | 2.5 | 0.2 | 0.2 | 0.2 | +1.0e-03 |"
    )
    broken = row("PySPH a", 60, 1.5, 0.2, failure="nonsense") | {"energy_ratio": 2600.0}
    assert "**nonsense**; energy × 2.6e+03" in report.line(broken)
    assert report.line(found).count("|") == report.line(broken).count("|") == 11


def test_table_and_picture_are_written(report, tmp_path):
    rows = [*OURS, row("PySPH a", 60, 60.0, 0.2), row("PySPH d", 9, 0.0, 0.0, failure="crashed")]
    report.write(rows, tmp_path)
    assert (tmp_path / "peers.md").read_text().count("\n| Tube") == 5 + 1  # and the ratio
    assert (tmp_path / "peers.png").read_bytes().startswith(b"\x89PNG")


# --- the grid that judges the shear layer -----------------------------------------------------


def test_grid_values_between_cells_bilinear_and_periodic(grid):
    n = 8
    x = (np.arange(n) + 0.5) / n
    field = np.add.outer(x, 3.0 * x)
    inside = np.array([[0.30, 0.5], [0.41, 0.55]])
    # linear fields are met to round-off away from the seam
    np.testing.assert_allclose(grid.at_points(field, inside), [1.53, 2.15], rtol=1e-14)
    # on the seam, halfway between the last and the first cell
    seam = grid.at_points(field, np.array([[0.0], [x[2]]]))
    assert seam[0] == pytest.approx(0.5 * (x[0] + x[-1]) + 3.0 * x[2], rel=1e-14)


def test_grid_conserves_and_keeps_uniform_flow(grid):
    state = np.ones((4, 8, 8)) * np.array([2.0, 0.3, -0.4, 1.5])[:, None, None]
    np.testing.assert_allclose(grid.solve(state, 1.4, 0.1), state, rtol=1e-13)
    state[0] += np.random.default_rng(1).random((8, 8))
    state[3] += np.random.default_rng(2).random((8, 8))
    before = grid._conserved(state, 1.4).sum(axis=(1, 2))
    after = grid._conserved(grid.solve(state, 1.4, 0.1), 1.4).sum(axis=(1, 2))
    np.testing.assert_allclose(after, before, rtol=1e-12)  # round-off of some hundred sums


@pytest.mark.parametrize("axis", [0, 1])
def test_grid_advects_density_wave_at_second_order(grid, axis):
    def error(n):
        x = (np.arange(n) + 0.5) / n
        along = x[:, None] if axis == 0 else x[None, :]
        velocity = [1.0, 0.0] if axis == 0 else [0.0, 1.0]
        fields = [2.0 + 0.2 * np.sin(2 * np.pi * along), *velocity, 10.0]
        state = np.stack([np.broadcast_to(field, (n, n)) for field in fields])
        return np.abs(grid.solve(state, 1.4, 0.25)[0] - 2.0 - 0.2 * np.sin(
            2 * np.pi * (along - 0.25))).mean()  # fmt: skip

    # van Leer's slopes are of second order but for the crests, where they are clipped
    assert error(16) / error(32) > 2.0**1.5


# --- the cases --------------------------------------------------------------------------------


def test_every_case_has_valid_configuration_for_all_sizes(peers):
    for case in peers.CASES.values():
        for n in case.sizes:
            config = peers.config_of(case, n)
            assert config.problem.n == n
        start = peers.initial_state(peers.config_of(case, case.sizes[0]))
        # the same particles go to both codes: nothing of ours but the state is in them
        assert start.density.shape == start.mass.shape == (start.position.shape[1],)
        assert max(map(max, case.schemes.values())) <= case.sizes[-1]


def test_energy_is_kinetic_and_internal(peers):
    from types import SimpleNamespace

    state = SimpleNamespace(
        mass=np.array([1.0, 2.0]),
        velocity=np.array([[3.0, 0.0], [4.0, 1.0]]),
        internal_energy=np.array([0.5, 2.0]),
    )
    assert peers.energy(state) == 0.5 * 25.0 + 0.5 + 1.0 + 4.0


def test_timed_reports_how_process_ended(peers, monkeypatch):
    python = sys.executable
    assert peers.timed([python, "-c", "pass"])[1] is None
    assert peers.timed([python, "-c", "raise SystemExit('no such thing')"])[1] == "no such thing"
    killed = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    assert peers.timed([python, "-c", killed])[1] == "crashed (SIGSEGV)"
    monkeypatch.setattr(peers, "PATIENCE", 0.1)
    assert "not ended" in peers.timed([python, "-c", "import time; time.sleep(9)"])[1]


def test_missing_pysph_exits_with_suggestion(peers):
    with pytest.raises(SystemExit, match=r"has no PySPH\. Try: pip install"):
        peers.require_pysph("/no/such/python")
