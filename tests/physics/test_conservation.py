"""What the equations conserve, the program conserves."""

from dataclasses import replace

import numpy as np
import pytest
from outcome import CONFIGS, simulate

from sph import config as configuration
from sph.problems import uniform
from sph.problems.base import InitialState


class Wave(uniform.Problem):
    """A smooth sound wave of amplitude 5 % along x on a lattice."""

    def initial(self, eos):
        start = super().initial(eos)
        velocity = start.velocity.copy()
        velocity[0] = 0.05 * np.sin(2 * np.pi * start.position[0])
        return InitialState(start.position, velocity, start.mass, start.internal_energy)


def uniform_config(*overrides, problem=None):
    config = configuration.load(CONFIGS / "uniform.toml", overrides)
    if problem is None:
        return config
    return replace(config, problem=problem(**config.problem.model_dump()))


@pytest.mark.parametrize("boundary", ["periodic", "open"])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_momentum_random_gas_conserved_along_axes_without_walls(dimension, boundary):
    config = uniform_config(
        f"problem.dimension={dimension}", "problem.n=1000", "problem.noise=0.3",
        "problem.velocity=0.7", "time.end=1.0", f"problem.boundary={boundary}",
    )  # fmt: skip
    outcome = simulate(config, max_steps=20)
    p, eos = outcome.particles, outcome.simulation.scene.eos
    sound_speed = eos.sound_speed(p.density, outcome.pressure)
    scale = np.sum(p.mass * (np.linalg.norm(p.velocity, axis=0) + sound_speed))
    change = np.abs(outcome.momenta[-1] - outcome.momenta[0]).max()
    # pair forces are equal and opposite to round-off: some 1e-16 a step of the moduli summed
    assert change <= 1e-12 * scale


def test_energy_error_smooth_wave_falls_with_square_of_step():
    drift = []
    for C in (0.3, 0.15, 0.075):
        config = uniform_config(
            "problem.dimension=1", "problem.n=100", "problem.velocity=0.0",
            f"physics.C={C}", "physics.alpha=0.0",
            "physics.density_passes='converged'", "time.end=1.0", problem=Wave,
        )  # fmt: skip
        drift.append(simulate(config).energy_drift)
    # the leapfrog is of second order: halving the step must divide the drift by 4, less a few
    # per cent for the next order at C = 0.3
    assert drift[0] / drift[1] > 3.8
    assert drift[1] / drift[2] > 3.8


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_uniform_gas_at_rest_stays_at_rest(dimension):
    outcome = simulate(
        uniform_config(f"problem.dimension={dimension}", "problem.n=512", "problem.velocity=0.0"),
        10,
    )
    p = outcome.particles
    # forces on a lattice cancel by symmetry, up to the 1e-10 to which supports are converged
    assert np.abs(p.velocity).max() < 1e-10
    np.testing.assert_allclose(p.density, p.density.mean(), rtol=1e-10)


def test_uniform_gas_with_bulk_velocity_equals_gas_at_rest():
    at_rest = simulate(
        uniform_config("problem.noise=0.3", "problem.n=256", "problem.velocity=0.0"), 10
    )
    moving = simulate(
        uniform_config("problem.noise=0.3", "problem.n=256", "problem.velocity=[0.6, 0.4]"), 10
    )
    a, b = at_rest.particles.by_id(), moving.particles.by_id()
    # Galilean invariance up to round-off, amplified over ten steps by a factor of some 100
    np.testing.assert_allclose(b.density, a.density, rtol=1e-12)
    np.testing.assert_allclose(b.velocity[0] - 0.6, a.velocity[0], atol=1e-12)
