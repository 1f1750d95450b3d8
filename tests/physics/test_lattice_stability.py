"""Lattices that come apart: shear waves of short wavelength grow where no viscosity meets them."""

import numpy as np
import pytest
from outcome import CONFIGS

from sph import config as configuration
from sph.clock import Clock
from sph.scene import Scene
from sph.simulation import Simulation

NOISE = 1e-7  # of the sound speed: Balsara's factor then leaves no viscosity


def growth(*overrides) -> float:
    """Growth of a random velocity in uniform gas of 256 particles within 95 crossings of a spacing.

    Of the root mean square over all particles: the fastest mode begins with a part of it.
    """
    keys = ("problem.velocity=0.0", "problem.n=256", "time.end=5.0", *overrides)
    config = configuration.load(CONFIGS / "uniform.toml", keys)
    clock = Clock()
    simulation = Simulation.of_problem(Scene(config), threads=1, clock=clock)
    velocity = simulation.particles.velocity
    velocity += NOISE * np.random.default_rng(1).normal(size=velocity.shape)
    simulation.begin()
    while simulation.time < config.time.end:
        simulation.advance(config.time.end)
    simulation.close()
    clock.close()
    return float(np.sqrt((simulation.particles.velocity**2).mean()) / NOISE)


@pytest.mark.parametrize("lattice", ["cubic", "hexagonal"])
def test_lattice_with_default_kernel_is_unstable(lattice):
    # e^(.07 x 95) = 770 (square) and e^(.115 x 95) = 6e4 (hexagonal) for the fastest mode alone
    assert growth(f"problem.lattice={lattice}") > 30


def test_lattice_of_shipped_2d_wave_is_stable():
    config = configuration.load(CONFIGS / "sound_wave_2d.toml")
    physics = (f"physics.kernel={config.physics.kernel}", f"physics.eta={config.physics.eta}")
    # what is left is the time integration's: e^(.0116 x 95) = 3 for the fastest mode alone
    assert growth(f"problem.lattice={config.problem.lattice}", *physics) < 3
