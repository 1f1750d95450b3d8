"""Schemes as the configuration takes them."""

import pytest

from sph import config, eos
from sph.errors import ConfigError

LIQUID = """
from typing import NamedTuple

class LiquidOfATest(NamedTuple):
    stiffness: float

    def pressure(self, density, internal_energy):
        return self.stiffness * (density - 1.0)
"""


def physics(scheme, gas):
    return config.from_text(
        f'[problem]\nname = "uniform"\n[physics]\nscheme = "{scheme}"\n{gas}\n', "a test"
    ).physics


def test_pressure_energy_takes_an_ideal_gas_alone(tmp_path, monkeypatch):
    (tmp_path / "liquid.py").write_text(LIQUID)
    monkeypatch.setattr(eos, "__path__", [*eos.__path__, str(tmp_path)])
    liquid, gas = (
        'eos = { name = "liquid", stiffness = 2.0 }',
        'eos = { name = "ideal_gas", gamma = 1.5 }',
    )
    assert physics("grad_h", liquid).eos_model().stiffness == 2
    assert physics("pressure_energy", gas).eos_model().gamma == 1.5
    assert physics("pressure_energy", "gamma = 1.5").scheme == "pressure_energy"
    with pytest.raises(ConfigError, match=r'physics.scheme = "pressure_energy": expected an ideal'):
        physics("pressure_energy", liquid)
