"""Fields from outside and sources of energy: their formulas, and what a run makes of them."""

import math

import numpy as np
import pytest

from sph import config as configuration
from sph.parts.external.point_mass import PointMass
from sph.parts.external.uniform import Uniform
from sph.parts.heating.relaxation import Relaxation

BOX = """
[problem]
name = "uniform"
dimension = {dimension}
n = {n}
velocity = {velocity}
domain = {domain}
boundary = "{boundary}"
[time]
end = {end}
[output]
interval = {end}
"""


@pytest.fixture
def begin(simulate):
    def start(overrides, dimension=1, n=32, velocity=0.0, domain="[0.0, 1.0]",
              boundary="periodic", end=1.0):  # fmt: skip
        text = BOX.format(dimension=dimension, n=n, velocity=[velocity] * dimension,
                          domain=domain, boundary=boundary, end=end)  # fmt: skip
        config = configuration.from_text(text).override(overrides)
        return simulate(config)

    return start


@pytest.mark.parametrize("softening", [0.0, 0.3])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_point_mass_acceleration_equals_slope_of_potential(dimension, softening):
    field = PointMass(2.0, softening)
    x = np.random.default_rng(1).normal(size=(dimension, 5))
    e = 1e-5
    for d in range(dimension):
        ahead, behind = x.copy(), x.copy()
        ahead[d] += e
        behind[d] -= e
        slope = (field.potential(ahead) - field.potential(behind)) / (2 * e)
        # central differences: e^2 times the third derivative, some 1e3 near the mass
        assert -slope == pytest.approx(field.acceleration(x)[d], rel=1e-6, abs=1e-6)
    far = np.full((dimension, 1), 100.0)
    r = 100.0 * math.sqrt(dimension)
    # softening of 0.3 counts by (0.3/100)^2
    assert field.potential(far)[0] == pytest.approx(-2.0 / r, rel=1e-5)


def test_point_mass_at_centre_has_no_acceleration():
    assert (PointMass(1.0).acceleration(np.zeros((3, 1))) == 0).all()


@pytest.mark.parametrize("g", [(2.0,), (0.5, -1.0), (1.0, 0.0, -3.0)])
def test_uniform_acceleration_equals_slope_of_potential(g):
    field = Uniform(g)
    x = np.random.default_rng(1).normal(size=(len(g), 5))
    assert (field.acceleration(x) == np.array(g)[:, None]).all()
    assert field.potential(np.zeros((len(g), 1)))[0] == 0.0
    for axis, along in enumerate(np.eye(len(g))):
        change = field.potential(x + along[:, None]) - field.potential(x)
        # a difference of numbers up to 10: round-off
        assert -change == pytest.approx(np.full(5, g[axis]), rel=1e-14, abs=1e-14)


def test_gas_in_uniform_field_falls_freely(begin):
    """Until it meets a boundary, of which an open box has none."""
    simulation = begin(["physics.external={name='uniform',g=[-2.0]}"], boundary="open")
    start, energy = simulation.totals.momentum.copy(), simulation.totals.energy
    while simulation.time < 0.05:
        simulation.advance(0.05)
    p = simulation.particles
    gained = (simulation.totals.momentum - start) / p.mass.sum()
    # pair forces cancel, and the leapfrog of a constant acceleration is exact: round-off
    assert gained == pytest.approx([-0.1], rel=1e-11)
    assert simulation.totals.energy == pytest.approx(energy, rel=1e-3)  # gas expands into vacuum


def test_gas_in_external_field_conserves_total_energy(begin):
    """Gas at rest falls towards a softened mass in the corner of a closed box."""
    pull = 'physics.external={name="point_mass",mass=1.0,softening=0.5}'
    drift = {}
    for C in (0.2, 0.1):
        simulation = begin([pull, f"physics.C={C}", "physics.alpha=0.0"], n=100, boundary="mirror")
        start = simulation.totals
        while simulation.time < 0.3:
            simulation.advance(0.3)
        end = simulation.totals
        assert end.kinetic_energy > 0.01  # it falls
        assert start.potential_energy < -1.0
        assert end.potential_energy < start.potential_energy
        drift[C] = abs(end.energy - start.energy) / start.internal_energy
    # the leapfrog is of second order: a quarter, less a little for the next order
    assert drift[0.1] < drift[0.2] / 3.5
    assert drift[0.2] < 1e-4


def test_relaxation_any_step_is_exact():
    source = Relaxation(energy=2.0, time=0.1)
    u = np.array([1.0, 2.0, 5.0])
    for dt in (1e-3, 0.1, 10.0, 1e6):
        assert source.heated(u, dt) == pytest.approx(2.0 + (u - 2.0) * np.exp(-dt / 0.1))


@pytest.mark.parametrize("tau", [1e-12, 1e-2, 1.0])
def test_stiff_heating_does_not_limit_step(begin, tau):
    """Uniform gas stays uniform, so its energy follows the source alone, in as many steps."""
    plain = begin([])
    heated = begin([f'physics.heating={{name="relaxation",energy=1.8,time={tau}}}'])
    u = heated.particles.internal_energy[0]
    assert abs(u - 1.8) > 0.01  # else this shows nothing
    steps = 0
    while heated.time < 0.3:
        heated.advance(0.3)
        steps += 1
    while plain.time < 0.3:
        plain.advance(0.3)
    # the signal speed goes with the root of u
    assert steps <= plain.step * math.sqrt(max(1.8 / u, 1.0)) + 2
    expected = 1.8 + (u - 1.8) * math.exp(-0.3 / tau)
    # exact but for rounding in each of some hundred steps
    assert heated.particles.internal_energy == pytest.approx(expected, rel=1e-12)
    gained = heated.totals.internal_energy - u * heated.particles.mass.sum()
    assert heated.energy_added == pytest.approx(gained, rel=1e-9)


def test_rates_use_energy_after_heating(begin):
    """Heating of both halves: with the first alone pressures would lag by half a step."""
    heated = begin(['physics.heating={name="relaxation",energy=18.0,time=0.01}'])
    u, dt = heated.particles.internal_energy[0], heated.limit.dt
    heated.advance(math.inf)
    expected = 18.0 + (u - 18.0) * math.exp(-dt / 0.01)
    # two products of rounding; work between pairs of a uniform gas is as small
    assert heated.particles.predicted_energy == pytest.approx(expected, rel=1e-12)


def test_scene_without_field_and_heating_has_neither(begin):
    _inside, outside = begin([]).scene.described()
    assert "external field: physics.external is not given" in outside
    assert "heating: physics.heating is not given" in outside
