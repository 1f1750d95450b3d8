"""Bodies that collide: what is conserved, how far a bar is shortened, and that rings bounce."""

import numpy as np
import pytest

from sph.formulations.continuum import pieces


def torn(outcome) -> dict:
    simulation = outcome.simulation
    return pieces.of(simulation.particles, simulation.scene.domain).torn


def figures(outcome) -> dict[str, float]:
    """The figures from the history, which here has a row for each step."""
    config = outcome.simulation.scene.config
    rows = outcome.diagnostics
    history = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    history["t"] = np.array(outcome.times)
    return config.problem.over_time(config.physics.eos_model(), history)


# --- the bar ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("dimension", "length"), [(2, 0.8254), (3, 0.8336)])
def test_bar_is_shortened_as_by_finite_elements(run, dimension, length):
    outcome = run("taylor_bar", f"problem.dimension={dimension}", "problem.n=340")
    found = figures(outcome)
    # Finite elements give 0.811 and 0.8124 of the length, 2.52 and 1.79 of the radius. 340
    # particles, 3 to 5 spacings to a radius, are 1.8 and 2.6 % longer and 10 % thinner.
    assert found["length_error"] < 0.03
    # as measured: a sixth less yield stress gives 0.798 in 2-D
    assert found["shortest_length_ratio"] == pytest.approx(length, abs=0.006)
    assert found["radius_error"] < 0.12
    assert outcome.energy_drift < 1e-3  # of the kinetic energy, which all becomes heat
    # it has stopped: vibrations have 0.1 % of the kinetic energy
    assert outcome.simulation.totals.kinetic_energy < 0.01 * outcome.energies[0]
    assert not torn(outcome)


# --- the rings --------------------------------------------------------------------------------

RINGS = ("problem.n=1100", "physics.allow_tearing=true")


def test_rings_bounce_unbroken_with_tensile_correction(run):
    outcome = run("rubber_rings", *RINGS)
    found = figures(outcome)
    assert not torn(outcome)
    assert 0.6 < found["restitution"] < 0.9  # 0.75 was measured
    assert found["angular_momentum_change"] < 1e-6  # mirror symmetry, but for round-off that grows
    assert outcome.energy_drift < 5e-4
    scale = 0.5 * outcome.particles.mass.sum() * outcome.simulation.scene.config.problem.speed
    assert np.abs(outcome.momenta[-1]).max() < 1e-12 * scale


def test_rings_break_without_tensile_correction(run):
    outcome = run("rubber_rings", *RINGS, "physics.tensile_correction=0.0", "time.end=1.3e-4")
    broken = torn(outcome)
    # each into pieces of hundreds of particles by t = 1.2e-4, as the other does
    assert len(broken) == 2
    assert min(sizes[1] for sizes in broken.values()) > 50


# --- several bodies ---------------------------------------------------------------------------

FEW = ("problem.n=600", "time.end=1e-5")


def test_disc_hands_its_momentum_to_plate_of_another_material(run):
    outcome = run("bodies", *FEW)
    start, end = outcome.momenta[0], outcome.momenta[-1]
    assert np.abs(end - start).max() < 1e-12 * np.abs(start).max()  # round-off
    found = outcome.report()
    assert found["body_0_velocity_x"] < 380.0  # of 400
    mass = np.array([7850.0 * np.pi * 0.005**2, 2785.0 * 0.004 * 0.04])
    gained = found["body_1_velocity_x"] * mass[1]
    assert gained == pytest.approx((400.0 - found["body_0_velocity_x"]) * mass[0], rel=1e-9)
    p = outcome.particles
    plate = p.material == 1.0
    # equal pressure behind the shocks into both gives 262 m/s, a free surface twice as much
    assert 262.0 < p.velocity[0, plate].max() < 524.0
    assert p.plastic_strain[plate].max() > 0.05
    assert outcome.energy_drift < 1e-3
