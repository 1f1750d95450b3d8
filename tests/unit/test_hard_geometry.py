"""Where supports are hard to find: too few particles, too many in one place, masses far apart.

Particles are handed in as they are.
"""

import dataclasses

import numpy as np
import pytest

from sph import config as configuration
from sph.errors import NumericalError
from sph.formulations.gas.smoothing import UNSETTLED
from sph.neighbours import first_guess
from sph.problems import uniform
from sph.problems.base import InitialState
from sph.scene import Scene
from sph.simulation import Simulation
from sph.watchdog import Watchdog


class GivenParticles(uniform.Problem):
    """Gas at rest where a test puts it, of one energy."""

    places: list
    masses: list

    def initial(self, eos):
        x = np.array(self.places, dtype=float)
        n = x.shape[1]
        return InitialState(x, np.zeros_like(x), np.array(self.masses), np.ones(n))


@pytest.fixture
def begin(simulate):
    """begin(positions (D, N), boundary, masses, domain, **physics): a simulation in a box."""

    def start(places, boundary, masses=None, domain=(0.0, 1.0), **physics):
        dimension, n = np.shape(places)
        text = (
            f'[problem]\nname = "uniform"\ndimension = {dimension}\nboundary = "{boundary}"\n'
            f"domain = {list(domain)}\nvelocity = {[0.0] * dimension}\n[time]\nend = 1e30\n"
            "[output]\ninterval = 1e30\n"
        )
        config = configuration.from_text(text)
        settings = config.problem.model_dump() | {
            "places": np.asarray(places).tolist(),
            "masses": np.asarray(np.full(n, 1.0 / n) if masses is None else masses).tolist(),
        }
        config = dataclasses.replace(
            config,
            problem=GivenParticles(**settings),
            physics=type(config.physics)(**(config.physics.model_dump() | physics)),
        )
        return simulate(config)

    return start


def advance(simulation, steps=3):
    """Steps that conserve what pairs exchange, and leave numbers that mean something."""
    before = simulation.totals.energy
    for _ in range(steps):
        simulation.advance(np.inf)
    p = simulation.particles
    for name, array in p.arrays().items():
        assert np.isfinite(array).all(), name
    assert (p.density > 0).all()
    # 1e-2: of three steps from rest, some of them long: a lost pair would take it by tenths
    assert simulation.totals.energy == pytest.approx(before, rel=1e-2)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_single_particle_has_largest_support(begin, dimension):
    simulation = begin(np.full((dimension, 1), 0.5), "open", max_support=0.5)
    p = simulation.particles
    assert (p.support[0], p.omega[0], simulation.held_supports) == (0.5, 1.0, 1)
    at_zero = (5 / 4, 7 / np.pi, 21 / (2 * np.pi))[dimension - 1]  # of Wendland's kernel
    # 1e-14: some ten operations
    assert p.density[0] == pytest.approx(at_zero * 0.5**-dimension, rel=1e-14)
    advance(simulation)
    assert (p.support[0], p.omega[0]) == (0.5, 1.0)
    assert simulation.held_supports == 1


@pytest.mark.parametrize("apart", [0.0, 1e-12, 0.3, 0.99])
@pytest.mark.parametrize("dimension", [1, 3])
def test_two_particles_have_largest_support(begin, dimension, apart):
    places = np.full((dimension, 2), 0.001)
    places[0, 1] += apart
    simulation = begin(places, "open")
    advance(simulation)
    assert simulation.held_supports == 2


def test_distant_particle_has_limited_support_others_not(begin):
    places = np.append(np.linspace(0.0, 0.1, 60), 3.0)[None]
    simulation = begin(places, "open")
    assert simulation.held_supports == 1
    p = simulation.particles
    assert p.support[p.id == 61] == 1.0
    # the others solve eqs 7 and 15, with the H/h of Wendland's kernel in 1-D
    others = p.id != 61
    expected = np.sqrt(10.5) / 2 * 1.6 * p.mass / p.density
    np.testing.assert_allclose(p.support[others], expected[others], rtol=1e-9)  # 1e-10, solved
    advance(simulation)


def test_line_of_particles_in_3d_advances(begin):
    places = np.full((3, 30), 0.5)
    places[0] = np.linspace(0.0, 1.0, 30)
    # a step of the default length is too long where supports grow by a fifth in it
    simulation = begin(places, "open", max_support=5.0, C=0.05)
    assert simulation.held_supports == 0
    advance(simulation)
    np.testing.assert_array_equal(simulation.particles.position[1:], 0.5)  # nothing pushes it off


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_few_particles_in_closed_box_use_images_as_neighbours(begin, boundary):
    simulation = begin(np.array([[0.5, 0.6], [0.5, 0.5]]), boundary)
    assert simulation.particles.support.min() > 1.0  # the box is 1 wide
    # two particles of one mass, spread over the box: the lattice of their images is a good one
    mean = simulation.particles.mass.sum()
    np.testing.assert_allclose(simulation.particles.density, mean, rtol=0.05)
    advance(simulation)


def test_missing_neighbours_in_closed_box_names_particle(begin):
    with pytest.raises(NumericalError, match=r"particle \d+ needs .* times the shortest side"):
        begin(np.array([[0.5, 0.6], [0.5, 0.5]]), "periodic", eta=1e3)


def test_thin_periodic_slab_equals_thick_slab_of_copies(begin):
    """One layer of gas, several times thinner than a support, and ten of them side by side."""
    random = np.random.default_rng(4)
    thin = np.array([(np.arange(40) + random.uniform(0.3, 0.7, 40)) / 40, np.full(40, 0.5)])
    box = [[0.0, 1.0], [0.49, 0.51]]
    thick = np.hstack([thin + np.array([[0.0], [0.02 * k]]) for k in range(10)])
    one = begin(thin, "periodic", domain=box)
    masses = np.full(400, 1 / 40)
    ten = begin(thick, "periodic", masses, domain=[[0.0, 1.0], [0.49, 0.69]])
    assert one.particles.support.max() > 3.0 * 0.02
    for simulation in (one, ten):
        for _ in range(5):
            simulation.advance(1.0)
    a, b = one.particles.by_id(), ten.particles.by_id()
    # supports are converged to 1e-10, from different first guesses; five steps add to that
    assert one.time == pytest.approx(ten.time, rel=1e-9)
    for name in ("density", "support", "internal_energy", "energy_rate"):
        copies, expected = getattr(b, name).reshape(10, 40), getattr(a, name)
        size = np.abs(expected).max()
        np.testing.assert_allclose(copies, np.tile(expected, (10, 1)), rtol=0, atol=1e-8 * size)


def test_too_many_coincident_particles_named_and_counted(begin):
    places = np.append(np.linspace(0.01, 0.99, 50), np.full(5, 0.505))[None]
    with pytest.raises(
        NumericalError, match=r"particle \d+ at \(0.505\): 4 other particle\(s\)"
    ) as raised:
        begin(places, "open")
    assert "Try: " in str(raised.value)


def test_coincident_pairs_advance(begin):
    random = np.random.default_rng(2)
    places = np.tile(random.random((3, 100)), 2)
    simulation = begin(places, "periodic", eta=1.2)
    advance(simulation)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_particles_on_boundary_advance(begin, boundary):
    axis = np.linspace(0.0, 1.0, 13)
    axis = axis[:-1] if boundary == "periodic" else axis
    places = np.array(np.meshgrid(axis, axis)).reshape(2, -1)
    # in a corner of walls there are three images in the very place, and no room for a fourth
    advance(begin(places, boundary))
    if boundary == "mirror":
        with pytest.raises(NumericalError, match=r"at \(0, 0\): 3 other particle\(s\)"):
            begin(places, boundary, eta=1.2)


@pytest.mark.parametrize(("density", "dimension"), [("mass", 1), ("number", 1), ("number", 2)])
def test_mass_ratio_of_a_million_advances(begin, density, dimension):
    """Light gas on one side, heavy on the other. (By mass, in 2-D, the step collapses, said so.)"""
    n = (400, 40)[dimension - 1]
    axis = (np.arange(n) + 0.5) / n
    places = np.array(np.meshgrid(*[axis] * dimension)).reshape(dimension, -1)
    mass = np.where(places[0] < 0.5, 1.0, 1e-6) / n**dimension
    simulation = begin(places, "periodic", mass, density=density, C=0.01)
    advance(simulation)


@pytest.mark.parametrize("factor", [0.01, 3.0, 100.0])
def test_random_particles_bad_first_guess_converges(begin, monkeypatch, factor):
    places = np.random.default_rng(1).random((3, 2000))
    expected = begin(places, "periodic").particles.by_id()
    guess = first_guess.from_spacing
    monkeypatch.setattr(first_guess, "from_spacing", lambda *a: factor * guess(*a))
    simulation = begin(places, "periodic")
    found = simulation.particles.by_id()
    np.testing.assert_allclose(found.support, expected.support, rtol=1e-9)  # 1e-10, solved
    np.testing.assert_allclose(found.density, expected.density, rtol=1e-9)
    assert simulation.list_builds < 20


# --- each guard is what keeps its case from going wrong -----------------------------------------


def test_wide_first_guess_without_trimming_lists_everything(begin, monkeypatch):
    places = np.random.default_rng(1).random((2, 2000))
    guess = first_guess.from_spacing
    monkeypatch.setattr(first_guess, "from_spacing", lambda *a: 100.0 * guess(*a))

    def listed():
        """Mean number of blocks in a list, of 250."""
        return begin(places, "open").search.lists.count.mean()

    # 56; 32 with supports that have 30 neighbours: trimmed supports have up to 8 times as many
    assert listed() < 75
    monkeypatch.setattr(first_guess, "trim", lambda *a: None)
    assert listed() > 0.9 * 250  # but for those that are farther apart than the domain is wide


@pytest.mark.parametrize("count", [1, 2])
def test_lonely_particles_without_largest_support_end_run(begin, monkeypatch, count):
    monkeypatch.setattr(Scene, "max_support", np.inf)
    with pytest.raises(NumericalError, match="no support radius is small enough for particle 1 "):
        begin(np.linspace(0.4, 0.6, count)[None], "open")


def test_coincident_particles_without_count_give_unphysical_values(begin, monkeypatch):
    places = np.append(np.linspace(0.01, 0.99, 50), np.full(5, 0.505))[None]
    monkeypatch.setattr(Simulation, "_check_found", lambda *_: None)
    with pytest.raises(NumericalError, match="density of particle"):  # the watchdog's, no reason
        begin(places, "open")
    monkeypatch.setattr(Watchdog, "check", lambda *_: None)
    assert begin(places, "open").particles.density.min() < 0.0


def test_counted_passes_at_mass_jump_diverge_without_solver(begin):
    x = (np.arange(200) + 0.5) / 200
    mass = np.where(x < 0.5, 1.0, 0.01) / 200

    def farthest(unsettled):
        simulation = begin(x[None], "periodic", mass)
        models = simulation.scene.formulation.models
        simulation.sweep.models = models._replace(
            smoothing=models.smoothing._replace(unsettled=unsettled)
        )
        (density,) = (one for one in simulation.scene.passes if one.stage == "density")
        solved = simulation.particles.support.copy()  # the start's are
        found = []
        for _ in range(20):  # nothing moves: a support that is found stays
            simulation._make(density)
            found.append(np.max(np.abs(np.log(simulation.particles.support / solved))))
        return max(found)  # what diverges swings to and fro

    assert farthest(UNSETTLED) < UNSETTLED
    assert farthest(np.inf) > 1.0  # a support three times too wide or narrow
