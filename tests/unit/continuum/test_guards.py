"""The continuum formulation's bookkeeping: yield surface, clamps, density, faults, refusals."""

import numpy as np
import pytest

from sph import config
from sph.clock import Clock
from sph.errors import ConfigError, NumericalError
from sph.integrators.leapfrog import DENSITY
from sph.scene import Scene
from sph.simulation import Simulation

SOLID = """
[problem]
name = "uniform"
n = 100
dimension = 2
density = 1.0
pressure = 0.01
boundary = "open"
[time]
end = 0.5
[physics]
formulation = "continuum"
max_energy_drift = 1.0
eos = { name = "tait", rho_0 = 0.99, c_0 = 1.0 }
strength = { name = "elastic_plastic", shear_modulus = 0.5, yield_stress = 0.01 }
"""


def begun(text=SOLID, move=0.3):
    one = Simulation.of_problem(Scene(config.from_text(text)), 1, Clock())
    p = one.particles
    p.velocity[:] = move * np.sin(2.0 * np.pi * p.position[::-1])
    one.begin()
    return one


def equivalent(S):
    """(N,) sqrt(3/2 S:S) in plane strain."""
    squares = (S * S).sum(axis=(0, 1)) + (S[0, 0] + S[1, 1]) ** 2
    return np.sqrt(1.5 * squares)


def test_stress_is_on_or_inside_yield_surface_after_each_step():
    one = begun()
    for _ in range(10):
        one.advance(0.5)
        # the return computes the square root of a sum of some ten terms
        assert equivalent(one.particles.deviatoric_stress).max() < 0.01 * (1 + 1e-14)
    strain = one.particles.plastic_strain
    assert equivalent(one.particles.deviatoric_stress).max() > 0.00999
    assert strain.min() >= 0.0
    assert strain.max() > 0.01


def test_density_stays_positive_and_adds_no_energy():
    density, full = np.array([[2.0, 2.0]]), np.empty((1, 2))
    rate = np.array([[-10.0, 1.0]])
    assert DENSITY.predict(0, 2, 1.0, density, rate, np.ones(2), full) == 0.0
    assert (density > 0.0).all()
    assert (full > 0.0).all()
    assert full[0, 1] == 3.0
    assert (density == 2.0).all()  # the rate in the middle of the step is not known yet
    assert DENSITY.correct(0, 2, 1.0, density, rate, np.ones(2)) == 0.0
    assert (density > 0.0).all()
    assert density[0, 1] == 3.0


def test_support_follows_density():
    one = begun()
    for _ in range(5):
        one.advance(0.5)
    p = one.particles
    # the support is that of the predicted density
    expected = 2.0 * 1.2 * (p.mass / p.predicted_density) ** 0.5
    assert p.support == pytest.approx(expected, rel=1e-15)
    assert np.ptp(p.support) > 1e-3 * p.support.mean()


@pytest.mark.parametrize("name", ["deviatoric_stress", "density", "internal_energy"])
def test_nan_stops_the_run_and_names_particle(name):
    one = begun()
    one.advance(0.5)
    getattr(one.particles, name)[..., 7] = np.nan
    with pytest.raises(NumericalError, match=r"of particle \d+ is|particle \d+") as caught:
        one.advance(0.5)
    assert caught.value.particle


def test_negative_density_stops_the_run():
    one = begun()
    one.advance(0.5)
    one.particles.density[3] = -1.0
    with pytest.raises(NumericalError):
        one.advance(0.5)


def test_internal_energy_may_be_negative():
    one = begun()
    one.particles.internal_energy[:] -= 1.0
    one.baseline = None  # so that no drift is seen
    for _ in range(3):
        one.advance(0.5)
    assert one.particles.internal_energy.max() < 0.0


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("time.stepping=individual", 'expected "global"'),
        ("physics.correction=2", "expected -1, 0 or 1"),
        ("physics.q_a=-1.0", "expected a number of at least 0"),
        ("physics.spacing_ratio=0.5", "expected a number of at least 0.9"),
        ("physics.strength.shear_modulus=-1.0", "expected a number greater than 0"),
        ("physics.eta=1.6", "physics.eta is not a key"),
    ],
)
def test_settings_that_do_not_fit_are_refused(setting, words):
    with pytest.raises(ConfigError) as caught:
        config.from_text(SOLID).override([setting])
    assert words in str(caught.value)


def test_materials_beside_a_single_material_are_refused():
    one = '[physics.materials.a]\neos = { name = "tait", rho_0 = 1.0, c_0 = 1.0 }\n'
    with pytest.raises(ConfigError) as caught:
        config.from_text(SOLID + one)
    # of eos and of strength
    assert str(caught.value).count("expected it in the tables of physics.materials") == 2


def test_problem_without_density_is_refused():
    text = """
[problem]
name = "particles"
dimension = 1
domain = [0.0, 1.0]
positions = [[0.2], [0.4]]
masses = 1.0
internal_energies = 1.0
[physics]
formulation = "continuum"
"""
    with pytest.raises(ConfigError, match="states no initial density"):
        Scene(config.from_text(text)).initial_state()
