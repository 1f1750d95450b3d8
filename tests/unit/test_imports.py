"""Which packages a module may import at run time: what is slow to import waits until it is needed.

`lint-imports` checks imports between the modules of sph; these rules concern other packages. One
interpreter checks all rules, because each start of an interpreter that imports Numba takes seconds.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import sph

ROOT = Path(sph.__file__).parents[1]
# Prints, for each rule, the packages that were imported against the rule.
PROGRAM = """
import importlib, json, sys
from click.testing import CliRunner
import sph

found = {}

def imported(*packages):
    return [name for name in packages if name in sys.modules]

def forget(*packages):
    for name in [name for name in sys.modules if name.partition(".")[0] in packages]:
        del sys.modules[name]

from sph.cli import main
assert CliRunner().invoke(main, ["--version"]).exit_code == 0
found["sph --version"] = imported("numba")

import sph.cli_studies
found["the commands over many runs"] = imported(
    "matplotlib", "h5py", "pydantic", "distributed", "submitit"
)

forget("sph", "click")
import numba, pydantic, sph  # Numba, which compiles the models, looks for SciPy when imported
from sph import registry
before = set(sys.modules)
for name in registry.names("sph.problems"):
    importlib.import_module(f"sph.problems.{name}")
    new = {module.partition(".")[0] for module in set(sys.modules) - before}
    found[f"problem {name}"] = sorted(new & {"scipy", "h5py", "matplotlib", "click"})
    before = set(sys.modules)

import numpy as np
from sph.problems.support import lattice
lattice.fill(np.array([[0.0, 1.0]]), 10, "cubic")
import sph.runner
found["a lattice that is no glass, and a run"] = imported("scipy.spatial")

print(json.dumps(found))
"""


def test_modules_import_heavy_packages_only_when_needed():
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert len(found) > 3  # the problems are among the rules
    assert {rule: packages for rule, packages in found.items() if packages} == {}


RUN = """
import sys
from sph.cli import main

main(["run", "tube.toml", "-o", "run", "--force"], standalone_mode=False)
compilers = {"numba.np.arraymath", "numba.np.linalg", "scipy.linalg"}
print(sorted((compilers | {"scipy.spatial", "matplotlib"}) & set(sys.modules)))
"""


@pytest.mark.slow
def test_run_of_compiled_scene_imports_nothing_that_compiles(tmp_path):
    (tmp_path / "tube.toml").write_text(
        '[problem]\nname = "shock_tube"\nn = 50\n[time]\nend = 0.1\n[output]\ninterval = 0.1\n'
    )
    for _ in range(2):  # the first run compiles, unless another test has
        done = subprocess.run(
            [sys.executable, "-c", RUN], cwd=tmp_path, capture_output=True, text=True, timeout=120,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"
