"""Relaxation to a glass: densities, regularity, boundaries, and what stops it."""

import shutil

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sph import config, kernels, restarting, runner
from sph.analysis import info
from sph.analysis.html import run_page
from sph.analysis.info import words
from sph.analysis.summary import in_words
from sph.clock import Clock
from sph.domain import Domain
from sph.errors import ConfigError
from sph.output.run_directory import RunDirectory
from sph.problems.support import areas, glass, lattice
from sph.progress import Lines
from sph.scene import Scene
from sph.simulation import Simulation

KERNEL = kernels.make("wendland_c2")


def smoothing(dimension, kernel=KERNEL, eta=1.6):
    return glass.Smoothing(kernel, eta * kernels.support_ratio(kernel, dimension))


def cube(dimension, boundary="periodic", side=1.0):
    return Domain(np.array([[0.0, side]] * dimension), (boundary,) * dimension)


def start(domain, n):
    return lattice.with_noise(lattice.fill(domain.box, n, "cubic"), domain.box, 0.5, 0)


def relaxed(domain, n, residual=1e-3, most=400, sums=None):
    position = start(domain, n)
    each = domain.volume / position.shape[1]
    return glass.relaxed(
        position, domain, lambda x: np.full(x.shape[1], each),
        sums or smoothing(len(domain.box)), residual, most, lambda *_: None,
    )  # fmt: skip


def test_filling_is_density_sum_written_out():
    domain, random = cube(2), np.random.default_rng(1)
    position, volume = random.uniform(0.0, 1.0, (2, 30)), random.uniform(0.01, 0.15, 30)
    sums = smoothing(2)
    found = glass._filling(position, domain, volume, sums)
    images = np.array([[i, j] for i in range(-2, 3) for j in range(-2, 3)])
    support = sums.ratio * np.sqrt(volume)
    assert 1.0 < support.max() < 2.0  # a particle reaches its own images, and those counted here
    for i in range(30):
        apart = position[:, i, None, None] - position[:, :, None] - images.T[:, None]
        q = np.minimum(np.sqrt((apart**2).sum(axis=0)) / support[i], 1.0)
        weight = kernels.normalisation(KERNEL, (0, 0)) * kernels.w(KERNEL, (0, 0), q)
        # sums of 750 terms of one sign in another order
        assert found[i] == pytest.approx((volume[:, None] * weight).sum() / support[i] ** 2, 1e-13)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_slope_is_derivative_of_scatter(dimension, boundary):
    domain = cube(dimension, boundary)
    position = start(domain, 40)
    n = position.shape[1]
    volume = np.full(n, 1.0 / n)
    sums = smoothing(dimension, eta=1.0)
    filling = glass._filling(position, domain, volume, sums)
    slope = glass._slope(position, domain, volume, sums, filling - filling.mean())

    def half_square(x):
        return 0.5 * ((glass._filling(x, domain, volume, sums) - filling.mean()) ** 2).sum()

    step = 1e-6
    for axis in range(dimension):
        for i in (0, n // 2, n - 1):
            shift = np.zeros_like(position)
            shift[axis, i] = step
            rate = (half_square(position + shift) - half_square(position - shift)) / (2.0 * step)
            # central difference: step^2 of third derivatives, and round-off over the step
            expected = slope[axis, i] * n ** (1.0 / dimension)
            assert rate == pytest.approx(expected, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize(("dimension", "n"), [(1, 40), (2, 400), (3, 512)])
def test_density_error_below_a_thousandth(dimension, n, boundary):
    domain = cube(dimension, boundary)
    found = relaxed(domain, n)
    assert found.scatter <= 1e-3
    n = found.position.shape[1]
    again = glass.measured(found.position, domain, np.full(n, 1.0 / n), smoothing(dimension))
    assert again.scatter == found.scatter
    assert ((found.position >= 0.0) & (found.position <= 1.0)).all()
    if boundary == "periodic":
        nearest = cKDTree(found.position.T, boxsize=1.0).query(found.position.T, k=2)[0][:, 1]
        # no pairs: a lattice has 1, random positions nearly 0; found .86 and more
        assert nearest.min() * n ** (1.0 / dimension) > 0.8


def test_smaller_residual_is_reached_with_more_iterations():
    coarse, fine = (relaxed(cube(2), 400, residual) for residual in (1e-3, 2e-4))
    assert fine.scatter <= 2e-4
    assert fine.iterations > coarse.iterations
    # both means are the error of the kernel's sum, .5 % for this kernel on any arrangement
    assert fine.mean == pytest.approx(1.005, abs=5e-4)


@pytest.mark.parametrize("most", [5, 65])
def test_too_few_iterations_end_with_best_scatter(most):
    found = relaxed(cube(2), 400, most=most)
    assert found.iterations == most
    assert 1e-3 < found.scatter < 0.05


def test_chunks_change_only_round_off(monkeypatch):
    whole = relaxed(cube(2), 400, most=70)
    monkeypatch.setattr(glass, "CHUNK", 37)
    parts = relaxed(cube(2), 400, most=70)
    # each particle's pairs are in one chunk, in an order that depends on the tree of the chunk
    np.testing.assert_allclose(parts.position, whole.position, rtol=0, atol=1e-9)


def test_sampled_positions_follow_density():
    box = np.array([[0.0, 2.0], [0.0, 1.0]])
    position, mass = areas.sampled(box, 2000, lambda x: 1.0 + x[0], 0)
    assert mass * 2000 == pytest.approx(4.0, rel=1e-3)  # integral of 1 + x
    for low, high in ((0.0, 0.5), (0.5, 1.0), (1.5, 2.0)):
        expected = (high - low) + 0.5 * (high**2 - low**2)
        there = (position[0] >= low) & (position[0] < high)
        # random positions would be off by 1/sqrt(300), 6 %
        assert there.sum() * mass == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("dimension", "n"), [(2, 400), (3, 343)])
def test_density_of_run_scatters_as_little(dimension, n):
    keys = [f"problem.dimension={dimension}", f"problem.n={n}", "problem.relax={residual=8e-4}"]
    found = config.from_text('[problem]\nname = "uniform"\n').override(keys)
    simulation = Simulation.start(Scene(found), 1, Clock())
    density = simulation.particles.density
    simulation.close()
    # supports follow the density in a run: the scatter of the sums changes by a few per cent
    assert density.std() / density.mean() < 1e-3


@pytest.fixture(scope="module")
def glass_run(tmp_path_factory):
    """The directory and the summary of a short run that begins from a glass."""
    text = '[problem]\nname = "uniform"\ndimension = 2\nn = 400\nrelax = {}\n'
    keys = ["time.end=0.02", "output.interval=0.01", "run.threads=1"]
    directory = RunDirectory.create(tmp_path_factory.mktemp("glass") / "run")
    return directory, runner.run(config.from_text(text).override(keys), directory, Lines())


def test_summary_tells_how_relaxation_ended(glass_run):
    directory, summary = glass_run
    found = summary["relaxation"]
    same = relaxed(cube(2, side=2.0), 400)  # the problem's box; another place changes round-off
    assert found["iterations"] == same.iterations
    assert found["density_error"] == pytest.approx(same.scatter, rel=1e-3)
    assert found["mean_offset"] == pytest.approx(same.mean - 1.0, abs=1e-5)
    assert 0.0 < found["cpu_seconds"] <= summary["cost"]["cpu_seconds"]
    said = f"Glass, after {found['iterations']} iterations: density error "
    assert said in in_words(summary)
    of_info = {one["name"]: one for one in info.of(directory.path)["figures"]}
    for name, value in found.items():
        one = of_info[f"relaxation.{name}"]
        assert one["value"] == value
        assert one["meaning"]
    assert "Relaxation to a glass" in run_page.text(info.of(directory.path), [])
    assert "eq 461" in words.in_words(info.of(directory.path))


def test_info_of_unfinished_run_tells_how_relaxation_ended(glass_run, tmp_path):
    directory, summary = glass_run
    shutil.copytree(directory.path, tmp_path / "run")
    (tmp_path / "run" / "summary.json").unlink()
    found = {one["name"]: one["value"] for one in info.of(tmp_path / "run")["figures"]}
    assert found == {f"relaxation.{name}": value for name, value in summary["relaxation"].items()}


def test_restart_keeps_how_relaxation_ended(glass_run, tmp_path):
    directory, summary = glass_run
    first = directory.checkpoint_path(1)
    again, _ = restarting.restart(first, [], tmp_path / "again", Lines())
    assert again["relaxation"] == summary["relaxation"]
    overwritten = RunDirectory.create(tmp_path / "again", force=True)
    overwritten.make_room()
    assert overwritten.read_relaxation() is None


def test_residual_out_of_reach_is_refused(messages):
    text = '[problem]\nname = "uniform"\nn = 100\nrelax = { residual = 1e-9, iterations = 12 }\n'
    found = config.from_text(text)
    with messages.raised(ConfigError, "problem.relax.residual", mask=r"error is \S+"):
        found.problem.initial(found.physics.eos_model())


def test_open_boundary_is_refused(messages):
    for name in ("uniform", "regions"):
        text = f'[problem]\nname = "{name}"\nboundary = "open"\nrelax = {{}}\n'
        with messages.raised(ConfigError, "line 4: problem.relax"):
            config.from_text(text)
