"""Distances to the nearest neighbour against brute force, and what they tell of pairing."""

import numpy as np
import pytest
from test_neighbours import EagerTeam, positions, search_over

from sph import config, simd
from sph.passes import Neighbours
from sph.passes.nearest import nearest
from sph.warnings import PAIRED

MIXED = ("mirror", "periodic", "open")


def found_by_pass(search, position, support, mass, density, threads=1):
    """(N,) what the pass finds, particles in block order."""
    dim = (0,) * position.shape[0]
    near = Neighbours(
        search.lists, search.images, search.boxes, search.origin.support, search.reach_factor,
        simd.DOUBLE,
    )  # fmt: skip
    ratio = np.full(support.size, np.nan)
    team = EagerTeam(threads)
    fields = (position, support, mass, density, ratio)
    team.run(nearest, near.superblocks, dim, None, near, *fields)
    team.close()
    return ratio


def found_densely(domain, position, support, mass, density):
    """(N,) the same from all distances between all particles and images."""
    sign, offset = domain.images
    image = sign[:, :, None] * position + offset[:, :, None]
    distance = np.linalg.norm(position.T[:, None, :, None] - image, axis=2)  # (N, images, N)
    np.fill_diagonal(distance[:, 0], np.inf)
    least = distance.min(axis=(1, 2))
    spacing = (mass / density) ** (1 / position.shape[0])
    return np.where(least < support, least / spacing, np.inf)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("shape", ["random", "clustered", "equal_coordinates"])
@pytest.mark.parametrize(
    "boundaries",
    [("periodic",), ("mirror",), ("open",), ("periodic", "mirror"), ("open", "mirror"),
     ("periodic",) * 3, MIXED],
    ids="-".join,
)  # fmt: skip
def test_nearest_distance_is_minimum_over_all_pairs(boundaries, shape, threads):
    position = positions(shape, len(boundaries), 203)
    random = np.random.default_rng(7)
    # so small that some particles have no neighbour within, so large that images come within
    support = random.uniform(0.002, 0.3, 203)
    mass, density = random.uniform(0.5, 2.0, (2, 203))
    search, order = search_over(boundaries, position, support, 0.2)
    gas = (search.origin.position, support[order], mass[order], density[order])
    expected = found_densely(search.domain, *gas)
    ratio = found_by_pass(search, *gas, threads)
    # differences of coordinates up to 2 are rounded to 2e-16: nothing to distances of 1e-4
    np.testing.assert_allclose(ratio, expected, rtol=1e-11, atol=1e-15)
    if shape == "random":
        assert 0 < np.count_nonzero(np.isinf(expected)) < 150
    if shape == "equal_coordinates":
        assert np.count_nonzero(expected == 0.0) > 50  # several in one place


def test_nearest_distance_includes_own_images():
    position = np.array([[0.001, 0.5, 0.999]])
    gas = (position, np.full(3, 0.4), np.ones(3), np.ones(3))
    for boundary, near in (("mirror", 0.002), ("periodic", 0.002), ("open", np.inf)):
        search, _ = search_over((boundary,), gas[0], gas[1], 0.2)
        ends = found_by_pass(search, *gas)[[0, 2]]
        np.testing.assert_allclose(ends, near, rtol=1e-10)


def test_nearest_distance_two_threads_equal_one():
    position = positions("clustered", 3, 3000)
    support = np.full(3000, 0.05)
    search, _ = search_over(MIXED, position, support, 0.2)
    gas = (search.origin.position, support, np.ones(3000), np.ones(3000))
    one, two = (found_by_pass(search, *gas, threads) for threads in (1, 2))
    assert one.tobytes() == two.tobytes()


UNIFORM = '[problem]\nname = "uniform"\nn = 576\nnoise = 0.2\n[time]\nend = 5.0\n'


def uniform(path, *overrides):
    file = path / "uniform.toml"
    file.write_text(UNIFORM)
    return config.load(file, overrides)


def after(simulation, time):
    while simulation.time < time:
        simulation.advance(time)
    return simulation


@pytest.mark.parametrize(
    ("kernel", "pairs"),
    [pytest.param("cubic_spline", True, marks=pytest.mark.slow), ("wendland_c2", False)],
)
def test_pairing_kernel_is_reported(simulate, tmp_path, kernel, pairs):
    keys = (f"physics.kernel={kernel}", "physics.eta=2.2", "physics.allow_pairing=true")
    run = after(simulate(uniform(tmp_path, *keys)), 5.0)
    # medians of .05 and .97 were measured
    assert (np.median(run.nearest()) < PAIRED) == pairs


def test_nearest_distance_at_start_equals_lattice(simulate, tmp_path):
    run = simulate(uniform(tmp_path, "problem.noise=0.0"))
    # the density of the lattice is 0.5 % too high, and with it the spacing 0.25 % too small
    np.testing.assert_allclose(run.nearest(), np.sqrt(run.particles.density), rtol=1e-12)
    run.advance(5.0)
    assert run.nearest().min() > 0.99
