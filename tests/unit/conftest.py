"""Simulations without a run directory around them."""

import pytest

from sph.clock import Clock
from sph.scene import Scene
from sph.simulation import Simulation


@pytest.fixture
def simulate():
    """simulate(config, threads=1): a simulation at t = 0, closed after the test."""
    begun = []

    def start(config, threads=1):
        begun.append(Simulation.start(Scene(config), threads, Clock()))
        return begun[-1]

    yield start
    for simulation in begun:
        simulation.close()
        simulation.clock.close()
