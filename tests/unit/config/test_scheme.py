"""Schemes as the configuration takes them."""

import tomllib

import pytest

from sph import config, eos, registry
from sph.config.physics import model_folders
from sph.errors import ConfigError
from sph.parts.external import External
from sph.scene import Scene

LIQUID = """
from typing import NamedTuple
from sph.eos import Defaults
from sph.model import model

@model(Defaults)
class LiquidOfATest(NamedTuple):
    stiffness: float

    def pressure(self, density, internal_energy):
        return self.stiffness * (density - 1.0)

    def sound_speed(self, density, pressure):
        return self.stiffness**0.5

    def internal_energy(self, density, pressure):
        return 0.0 * density
"""


def physics(scheme, gas):
    return config.from_text(
        f'[problem]\nname = "uniform"\n[physics]\nscheme = "{scheme}"\n{gas}\n', "a test"
    ).physics


@pytest.mark.parametrize("folder", ["sph.kernels", "sph.eos", *model_folders()])
def test_file_in_folder_of_models_is_model(folder):
    for name in registry.names(folder):
        assert registry.model_class(folder, name).name == name


def test_model_without_base_of_folder_is_refused(messages, tmp_path, monkeypatch):
    (tmp_path / "plain.py").write_text(
        LIQUID.replace("@model(Defaults)", "").replace("Liquid", "P")
    )
    monkeypatch.setattr(eos, "__path__", [*eos.__path__, str(tmp_path)])
    with messages.raised(TypeError, "sph.eos.plain", "POfATest"):
        physics("grad_h", 'eos = { name = "plain", stiffness = 2.0 }')


def test_pressure_energy_with_other_gas_is_refused(messages, tmp_path, monkeypatch):
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
        with messages.raised(ConfigError):
            physics("pressure_energy", other)


@pytest.mark.parametrize(
    "problem",
    ["sound_wave", "gresho", "yee", "noh", "point_explosion", "expanding_ball", "polytrope"],
)
def test_problem_for_ideal_gas_with_other_gas_is_refused(messages, problem):
    def read(p_inf):
        gas = f'{{ name = "stiffened_gas", gamma = 1.4, p_inf = {p_inf} }}'
        return config.from_text(f'[problem]\nname = "{problem}"\n[physics]\neos = {gas}\n', "a")

    with messages.raised(ConfigError, "line 4: physics.eos", problem):
        read(1.0)
    assert read(0.0).physics.eos_model().gamma == 1.4


@pytest.mark.parametrize("gas", ["gamma = 7.0", 'eos = { name = "ideal_gas", gamma = 7.5 }'])
def test_point_explosion_gamma_at_least_7_in_3d_is_refused(messages, gas):
    """Its solution ends at gamma = 7 in 3-D, and a run would end in that error."""

    def read(dimension, gas):
        head = f'[problem]\nname = "point_explosion"\ndimension = {dimension}\n[physics]\n'
        return config.from_text(head + gas, "a").physics

    with messages.raised(ConfigError, "line 5"):
        read(3, gas)
    assert read(2, gas).eos_model().gamma >= 7.0
    assert read(3, "gamma = 6.9").gamma == 6.9


MASS = 'external = { name = "point_mass", mass = 1.0 }'


@pytest.mark.parametrize(
    ("boundary", "is_wrong"),
    [
        ('"periodic"', True),
        ('["mirror", "periodic"]', True),
        ('["mirror", "open"]', False),
        ('"mirror"', False),
        ('"open"', False),
    ],
)
def test_point_mass_in_periodic_box_is_refused(messages, boundary, is_wrong):
    text = f'[problem]\nname = "uniform"\nboundary = {boundary}\n[physics]\n{MASS}\n'
    if not is_wrong:
        (field,) = (p.field for p in Scene(config.from_text(text)).parts if isinstance(p, External))
        assert field.mass == 1.0
        return
    with messages.raised(ConfigError, "line 5: physics.external", "Try: "):
        config.from_text(text, "a")


@pytest.mark.parametrize(
    ("boundary", "g"),
    [
        ('"periodic"', "[0.0, 1.0]"),
        ('["periodic", "mirror"]', "[1e-3, 1.0]"),
        ('"mirror"', "[1.0]"),
        ('"mirror"', "[]"),
        ('"mirror"', "[0.0, 0.0, 1.0]"),
        ('"mirror"', "1.0"),
        ('"mirror"', '[0.0, "1.0"]'),
        ('"mirror"', "[0.0, inf]"),
    ],
)
def test_uniform_field_of_wrong_length_or_along_periodic_axis_is_refused(messages, boundary, g):
    field = f'external = {{ name = "uniform", g = {g} }}'
    text = f'[problem]\nname = "uniform"\ndimension = 2\nboundary = {boundary}\n[physics]\n'
    with messages.raised(ConfigError, "line 6: physics.external", "g"):
        config.from_text(text + field, "a")


@pytest.mark.parametrize(
    ("boundary", "g"),
    [('["periodic", "mirror"]', "[0, -1]"), ('"periodic"', "[0.0, 0.0]"), ('"open"', "[1.0, 2.0]")],
)
def test_uniform_field_across_periodic_axes_is_accepted(boundary, g):
    field = f'external = {{ name = "uniform", g = {g} }}'
    text = f'[problem]\nname = "uniform"\ndimension = 2\nboundary = {boundary}\n[physics]\n{field}'
    (found,) = (p.field for p in Scene(config.from_text(text)).parts if isinstance(p, External))
    assert found.g == tuple(tomllib.loads(f"g = {g}")["g"])


@pytest.mark.parametrize(
    ("conductivity", "is_wrong"),
    [
        ('conductivity = "pressure_jump"', True),
        ('conductivity = { name = "pressure_jump", switched = true }', True),
        ('conductivity = "approach"', False),
    ],
)
def test_conductivity_active_in_equilibrium_with_external_field_is_refused(
    messages, conductivity, is_wrong
):
    text = f'[problem]\nname = "uniform"\nboundary = "open"\n[physics]\n{conductivity}\n'
    assert config.from_text(text).physics.conductivity is not None
    if not is_wrong:
        assert config.from_text(text + MASS).physics.external is not None
        return
    with messages.raised(ConfigError, "line 5: physics.conductivity", "physics.external", "Try: "):
        config.from_text(text + MASS, "a")
