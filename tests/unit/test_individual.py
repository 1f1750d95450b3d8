"""Individual time steps: their lengths, which particles are computed when, and their accuracy."""

import numpy as np
import pytest

from sph import config as configuration
from sph.clock import Clock
from sph.errors import NumericalError
from sph.individual import Individual
from sph.integrators import bins, leapfrog, limiter
from sph.integrators.bins import TICKS
from sph.part import Pass
from sph.scene import Scene
from sph.simulation import Simulation

TUBE = '[problem]\nname = "shock_tube"\nn = 200\n[time]\nend = 0.2\n[output]\ninterval = 0.2\n'
BLAST = """
[problem]
name = "point_explosion"
dimension = 2
n = 1024
[physics]
alpha = 3.0
[time]
end = 0.02
[output]
interval = 0.02
[run]
threads = 1
"""
EACH = "time.stepping='individual'"


def simulation(text, *overrides):
    config = configuration.from_text(text).override(list(overrides))
    return Simulation.start(Scene(config), 1, Clock())


def run(text, *overrides, until=None):
    one = simulation(text, *overrides)
    end = one.scene.config.time.end if until is None else until
    while one.time < end:
        one.advance(end)
    return one


def ordered(one, name):
    return getattr(one.particles, name)[..., np.argsort(one.particles.id)]


@pytest.fixture
def same_steps(monkeypatch):
    """same_steps(dt): all particles take steps dt."""

    def set_steps(dt):
        def choose(self, tick):
            p = self._simulation.particles
            p.time_step[:] = dt
            self._found = dt, 0, "signal_speed"
            self._length[:] = dt / tick
            self._allowed[:] = np.inf

        monkeypatch.setattr(Individual, "_choose", choose)

    return set_steps


def test_passes_after_the_correction_run_for_particles_whose_step_ends(monkeypatch):
    sizes = []

    def note(mass):
        sizes.append(mass.size)

    after = Pass("correction", "rates", note, reads=("mass",))
    monkeypatch.setattr(Scene, "last_passes", (after,))
    one = simulation(BLAST, EACH)
    one.advance(one.scene.config.time.end)
    assert sum(sizes) == one.updates_here > 0


@pytest.mark.parametrize("alpha", ["1.0", "{ min = 0.1, max = 2.0 }"])
def test_equal_steps_are_those_of_global_leapfrog(same_steps, alpha):
    settings = [f"physics.alpha={alpha}", "physics.density_passes='converged'"]
    dt = 2.0**-11
    same_steps(dt)
    each = run(TUBE, EACH, *settings, until=64 * dt)
    one = simulation(TUBE, *settings)
    while one.time < 64 * dt:
        one.limit = one.limit._replace(dt=dt)
        one.advance(64 * dt)
    assert each.step == one.step == 64
    for name in ("position", "velocity", "internal_energy", "density"):
        # round-off of 64 steps, and 1e-10 of converged supports, which start from other guesses
        np.testing.assert_allclose(ordered(each, name), ordered(one, name), rtol=1e-8, atol=1e-9)


def test_only_active_particles_change_in_a_tick(monkeypatch):
    one = simulation(BLAST, EACH)
    seen = []
    correct = leapfrog.correct_each

    def spy(state, evolved, own, team):
        s = state
        before = {name: getattr(s, name).copy() for name in ("velocity", "internal_energy")}
        given = correct(state, evolved, own, team)
        idle = s.active == 0.0
        for name, old in before.items():
            assert (getattr(s, name)[..., idle] == old[..., idle]).all()
        assert ((own > 0.0) == (s.active > 0.0)).all()
        seen.append(int((~idle).sum()))
        return given

    monkeypatch.setattr(leapfrog, "correct_each", spy)
    one.advance(0.02)
    assert seen[-1] == one.particles.number  # all end together
    assert min(seen) < 100  # of 1024
    assert one.individual.updates == sum(seen) == one.updates_here


def test_pass_of_python_sees_active_particles_only():
    """The field of a point mass is added to the acceleration of active particles alone."""
    ring = '[problem]\nname = "keplerian_ring"\nn = 600\n[time]\nend = 0.3\n'
    each, one = run(ring, EACH), run(ring)
    assert each.updates_here != each.step * each.particles.number  # steps differ
    difference = np.abs(ordered(each, "velocity") - ordered(one, "velocity")).max()
    # measured: 5e-4 of speeds about 1; a field that is added to all particles ends the run
    assert difference < 0.002


def test_neighbours_keep_ratio_of_steps():
    one = simulation(BLAST, EACH)
    each, worst = one.individual, 0.0
    begin = each._begin_steps

    def check(now, tick):
        nonlocal worst
        begin(now, tick)
        p = one.particles
        x = p.position[:, :, None] - p.position[:, None, :]
        x -= np.round(x)  # periodic, side 1
        reach = np.maximum(p.support[:, None], p.support[None, :])
        near = ((x**2).sum(axis=0) < reach**2) & (p.active > 0.0)[:, None]
        # the step that the particle's state allows, and what remains of the steps of neighbours
        worst = max(worst, ((p.step_end - now)[None, :] / each._length[:, None] * near).max())

    each._begin_steps = check
    one.advance(0.004)
    assert one.individual.shortest < one.particles.time_step.max() / 20  # it had work to do
    assert 0.5 * limiter.RATIO < worst <= limiter.RATIO


def test_explosion_without_limiter_breaks_and_is_caught(monkeypatch):
    def unlimited(self):
        self._allowed[:] = np.inf

    limited = run(BLAST, EACH)
    assert abs(limited.energy_drift) < 0.003
    monkeypatch.setattr(Individual, "_limit_by_neighbours", unlimited)
    with pytest.raises(NumericalError, match=r"energy has drifted|finite|collapsed|fell to"):
        run(BLAST, EACH)


@pytest.mark.parametrize("text", [TUBE, BLAST], ids=["tube", "blast"])
def test_results_are_close_to_those_of_global_steps(text):
    each, one = run(text, EACH), run(text)
    spread = np.ptp(ordered(one, "density"))
    difference = np.abs(ordered(each, "density") - ordered(one, "density")).mean()
    # measured: 1.5e-4 and 4e-5
    assert difference < 5e-4 * spread


def test_density_of_inactive_particles_follows_divergence():
    divergence = np.array([0.3, -0.2, 0.0, 1e9])
    density, support = np.ones(4), np.full(4, 0.5)
    bins.drift(0, 4, 0.5, 3, 0.55, divergence, density, support)
    change = np.array([0.15, -0.1, 0.0, bins.PREDICTION])
    # the fractions agree with exponentials to x^3/12 + x^5/80; the last change is limited
    error = np.abs(density / np.exp(-change) - 1.0)
    assert (error <= 1.01 * (np.abs(change) ** 3 / 12 + np.abs(change) ** 5 / 80)).all()
    np.testing.assert_allclose(support, np.minimum(0.5 * np.exp(change / 3), 0.55), rtol=1e-3)
    assert support[3] == 0.55


def test_longest_step_is_the_whole_long_step_whatever_the_rounding():
    """Otherwise it would be half as long, and could never become longer."""
    for length in np.random.default_rng(1).uniform(0.001, 1.0, 1000):
        begin, end = np.empty(1), np.empty(1)
        bins.begin_all(0, 1, TICKS / length, np.array([length]), begin, end)
        assert end[0] == TICKS


def test_energy_error_falls_with_courant_number():
    drifts = [abs(run(BLAST, EACH, f"physics.C={C}").energy_drift) for C in (0.15, 0.0375)]
    # pairs are not exchanged symmetrically, so the error is that of the time steps
    assert drifts[1] < 0.5 * drifts[0]


@pytest.mark.parametrize(
    ("length", "expected"),
    [(1.0, 1.0), (1.999, 1.0), (2.0, 2.0), (2.0 - 1e-15, 2.0), (3.7e5, 2.0**18), (0.3, 0.25)],
)
def test_steps_are_powers_of_two(length, expected):
    assert bins.power_of_two(length) == expected


def test_woken_step_ends_at_next_multiple_of_allowed_step():
    length = np.array([64.0, 64.0, 8.0])
    allowed = np.array([5.0, np.inf, np.inf])
    active = np.array([0.0, 0.0, 1.0])
    begin, end = np.array([0.0, 0.0, 16.0]), np.array([64.0, 64.0, 24.0])
    time_step = np.full(3, 100.0)
    bins.begin_next(0, 3, 24.0, 1.0, length, allowed, active, time_step, begin, end)
    assert end.tolist() == [28.0, 64.0, 32.0]  # 24 is a multiple of 8
    assert begin.tolist() == [0.0, 0.0, 24.0]


def test_step_that_begins_late_is_shortened_to_a_multiple():
    length, allowed = np.array([64.0]), np.array([np.inf])
    begin, end, time_step = np.zeros(1), np.full(1, 24.0), np.ones(1)
    bins.begin_next(0, 1, 24.0, 1.0, length, allowed, np.ones(1), time_step, begin, end)
    assert end[0] == 32.0
    assert TICKS % 32.0 == 0.0


def test_nan_in_a_tick_is_named(monkeypatch):
    one = simulation(BLAST, EACH)
    one.advance(0.001)
    one.particles.energy_rate[5] = np.nan
    with pytest.raises(NumericalError, match=r"particle \d+ at .* is nan|is not finite"):
        one.advance(0.02)


def test_active_particles_of_a_block_begin_equal_steps():
    length, allowed = np.full(10, 64.0), np.full(10, np.inf)
    length[2], allowed[5], length[9] = 17.0, 40.0, 3.0
    active = np.ones(10)
    active[7] = 0.0
    begin, end, time_step = np.zeros(10), np.full(10, 512.0), np.ones(10)
    bins.begin_next(0, 10, 512.0, 1.0, length, allowed, active, time_step, begin, end)
    # 16 is the power of two below 17; the second block has the last two particles
    assert end.tolist() == [528.0] * 7 + [512.0] + [514.0] * 2
