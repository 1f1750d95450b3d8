"""A state made of random numbers, which no code has rounded or tidied."""

import h5py
import numpy as np
import pytest
from states import gas_state

from sph import config
from sph.output import checkpoint
from sph.output.checkpoint import Checkpoint
from sph.totals import Baseline, Budget

DOMAIN = [[-0.5, 0.5], [0.0, 0.25], [-2.0, 2.0]]


def configured(dimension: int, boundary: str = "periodic", alpha=None) -> config.Config:
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
        alpha = {1.0 if alpha is None else "{ min = 0.1, max = 2.0 }"}
        """,
        "the test",
    )


def random_state(dimension=2, number=50, boundary="periodic", alpha=None, seed=1) -> Checkpoint:
    random = np.random.default_rng(seed)
    low, high = np.array(DOMAIN[:dimension]).T[:, :, None]
    particles = gas_state(
        position=low + (high - low) * random.random((dimension, number)),
        velocity=random.normal(size=(dimension, number)),
        mass=random.random(number),
        internal_energy=random.random(number),
        alpha=alpha,
    )
    for name, array in particles.arrays().items():
        if name not in ("id", "position"):
            array[...] = np.abs(random.normal(size=array.shape) + 5)
    particles.id = random.permutation(particles.id)
    return Checkpoint(
        particles=particles,
        time=random.random(),
        step=17,
        next_step=random.random(),
        list_position=particles.position.copy(),
        list_support=0.1 * (0.5 + random.random(number)),  # in a domain of 0.25
        list_skin=0.1,
        config=configured(dimension, boundary, alpha),
        lineage=("a first run", "résumé\nof it"),
        budget=Budget(random.random(), random.random(), Baseline(*random.random(2).tolist())),
    )


@pytest.fixture
def make_state():
    return random_state


@pytest.fixture
def public(tmp_path):
    """Write a state and open what was written."""
    files = []

    def write(state):
        checkpoint.write(tmp_path / "a.h5", state)
        files.append(h5py.File(tmp_path / "a.h5"))
        return files[-1]

    yield write
    for file in files:
        file.close()
