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
    stiffened = 'eos = { name = "stiffened_gas", gamma = 4.4, p_inf = 1.0 }'
    assert physics("variational", stiffened).eos_model().p_inf == 1
    for other in (liquid, stiffened):
        with pytest.raises(ConfigError, match=r'"pressure_energy": expected an .*, not \{ name'):
            physics("pressure_energy", other)


@pytest.mark.parametrize(
    "problem", ["sound_wave", "gresho", "yee", "noh", "point_explosion", "expanding_ball"]
)
def test_problems_solved_for_an_ideal_gas_refuse_another(problem):
    def read(p_inf):
        gas = f'{{ name = "stiffened_gas", gamma = 1.4, p_inf = {p_inf} }}'
        return config.from_text(f'[problem]\nname = "{problem}"\n[physics]\neos = {gas}\n', "a")

    with pytest.raises(ConfigError, match=rf"line 4: physics.eos = .* an ideal gas for {problem}"):
        read(1.0)
    assert read(0.0).physics.eos_model().gamma == 1.4
