"""The floor under the density error: a lattice's own sum, which no number of particles lowers."""

import itertools

import numpy as np
import pytest
from outcome import CONFIGS, simulate

from sph import config as configuration


def density_error(n: int, eta: float) -> float:
    config = configuration.load(
        CONFIGS / "uniform.toml",
        ["problem.dimension=1", "problem.velocity=0.0", f"problem.n={n}", f"physics.eta={eta}"],
    )
    density = simulate(config, max_steps=0).particles.density
    assert np.ptp(density) < 1e-10  # the same for all, as far as supports are converged
    return density[0] - 1


def test_density_error_uniform_lattice_matches_sum_by_hand():
    # the sum over a lattice of spacing 1 and H = 1.620185 x 1.6 written out by hand
    assert density_error(100, 1.6) == pytest.approx(0.002456, abs=5e-7)


def test_density_error_does_not_fall_with_number_of_particles():
    assert density_error(1000, 1.6) == pytest.approx(density_error(100, 1.6), rel=1e-9)


def test_density_error_falls_with_eta():
    errors = [abs(density_error(100, eta)) for eta in (1.2, 1.6, 2.4, 3.2)]
    assert all(later < earlier for earlier, later in itertools.pairwise(errors))
    # the transform of the kernel falls as the fourth power of the wave number (C2): eta^-4
    assert errors[3] < errors[1] / 8
