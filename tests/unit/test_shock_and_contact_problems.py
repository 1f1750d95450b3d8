"""Noh's implosion, the hydrostatic square and Shu and Osher's tube, without running any."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial import cKDTree

from sph import eos
from sph.exact import riemann
from sph.problems import blast_waves
from sph.problems.blast_waves import Problem as BlastWaves
from sph.problems.noh import Problem as Noh
from sph.problems.shu_osher import Problem as ShuOsher
from sph.problems.square import Problem as Square

AIR = eos.make("ideal_gas", gamma=1.4)
MONATOMIC = eos.make("ideal_gas", gamma=5.0 / 3.0)
DISC = {"dimension": 2, "n": 5000, "domain": [-1.0, 1.0], "boundary": "open"}
BALL = {"dimension": 3, "n": 5000, "domain": [-1.0, 1.0], "boundary": "open"}


def particles_of(state, **fields):
    given = {"position": state.position, "velocity": state.velocity, "mass": state.mass}
    return SimpleNamespace(**(given | fields))


# --- Noh --------------------------------------------------------------------------------------


def test_noh_planar_has_particles_of_other_codes():
    state = Noh().initial(MONATOMIC)
    np.testing.assert_allclose(state.position[0], (np.arange(100) + 0.5) / 100, rtol=1e-14)
    np.testing.assert_array_equal(state.velocity, -1.0)
    np.testing.assert_allclose(state.mass, 0.01, rtol=1e-14)
    np.testing.assert_allclose(MONATOMIC.pressure(1.0, state.internal_energy), 1e-6, rtol=1e-14)


@pytest.mark.parametrize(
    ("keys", "volume"),
    [
        (DISC, np.pi),
        (DISC | {"lattice": "hexagonal"}, np.pi),
        (BALL, 4 / 3 * np.pi),
        (BALL | {"lattice": "bcc"}, 4 / 3 * np.pi),
        (BALL | {"domain": [0.0, 1.0], "boundary": "mirror"}, np.pi / 6),
    ],
)
def test_noh_gas_is_infalling_ball(keys, volume):
    problem = Noh(**keys)
    state = problem.initial(MONATOMIC)
    radius = np.linalg.norm(state.position, axis=0)
    assert radius.min() > 0.0
    assert radius.max() < 1.0
    # cells are even in number along an axis, 18 here in BCC: one in 18 amiss along each
    assert state.mass.size == pytest.approx(5000, rel=3 / 18)
    # the surface of a lattice's ball is ragged: some root of the number of cells it cuts
    assert state.mass.sum() == pytest.approx(volume, rel=0.01)
    np.testing.assert_allclose(state.velocity, -state.position / radius, rtol=1e-14)
    assert all(array.flags.c_contiguous for array in state[:4])  # as compiled code expects


def test_noh_part_of_ball_equals_whole_ball():
    whole = Noh(**(DISC | {"n": 4000})).initial(MONATOMIC)
    quarter = Noh(dimension=2, n=1000).initial(MONATOMIC)
    first = np.all(whole.position > 0.0, axis=0)
    np.testing.assert_allclose(
        sorted(map(tuple, np.round(whole.position[:, first].T, 9))),
        sorted(map(tuple, np.round(quarter.position.T, 9))),
    )
    assert whole.mass[0] == pytest.approx(quarter.mass[0], rel=1e-14)


def test_noh_error_region_excludes_outer_edge():
    x = np.array([[0.01, 0.349, 0.351]])
    mask, words = Noh().error_region(MONATOMIC, 0.6, x)
    assert mask.tolist() == [True, True, False]
    assert words == "r < 0.35"


def test_noh_report_exact_profile_has_no_error():
    problem = Noh(n=2000)
    state = problem.initial(MONATOMIC)

    def report(density=1.0, pressure=1.0, velocity=0.0):
        exact = problem.exact(MONATOMIC, 0.6, state.position)
        particles = particles_of(
            state,
            mass=exact["density"] / 2000,  # equal volumes: a quadrature with cells of 1/2000
            density=exact["density"] * density,
            velocity=exact["velocity"] + velocity,
        )
        return problem.compare(MONATOMIC, 0.6, particles, exact["pressure"] * pressure)

    good = report()
    assert good["plateau_density_exact"] == pytest.approx(4.0)
    assert good["shock_radius"] == pytest.approx(0.2, abs=1 / 2000)
    errors = {k: v for k, v in good.items() if k.startswith(("plateau", "planar", "central"))}
    assert len(errors) == 7
    del errors["plateau_density_exact"]
    assert max(map(abs, errors.values())) < 1e-13
    # by hand, over .05 < x < .2 < x < .35: 0.15 x 4 and 0.15 x 1 of density; a cell at the ends
    cell = 4 / 2000
    wrong = report(pressure=1.1, velocity=0.01)
    assert wrong["planar_norm_pressure"] == pytest.approx(0.1 * 0.15 * 4 / 3, abs=0.1 * cell)
    assert wrong["planar_norm_velocity"] == pytest.approx(0.01 * 0.3, abs=0.01 * cell)
    assert wrong["plateau_pressure_error"] == pytest.approx(0.1, rel=1e-12)
    dense = report(density=1.25)
    # of volumes that are smaller by as much
    assert dense["planar_norm_density"] == pytest.approx(0.25 * 0.75 / 1.25, abs=0.25 * cell)
    assert dense["plateau_density_error"] == pytest.approx(0.25, rel=1e-12)
    assert dense["central_density_error"] == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_noh_shock_radius_found_in_any_dimension(dimension):
    problem = Noh(dimension=dimension, n=8**dimension * 50)
    state = problem.initial(MONATOMIC)
    exact = problem.exact(MONATOMIC, 0.6, state.position)
    particles = particles_of(state, density=exact["density"])
    report = problem.compare(MONATOMIC, 0.6, particles, exact["pressure"])
    assert 0.15 < report["shock_radius"] <= 0.2  # the outermost particle within: spacings of 0.04
    assert not any(name.startswith("planar") for name in report)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"domain": [-1.0, 1.0]}, r"expected \[0, R\] with boundary"),
        ({"boundary": "open"}, r"expected \[-R, R\] with boundary"),
        ({"domain": [-1.0, 2.0], "boundary": "open"}, "expected"),
        (BALL | {"domain": [[-1.0, 1.0], [-1.0, 1.0], [-2.0, 2.0]]}, "equal for all axes"),
        ({"boundary": "periodic"}, "'mirror' or 'open'"),
        ({"lattice": "bcc"}, 'expected "cubic"'),
    ],
)
def test_noh_invalid_keys_are_refused(keys, message):
    with pytest.raises(ValidationError, match=message):
        Noh(**keys)


# --- square -----------------------------------------------------------------------------------


def square_state(n=1792):
    problem = Square(n=n)
    state = problem.initial(MONATOMIC)
    return problem, state, np.arange(1, state.mass.size + 1)


@pytest.mark.parametrize(("n", "found"), [(1792, 1792), (7168, 7168), (1500, 1372), (10, 112)])
def test_square_is_made_of_whole_cells(n, found):
    problem, state, _ = square_state(n)
    cells = round((found / 1.75) ** 0.5)
    assert state.mass.size == found
    inside = np.abs(state.position).max(axis=0) < 0.25
    assert inside.sum() == cells**2
    assert np.all(inside[: cells**2])  # which is how the report knows them
    assert np.all(state.mass == state.mass[0])
    assert state.mass.sum() == pytest.approx(4 * 0.25 + 0.75, rel=1e-12)
    for chosen, spacing in ((inside, 0.5 / cells), (~inside, 1.0 / cells)):
        shifted = (state.position[:, chosen] + 0.5).T
        distance = cKDTree(shifted, boxsize=[1.0, 1.0]).query(shifted, k=2)[0][:, 1]
        np.testing.assert_allclose(distance, spacing, rtol=1e-9)
    density = np.where(inside, 4.0, 1.0)
    np.testing.assert_allclose(MONATOMIC.pressure(density, state.internal_energy), 2.5, rtol=1e-15)
    exact = problem.exact(MONATOMIC, 8.0, state.position)
    np.testing.assert_array_equal(exact["density"], density)
    assert not exact["velocity"].any()


def shape(problem, state, identity, position):
    particles = particles_of(state, position=position, id=identity)
    return problem.report(MONATOMIC, 1.0, particles, None)


def test_square_report_distinguishes_square_disc_and_diamond():
    problem, state, identity = square_state(7168)
    unmoved = shape(problem, state, identity, state.position)
    assert unmoved == {"squareness": 1.0, "dense_outside": 0.0}
    # a disc of the area of the square, filled evenly along a spiral of the golden angle
    count = np.arange((identity <= 64**2).sum())
    radius = 0.5 / np.sqrt(np.pi) * np.sqrt((count + 0.5) / count.size)
    angle = np.pi * (3.0 - np.sqrt(5.0)) * count
    disc = state.position.copy()
    disc[:, : count.size] = radius * np.stack([np.cos(angle), np.sin(angle)])
    round_one = shape(problem, state, identity, disc)
    assert round_one["squareness"] == pytest.approx(0.0, abs=1 / 64)  # a row of particles, at most
    # its caps beyond the sides, R^2 (w - sin w cos w) each with cos w = 0.25/R, by hand 9.13 %
    assert round_one["dense_outside"] == pytest.approx(0.0913, abs=1 / 64)
    half = np.sqrt(0.5)
    diamond = np.array([[half, -half], [half, half]]) @ state.position
    assert shape(problem, state, identity, diamond)["squareness"] == pytest.approx(-1.0, rel=1e-12)


def test_square_report_independent_of_particle_order():
    problem, state, identity = square_state()
    order = np.random.default_rng(3).permutation(identity.size)
    position = state.position * np.array([[1.1], [1.0]])
    one = shape(problem, state, identity, position)
    other = shape(problem, state, identity[order], position[:, order])
    assert one["dense_outside"] == other["dense_outside"] > 0.0
    assert one["squareness"] == pytest.approx(other["squareness"], rel=1e-12)


# --- Shu and Osher ----------------------------------------------------------------------------


def test_shu_osher_gas_satisfies_jump_conditions():
    state = ShuOsher().initial(AIR)
    x, v = state.position[0], state.velocity[0]
    behind = x < -4.0
    assert np.unique(v[behind]).tolist() == [2.629369]
    assert not v[~behind].any()
    u = state.internal_energy[behind][0]
    density, speed = 3.857143, 2.629369
    pressure = AIR.pressure(density, u)
    # Mach 3 into density 1 and pressure 1, all to the 7 digits that are published
    shock = 3.0 * np.sqrt(1.4)
    assert density * (shock - speed) == pytest.approx(shock, rel=1e-6)
    assert pressure == pytest.approx(1.0 + shock * speed, rel=1e-6)
    enthalpy = 1.4 / 0.4 * pressure / density + 0.5 * (shock - speed) ** 2
    assert enthalpy == pytest.approx(1.4 / 0.4 + 0.5 * shock**2, rel=1e-6)


@pytest.mark.parametrize("n", [100, 1600, 5001])
def test_shu_osher_particles_at_centre_of_their_mass(n):
    state = ShuOsher(n=n).initial(AIR)
    x, mass = state.position[0], state.mass
    assert abs(x.size - n) <= 1
    # one mass, but for the round number of particles ahead
    assert np.ptp(mass) < mass[0] / n * 4
    below = np.cumsum(mass) - 0.5 * mass  # mass left of each particle
    behind = 3.857143 * (np.minimum(x, -4.0) + 12.5)

    def antiderivative(at):  # of 1 + 0.2 sin 5x
        return at - 0.04 * np.cos(5 * at)

    ahead = antiderivative(np.maximum(x, -4.0)) - antiderivative(-4.0)
    np.testing.assert_allclose(below, behind + ahead, rtol=0, atol=1e-11)  # sums of n terms
    assert mass.sum() == pytest.approx(
        3.857143 * 8.5 + antiderivative(5.5) - antiderivative(-4.0), rel=1e-12
    )


def test_shu_osher_error_region_excludes_waves_from_ends():
    mask, words = ShuOsher().error_region(AIR, 1.8, np.array([[-5.0, -4.0, 3.0, 3.2]]))
    # sound: 1.9365 behind, 1.3229 ahead: -12.5 + 1.8 x 4.566 and 5.5 - 1.8 x 1.3229
    assert mask.tolist() == [False, True, True, False]
    assert words == "-4.281 < x < 3.119"


def test_shu_osher_reference_matches_published_shock():
    x = np.array([[-12.0, -4.5, -3.8, 0.9, 4.0]])
    exact = ShuOsher().exact(AIR, 0.2, x)
    # sound behind gets from -4 to -4 + 0.2 x 0.69, the shock to -4 + 0.2 x 3.55: nothing has
    # happened at four of the points but that the gas flows
    np.testing.assert_allclose(exact["density"][:2], 3.857143, rtol=1e-9)
    np.testing.assert_allclose(
        exact["velocity"][0, [0, 1, 3, 4]], [2.629369] * 2 + [0, 0], atol=1e-4
    )
    # linear between centres 0.0032 apart, of a sine with second derivative 5
    assert exact["density"][3] == pytest.approx(1.0 + 0.2 * np.sin(4.5), abs=1e-4)
    at_start = ShuOsher().exact(AIR, 0.0, x)
    np.testing.assert_array_equal(at_start["pressure"], [10.33333] * 2 + [1.0] * 3)
    assert ShuOsher().exact(SimpleNamespace(), 1.8, x) is None


def test_shu_osher_report_measures_wave_behind_shock():
    problem = ShuOsher(n=20000)
    x = np.linspace(-4.2, 3.0, 20001)
    density = np.where(x < 2.39, 4.0 + 0.5 * np.sin(2 * np.pi * x / 0.3), 1.0)
    particles = SimpleNamespace(position=x[None], density=density, mass=density * 7.2 / 20000)
    report = problem.report(AIR, 1.8, particles, None)
    assert report["shock_position"] == pytest.approx(2.39, abs=7.2 / 20000)
    # 6 whole waves in the 1.8 behind it, sampled finely
    assert report["wave_density"] == pytest.approx(0.5 / np.sqrt(2), rel=1e-3)
    assert report["peak_density"] == pytest.approx(4.5, rel=1e-5)
    nothing = SimpleNamespace(position=x[None], density=np.ones(x.size), mass=np.ones(x.size))
    assert problem.report(AIR, 1.8, nothing, None) == {}


# --- blast waves ------------------------------------------------------------------------------


def test_blast_waves_three_gases_in_closed_tube():
    problem = BlastWaves()
    state = problem.initial(AIR)
    pressure = AIR.pressure(1.0, state.internal_energy)
    counts = [(abs(pressure / P - 1.0) < 1e-12).sum() for P in (1000.0, 0.01, 100.0)]
    assert counts == [40, 320, 40]
    assert state.mass.sum() == pytest.approx(1.0, rel=1e-12)  # a sum of 400 terms
    assert problem.boundaries == ("mirror",)


def test_blast_waves_have_published_walls():
    with pytest.raises(ValidationError, match=r"expected \[0, 1\]"):
        BlastWaves(domain=[0.0, 2.0])


def test_blast_waves_equal_shock_tubes_before_wall(monkeypatch):
    monkeypatch.setattr(blast_waves, "CELLS", 1600)
    blast_waves._reference.cache_clear()
    x, time = np.linspace(0.02, 0.98, 2001), 0.002
    exact = BlastWaves().exact(AIR, time, x[None])
    blast_waves._reference.cache_clear()
    cold = riemann.State(1.0, 0.0, 0.01)
    left = riemann.solve(riemann.State(1.0, 0.0, 1000.0), cold, AIR, (x - 0.1) / time)
    right = riemann.solve(cold, riemann.State(1.0, 0.0, 100.0), AIR, (x - 0.9) / time)
    both = [np.where(x < 0.5, *pair) for pair in zip(left, right, strict=True)]
    for found, expected in zip((exact["density"], exact["velocity"][0]), both[:2], strict=True):
        # shocks a cell or two wide in a tube of 1600: 0.006 and 0.004 were measured
        assert np.abs(found - expected).mean() < 0.01 * np.abs(expected).mean()


def test_blast_waves_report_given_error(monkeypatch):
    monkeypatch.setattr(blast_waves, "CELLS", 200)
    problem, state = BlastWaves(), BlastWaves().initial(AIR)
    blast_waves._reference.cache_clear()
    exact = problem.exact(AIR, 0.01, state.position)
    particles = SimpleNamespace(
        position=state.position, density=0.9 * exact["density"], mass=state.mass
    )
    report = problem.report(AIR, 0.01, particles, None)
    report |= problem.compare(AIR, 0.01, particles, None)
    blast_waves._reference.cache_clear()
    assert report["density_L1_relative"] == pytest.approx(0.1, rel=1e-12)
    assert report["peak_density"] == pytest.approx(0.9 * exact["density"].max(), rel=1e-12)
    assert problem.compare(SimpleNamespace(), 0.01, particles, None) == {}


def test_shu_osher_shock_outside_domain_is_refused():
    with pytest.raises(ValidationError, match=r"expected x = -4\.0 inside"):
        ShuOsher(domain=[-3.0, 5.0])
    with pytest.raises(ValidationError):
        ShuOsher(dimension=2)
