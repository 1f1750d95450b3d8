"""What a user adds from outside the package: a folder `sph_extensions` on the Python path.

tests/extensions/sph_extensions has a kernel, an equation of state, a viscosity switch, a pair
force, a part with its own evolved field, energy, step bound and key, and a formulation.
"""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sph import eos
from sph.exact import riemann

ROOT = Path(__file__).parents[2]
EXTENSIONS = ROOT / "tests" / "extensions" / "sph_extensions"

ADDED_TO_GAS = """
kernel = "lucy"
eos = { name = "noble_abel", gamma = 1.4, b = 0.05 }
alpha = { min = 0.1, max = 1.5, switch = "patient", patience = 6.0 }
scheme = "geometric"
tether = 4.0
"""
# What a run of these files, and its restart from the middle, leave behind, as numbers.
COMPARED = """
import sys
from sph.output import checkpoint
one, other = (checkpoint.read(path) for path in sys.argv[1:])
a, b = one.particles.arrays(), other.particles.arrays()
assert a.keys() == b.keys()
assert all(a[name].tobytes() == b[name].tobytes() for name in a)
assert one.budget == other.budget
print(" ".join(sorted(a)))
"""

pytestmark = pytest.mark.slow  # each scene compiles anew, in processes of their own


@pytest.fixture
def sph(tmp_path):
    """Run a command of `python -m` where the extensions are on the path; returns its output."""
    shutil.copytree(EXTENSIONS, tmp_path / "path" / "sph_extensions")
    path = os.pathsep.join([str(ROOT), str(tmp_path / "path")])
    environment = {**os.environ, "PYTHONPATH": path, "MPLBACKEND": "Agg"}

    def run(*arguments, expected=0):
        done = subprocess.run(
            [sys.executable, *map(str, arguments)],
            capture_output=True, text=True, cwd=tmp_path, env=environment, timeout=300,
        )  # fmt: skip
        assert done.returncode == expected, done.stderr
        return done.stdout + done.stderr

    return run


def configured(path, physics):
    path.write_text(
        f'[problem]\nname = "shock_tube"\nn = 200\n[physics]\n{physics}\n'
        "[time]\nend = 0.1\n[output]\ninterval = 0.025\n"
    )
    return path


def run_and_restart(sph, tmp_path, physics):
    """Run, restart from the middle, plot. Returns the history's columns and the stored fields."""
    file = configured(tmp_path / "scene.toml", physics)
    run, again = tmp_path / "run", tmp_path / "again"
    sph("-m", "sph", "run", file, "-o", run)
    sph("-m", "sph", "restart", run / "checkpoints" / "checkpoint_000002.h5", "-o", again)
    last = [place / "checkpoints" / "checkpoint_000004.h5" for place in (run, again)]
    fields = sph("-c", COMPARED, *last).split()
    sph("-m", "sph", "plot", run)
    assert len(list((run / "figures").glob("*.png"))) == 3
    rows = list(csv.DictReader((run / "history.csv").open()))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}, fields


def test_added_models_and_part_run_restart_and_plot(sph, tmp_path):
    history, fields = run_and_restart(sph, tmp_path, ADDED_TO_GAS)
    assert {"anchor", "path", "path_rate", "alpha", "alpha_rate"} <= set(fields)
    energy = history["tether_energy"].astype(float)
    assert energy[0] == 0.0
    # the part's energy belongs to the total: without it the drift would be 5.1e-4 / 1.3
    assert energy[-1] > 5e-4
    assert np.abs(history["energy_drift"].astype(float)).max() < 1e-4
    path = history["longest_path"].astype(float)
    assert np.all(np.diff(path) > 0.0)
    # gas behind the rarefaction moves at up to 0.93 c for half of the time at least
    assert 0.02 < path[-1] < 0.1


def test_added_part_limits_step(sph, tmp_path):
    file = configured(tmp_path / "stiff.toml", "tether = 1e6")
    told = sph("-m", "sph", "run", file, "-o", tmp_path / "run", "--set", "time.end=0.001")
    rows = list(csv.DictReader((tmp_path / "run" / "history.csv").open()))
    assert {row["limiter"] for row in rows[1:-1]} == {"tether"}
    assert all(float(row["dt"]) == 0.05 / 1e3 for row in rows[1:-1])
    assert "done" in told


def test_added_part_refuses_unsupported_settings(sph, tmp_path):
    file = configured(tmp_path / "scene.toml", "tether = 1.0")
    told = sph(
        "-m", "sph", "run", file, "-o", tmp_path / "run", "--set", "problem.boundary=periodic",
        expected=2,
    )  # fmt: skip
    assert "line 5: physics.tether = 1.0: a particle that crosses a periodic face" in told
    told = sph("-m", "sph", "run", file, "--set", "physics.tether=-1.0", expected=2)
    assert "physics.tether = -1.0: expected a number greater than 0" in told


def test_added_choices_are_listed(sph):
    told = sph("-m", "sph", "list")
    for name in ("lucy", "noble_abel", "patient", "geometric", "tether", "plain"):
        assert f"  {name}" in told


def test_added_formulation_runs_restarts_and_plots(sph, tmp_path):
    _, fields = run_and_restart(sph, tmp_path, 'formulation = "plain"')
    assert "alpha" not in fields
    compared = sph(
        "-c",
        "import sys, numpy as np; from sph.output import checkpoint as c; "
        "p = c.read(sys.argv[1]).particles.by_id(); np.save(sys.argv[2], [*p.position, p.density])",
        tmp_path / "run" / "checkpoints" / "checkpoint_000004.h5",
        tmp_path / "found.npy",
    )
    assert compared == ""
    x, found = np.load(tmp_path / "found.npy")
    left, right = riemann.State(1.0, 0.0, 1.0), riemann.State(0.125, 0.0, 0.1)
    exact, _, _ = riemann.solve(left, right, eos.make("ideal_gas", gamma=1.4), x / 0.1)
    # supports of fixed size smear the thin side: .020 at this resolution, where gas at rest has .08
    assert np.abs(found - exact).mean() < 0.022


def test_model_with_existing_name_is_refused(sph, tmp_path):
    twin = tmp_path / "path" / "sph_extensions" / "kernels" / "twin.py"
    twin.write_text((ROOT / "sph" / "kernels" / "wendland_c4.py").read_text())
    told = sph(
        "-c",
        "from sph import registry\n"
        "registry.model_class('sph.kernels', 'wendland_c4')\n"
        "try:\n    registry.model_class('sph.kernels', 'twin')\n"
        "except TypeError as error:\n    print(error)",
    )
    assert "both define a model WendlandC4" in told


def test_edited_extension_is_recompiled(sph, tmp_path):
    """Code on disk is named by the sources of extensions too: stale code would be silent."""
    program = (
        "from sph import registry, fingerprint; print(fingerprint.key()); "
        "print(registry.model_class('sph.kernels', 'lucy')().normalisation((0,)))"
    )
    before, _ = sph("-c", program).split()
    lucy = tmp_path / "path" / "sph_extensions" / "kernels" / "lucy.py"
    lucy.write_text(lucy.read_text().replace("return 5 / 4", "return 6 / 4"))
    after, value = sph("-c", program).split()
    assert (before != after, float(value)) == (True, 1.5)
