"""What sets the schemes apart: energy, entropy in smooth flow, contacts at rest."""

import copy

import numpy as np
import pytest
from marks import slow_except
from outcome import CONFIGS, simulate

from sph import config as configuration
from sph import registry
from sph.clock import Clock
from sph.scene import Scene
from sph.simulation import Simulation

CONDUCTIVITIES = registry.names("sph.parts.conductivity")
SCHEMES = registry.names("sph.formulations.gas.schemes")


def load(stem, *overrides):
    return configuration.load(CONFIGS / f"{stem}.toml", overrides)


@pytest.mark.parametrize(
    "override",
    [f"scheme='{name}'" for name in SCHEMES]
    + slow_except((), [f"conductivity='{name}'" for name in CONDUCTIVITIES])
    + slow_except(
        {}, [f"conductivity={{name='{name}', switched=true}}" for name in CONDUCTIVITIES]
    ),
)
def test_every_scheme_conserves_energy_and_solves_sod(override):
    outcome = simulate(load("sod", "problem.n=100", f"physics.{override}"))
    # the pairs' exchanges cancel to round-off; the leapfrog loses some 1e-5 at C = 0.15
    assert outcome.energy_drift < 1e-4
    # first order from the .0052 that 400 particles are held to, and a tenth between schemes
    assert outcome.l1("density") < 4 * 0.0052 * 1.1


def entropy_error(scheme, C):
    """Largest relative change of u/rho^(gamma - 1) in a wave of 5 % without viscosity."""
    config = load(
        "sound_wave", "problem.n=64", "problem.amplitude=0.05", "time.end=0.25",
        "physics.alpha=0.0", "physics.density_passes='converged'", "physics.energy_limit=false",
        f"physics.scheme='{scheme}'", f"physics.C={C}",
    )  # fmt: skip
    start, end = (simulate(config, steps).particles.by_id() for steps in (0, None))
    before, after = (
        p.internal_energy / p.density ** (config.physics.gamma - 1) for p in (start, end)
    )
    return np.abs(after / before - 1).max()


@pytest.mark.slow
def test_variational_scheme_conserves_entropy():
    grad_h, variational = (
        [entropy_error(scheme, C) for C in (0.04, 0.02)] for scheme in ("grad_h", "variational")
    )
    # what it loses is the leapfrog's, of second order: a quarter, less a little for the next order
    assert variational[1] < variational[0] / 3.5
    # the averaged gradient loses 2e-5 at any C, 65 times as much as the other at C = 0.02
    assert grad_h[1] > 0.8 * grad_h[0]
    assert variational[1] < grad_h[1] / 30


def test_switched_conductivity_smooths_contact_only():
    def tube(*overrides):
        outcome = simulate(load("sod", "problem.n=200", *overrides))
        return outcome.l1("density"), outcome.particles.internal_energy.max()

    model = "physics.conductivity={{name='pressure_jump',switched={}}}"
    none, fixed, switched = tube(), tube(model.format("false")), tube(model.format("true"))
    # u behind the shock is 2.853 in the exact solution; 2.986 is seen without conductivity, 2.896
    # and 2.963 with it. The error of the density is .00890, .01018 and .00911: a sixth of the price
    assert fixed[1] < switched[1] < none[1] - 0.01
    assert switched[0] - none[0] < (fixed[0] - none[0]) / 3


@pytest.mark.slow
def test_pressure_energy_scheme_keeps_contact_at_rest():
    grad_h, pressure_energy = (
        simulate(load("square", "problem.n=448", "time.end=1.0", f"physics.scheme='{scheme}'"))
        for scheme in ("grad_h", "pressure_energy")
    )
    # seen: mean speeds 0.032 and 0.0077, squareness -0.18 (a diamond) and 0.90. The dense lattice
    # must settle beside the thin one with any scheme, so a square it is not to the last particle.
    assert pressure_energy.l1("velocity") < grad_h.l1("velocity") / 3
    assert grad_h.report()["squareness"] < 0.2
    assert pressure_energy.report()["squareness"] > 0.8
    assert pressure_energy.report()["dense_outside"] == 0
    assert pressure_energy.energy_drift < 1e-5  # gas nearly at rest: 4e-6 seen


def test_pressure_across_contact_even_only_with_pressure_energy():
    def unevenness(scheme):
        outcome = simulate(load("square", "problem.n=448", f"physics.scheme='{scheme}'"), 0)
        p = outcome.particles
        return np.ptp(outcome.simulation.scene.formulation.pressure(p)) / 2.5

    # the smoothed density misses the jump of 4 by most of itself next to it
    assert unevenness("grad_h") > 0.5
    # m u is the same for a volume on either side: lattice error of the two spacings alone
    assert unevenness("pressure_energy") < 0.1


def resumed(run, scheme, clock):
    """The run gone on with from what a checkpoint of it would hold, under that scheme."""
    scene = Scene(load("square", "problem.n=112", f"physics.scheme='{scheme}'"))
    particles, origin = copy.deepcopy(run.particles), copy.deepcopy(run.search.origin)
    return Simulation.resume(
        scene, particles, run.time, run.step, run.limit.dt, origin, threads=1, clock=clock
    )


@pytest.mark.slow
def test_restart_same_scheme_bit_for_bit_and_other_scheme_accepted():
    config = load("square", "problem.n=112", "physics.scheme='pressure_energy'")
    clock = Clock()
    run = Simulation.start(Scene(config), 1, clock)
    for _ in range(3):
        run.advance(config.time.end)
    again = resumed(run, "pressure_energy", clock)
    other = resumed(run, "variational", clock)
    back = resumed(other, "pressure_energy", clock)
    for each in (run, again, other, back):
        each.advance(config.time.end)
        each.close()
    clock.close()
    for name, array in run.particles.arrays().items():
        assert array.tobytes() == again.particles.arrays()[name].tobytes(), name
    assert other.particles.get("pressure") is None
    assert back.particles.pressure.tobytes() == run.particles.pressure.tobytes()
