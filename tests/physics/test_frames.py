"""Verdicts on a run may not depend on how fast its gas moves as a whole."""

import importlib.util
from pathlib import Path

import pytest
from marks import slow_except
from outcome import CONFIGS

SCRIPT = Path(__file__).parents[2] / "scripts" / "frames.py"


@pytest.fixture(scope="module")
def frames():
    spec = importlib.util.spec_from_file_location("frames", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "stem", slow_except({0}, ["shock_tube", "kelvin_helmholtz_smooth", "gresho", "yee"])
)
def test_verdict_with_bulk_velocity_unchanged(frames, capsys, stem):
    """From sound to unstable steps; `python scripts/frames.py` does it for all shipped scenes."""
    assert frames.verdicts(CONFIGS / f"{stem}.toml", steps=20) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(frames.COURANT)
