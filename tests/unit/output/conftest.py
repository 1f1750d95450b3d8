"""A state made of random numbers, which no code has rounded or tidied."""

import numpy as np
import pytest

from sph import config
from sph.output.checkpoint import Checkpoint
from sph.particles import Particles

DOMAIN = [[-0.5, 0.5], [0.0, 0.25], [-2.0, 2.0]]


def configured(dimension: int, boundary: str = "periodic") -> config.Config:
    return config.from_text(
        f"""
        [problem]
        name = "shock_tube"
        dimension = {dimension}
        domain = {DOMAIN[:dimension]}
        boundary = {[boundary] * dimension}
        [physics]
        gamma = 1.4
        eta = 1.5
        """,
        "the test",
    )


def random_state(dimension=2, number=50, boundary="periodic", alpha=None, seed=1) -> Checkpoint:
    random = np.random.default_rng(seed)
    low, high = np.array(DOMAIN[:dimension]).T[:, :, None]
    particles = Particles.at_start(
        position=low + (high - low) * random.random((dimension, number)),
        velocity=random.normal(size=(dimension, number)),
        mass=random.random(number),
        internal_energy=random.random(number),
        alpha=alpha,
    )
    for name, array in particles.arrays().items():
        if name not in ("id", "position"):
            array[...] = random.normal(size=array.shape) + 5
    particles.id = random.permutation(particles.id)
    return Checkpoint(
        particles=particles,
        time=random.random(),
        step=17,
        next_step=random.random(),
        list_position=random.random((dimension, number)),
        list_support=random.random(number),
        list_skin=0.1,
        config=configured(dimension, boundary),
        lineage=("a first run", "résumé\nof it"),
    )


@pytest.fixture
def make_state():
    return random_state
