"""The check of the state names the particle where NaNs began, and why."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph import eos
from sph.errors import NumericalError
from sph.formulations.continuum.soundness import check

STEEL = eos.make("mie_gruneisen", rho_0=7850.0, c_0=3600.0, slope=1.8, gruneisen=1.81)
WATER = eos.make("tait", rho_0=1000.0, c_0=1500.0)


def particles(**fields):
    """Three particles at rest, with these fields."""
    three = np.full(3, 7850.0)
    found = {
        "id": np.array([1, 2, 3]), "density": three, "predicted_density": three,
        "internal_energy": np.zeros(3), "predicted_energy": np.zeros(3),
        "sound_speed": np.full(3, 3600.0),
    } | fields  # fmt: skip
    return SimpleNamespace(get=found.get, **found)


def failed(materials=(STEEL,), **fields):
    """The message and the particle of the error."""
    simulation = SimpleNamespace(step=7, time=0.5, particles=particles(**fields))
    with pytest.raises(NumericalError) as caught:
        check(simulation, [SimpleNamespace(eos=one) for one in materials])
    return str(caught.value), caught.value.particle


def test_sound_state_passes():
    check(SimpleNamespace(particles=particles()), [SimpleNamespace(eos=STEEL)])


def test_tension_beyond_equation_of_state_is_told_of_its_origin():
    # NaN has spread to particle 1, whose prediction is finite only in particle 3
    message, particle = failed(
        sound_speed=np.array([np.nan, 3600.0, np.nan]),
        predicted_density=np.array([np.nan, 7850.0, 3000.0]),
        internal_energy=np.array([np.nan, 0.0, np.nan]),
    )
    assert particle == 3
    assert "particle 3 is under more tension than mie_gruneisen allows" in message
    assert "density 3000, internal energy 0" in message
    assert "weaker rarefaction" in message


def test_compression_beyond_equation_of_state():
    message, particle = failed(
        sound_speed=np.array([3600.0, np.nan, 3600.0]),
        predicted_density=np.array([7850.0, 2e4, 7850.0]),
    )
    assert particle == 2
    assert "particle 2 is compressed beyond the densest state of mie_gruneisen" in message


def test_equation_of_state_is_that_of_the_material():
    message, _ = failed(
        materials=(STEEL, WATER),
        material=np.array([0.0, 1.0, 0.0]),
        sound_speed=np.array([3600.0, np.nan, 3600.0]),
    )
    assert "particle 2 is under more tension than tait allows" in message


def test_state_without_known_origin_is_refused():
    message, particle = failed(
        sound_speed=np.array([3600.0, np.nan, np.nan]),
        predicted_energy=np.array([0.0, np.nan, np.nan]),
    )
    assert particle == 2
    assert "particle 2 has no speed of sound" in message


def test_stress_that_is_not_finite_is_refused():
    stress = np.zeros((2, 2, 3))
    stress[0, 1, 1] = np.inf
    message, particle = failed(deviatoric_stress=stress)
    assert particle == 2
    assert "the stress of particle 2 is not finite" in message
