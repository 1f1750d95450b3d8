"""Sums over particles, and the energy drift, which no bulk motion may hide."""

import numpy as np
import pytest
from states import gas_state

from sph import config as configuration
from sph import totals
from sph.part import Part
from sph.parts.external import External
from sph.parts.external.point_mass import PointMass
from sph.totals import Baseline

RANDOM = np.random.default_rng(3)


def gas(dimension=2, n=50, boost=0.0):
    particles = gas_state(
        RANDOM.uniform(size=(dimension, n)), RANDOM.normal(size=(dimension, n)),
        RANDOM.uniform(1.0, 2.0, n), RANDOM.uniform(1.0, 2.0, n),
    )  # fmt: skip
    particles.density[:] = RANDOM.uniform(1.0, 2.0, n)
    particles.velocity[0] += boost
    return particles


class Resting(Part):
    """A second part that has an energy."""

    def energies(self, state):
        return {"rest_energy": np.full(state.number, 9.0)}


@pytest.mark.parametrize("boost", [0.0, 1e-3, 1.0, 1e3, 1e6])
def test_kinetic_energy_without_bulk_independent_of_frame(boost):
    particles = gas()
    still = totals.of(particles, (), np.ones(2))
    particles.velocity += np.array([[boost], [-0.3 * boost]])
    moving = totals.of(particles, (), np.ones(2))
    # velocities round at 1e-16 of the boost, and their errors add up at random
    assert moving.kinetic_energy_without_bulk == pytest.approx(
        still.kinetic_energy_without_bulk, rel=1e-14 + 1e-15 * boost
    )
    mass, bulk = particles.mass.sum(), still.momentum / particles.mass.sum()
    expected = still.kinetic_energy - 0.5 * mass * (bulk @ bulk)
    assert still.kinetic_energy_without_bulk == pytest.approx(expected, rel=1e-13)


def test_bulk_motion_subtracted_only_on_conserving_axes():
    particles = gas(boost=5.0)
    none = totals.of(particles, (), np.zeros(2))
    assert none.kinetic_energy_without_bulk == pytest.approx(none.kinetic_energy, rel=1e-14)
    along_y = totals.of(particles, (), np.array([0.0, 1.0]))
    bulk = none.momentum[1] / particles.mass.sum()
    expected = none.kinetic_energy - 0.5 * particles.mass.sum() * bulk**2
    assert along_y.kinetic_energy_without_bulk == pytest.approx(expected, rel=1e-13)


def test_volume_is_sum_of_mass_over_density():
    particles = gas(dimension=3)
    expected = (particles.mass / particles.density).sum()
    assert totals.of(particles, (), np.ones(3)).volume == pytest.approx(expected, rel=1e-14)


def test_sums_and_extremes_match_particles():
    particles = gas(dimension=3)
    particles.acceleration[:] = RANDOM.normal(size=(3, 50))
    particles.energy_rate[:] = RANDOM.normal(size=50)
    p, field = particles, PointMass(2.0, 0.1)
    found = totals.of(p, (External(field), Resting()), np.ones(3))
    expected = {
        "kinetic_energy": 0.5 * p.mass @ (p.velocity**2).sum(axis=0),
        "internal_energy": p.mass @ p.internal_energy,
        "energies": {"potential_energy": p.mass @ field.potential(p.position),
                     "rest_energy": 9.0 * p.mass.sum()},
        "min_density": p.density.min(),
        "max_density": p.density.max(),
        "min_internal_energy": p.internal_energy.min(),
        "max_internal_energy": p.internal_energy.max(),
        "rates": p.acceleration.sum() + p.energy_rate.sum(),
    }  # fmt: skip
    # sums of 50 to 200 terms in another order, those of the rates with either sign
    for name, value in expected.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-13, abs=1e-13)
    assert found.potential_energy == pytest.approx(sum(expected["energies"].values()), rel=1e-13)
    assert found.momentum == pytest.approx(p.velocity @ p.mass, rel=1e-12)
    parts = found.internal_energy + found.potential_energy
    assert found.energy == pytest.approx(found.kinetic_energy + parts, rel=1e-15)
    without_bulk = found.kinetic_energy_without_bulk + parts
    assert found.energy_without_bulk == pytest.approx(without_bulk, rel=1e-15)
    assert totals.of(p, (Part(),), np.ones(3)).potential_energy == 0.0


def test_baseline_in_middle_of_run_has_zero_drift():
    now = totals.of(gas(), (External(PointMass(2.0, 0.1)),), np.ones(2))
    baseline = Baseline.at(now, added=0.5)
    assert abs(baseline.drift(now, added=0.5)) < 1e-15  # round-off
    assert baseline.drift(now, added=0.0) == pytest.approx(0.5 / baseline.scale, rel=1e-12)


@pytest.mark.parametrize(
    ("kinetic", "internal", "potential", "scale"),
    [
        (1.0, 2.0, 0.0, 3.0),
        # potential energy cancels the rest, which an error is measured by
        (1.0, 2.0, -3.0, 3.0),
        # gas bound deeply, with little energy of its own
        (1.0, 0.0, -100.0, 99.0),
    ],
)
def test_drift_is_relative_to_initial_energy(kinetic, internal, potential, scale):
    baseline = Baseline.of(kinetic, internal, potential)
    now = totals.of(gas(), (), np.ones(2))._replace(
        kinetic_energy_without_bulk=kinetic + 0.3, internal_energy=internal + 0.25,
        energies={"potential_energy": potential},
    )  # fmt: skip
    # a quarter was added by heating, which is no drift
    assert baseline.drift(now, added=0.25) == pytest.approx(0.3 / scale, rel=1e-13)


def test_drift_without_initial_energy_is_infinite_or_zero():
    nothing = Baseline.of(0.0, 0.0, 0.0)
    now = totals.of(gas(), (), np.ones(2))._replace(
        kinetic_energy_without_bulk=0.0, internal_energy=0.0
    )
    assert nothing.drift(now, 0.0) == 0.0
    assert nothing.drift(now._replace(internal_energy=1e-9), 0.0) == np.inf


VORTEX = """
[problem]
name = "gresho"
n = 400
velocity = [{boost}, 0.0]
[physics]
C = {C}
max_energy_drift = 1e9
[time]
end = 0.5
[output]
interval = 0.5
"""


@pytest.mark.parametrize("boost", [300.0, 3e5])
@pytest.mark.parametrize("C", [0.15, 1.5])
def test_drift_of_vortex_independent_of_bulk_velocity(simulate, boost, C):
    """A step ten times too long multiplies the vortex's energy; bulk motion made that 3e-4."""
    drifts = []
    for speed in (0.0, boost):
        simulation = simulate(configuration.from_text(VORTEX.format(boost=speed, C=C)))
        while simulation.time < 0.5 and simulation.step < 30:
            simulation.advance(0.5)
        drifts.append(simulation.energy_drift)
    at_rest, moving = drifts
    # particles are moved and wrapped with rounding of 1e-16 of the way, which noise then amplifies
    assert moving == pytest.approx(at_rest, rel=0.1, abs=1e-7)
