"""The step: where it ends, what it measures, and that threads do not show in it."""

import math

import numpy as np
import pytest
from marks import slow_except

from sph import config as configuration
from sph import threads
from sph.errors import NumericalError
from sph.output.checkpoint import state_hash
from sph.state import State
from sph.threads import SMALLEST_RANGE, Team

TUBE = """
[problem]
name = "shock_tube"
n = 60
[time]
end = 0.2
[output]
interval = 0.05
"""
SHEAR = """
[problem]
name = "kelvin_helmholtz"
n = 4400
[physics]
alpha = { min = 0.1, max = 2.0 }
[time]
end = 0.02
[output]
interval = 0.02
"""


@pytest.fixture
def begin(simulate):
    """begin(text, *overrides, threads=1): a simulation at t = 0, closed after the test."""

    def start(text, *overrides, threads=1):
        config = configuration.from_text(text).override(overrides)
        return simulate(config, threads)

    return start


def fingerprint(simulation):
    """What a step leaves, down to the last bit."""
    arrays = simulation.particles.arrays() | {"time": simulation.time, "dt": simulation.limit.dt}
    totals = simulation.totals._replace(momentum=simulation.totals.momentum.tolist())
    return state_hash(arrays), simulation.limit, totals


# --- densities --------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", slow_except({0}, ["grad_h", "variational", "pressure_energy"]))
def test_density_by_number_equal_masses_equals_density_by_mass(begin, scheme):
    states = []
    for density in ("mass", "number"):
        simulation = begin(
            TUBE, f"physics.scheme={scheme}", f"physics.density={density}", "physics.C=0.1"
        )
        for _ in range(5):
            simulation.advance(5e-4 * (simulation.step + 1))  # |a| bounds steps by number alone
        assert simulation.time == 2.5e-3
        states.append(simulation.particles.by_id())
    by_mass, by_number = states
    for name in ("density", "support", "velocity", "internal_energy"):
        # the supports of the start are solved for, to 1e-10; 3e-12 was the most that was seen
        expected, found = getattr(by_mass, name), getattr(by_number, name)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)


# --- threads ----------------------------------------------------------------------------------


@pytest.mark.parametrize("switch", ["morris_monaghan", "cullen_dehnen"])
def test_two_threads_equal_one_bit_for_bit(begin, monkeypatch, switch):
    shared = []
    run = Team.run

    def counted(team, function, items, *arguments, smallest=SMALLEST_RANGE):
        shared.append(team.threads > 1 and items // smallest >= 2)
        return run(team, function, items, *arguments, smallest=smallest)

    monkeypatch.setattr(Team, "run", counted)
    monkeypatch.setattr(threads, "CHUNK", 1000)  # so that loops over particles are shared, too
    one, two = (begin(SHEAR, f"physics.alpha.switch={switch}", threads=number) for number in (1, 2))
    assert any(shared)  # else this shows nothing
    assert fingerprint(one) == fingerprint(two)
    builds = one.list_builds
    for _ in range(6):
        one.advance(0.02)
        two.advance(0.02)
        assert fingerprint(one) == fingerprint(two)
    assert one.list_builds > builds  # with new lists on the way


# --- new orders -------------------------------------------------------------------------------

BOX = """
[problem]
name = "uniform"
dimension = 2
n = 100
noise = 0.3
velocity = [3.0, 2.0]
boundary = "mirror"
[time]
end = 1.0
[output]
interval = 1.0
"""


@pytest.mark.parametrize(
    "overrides",
    slow_except({0, 2}, [
        [],
        ["physics.alpha={ min = 0.1, max = 2.0 }"],
        ["physics.alpha={ min = 0.1, max = 2.0, switch = 'cullen_dehnen' }",
         "physics.conductivity={ name = 'pressure_jump', switched = true }"],
        ["physics.scheme=pressure_energy", "physics.conductivity=approach"],
        ["physics.balsara=false", "physics.density=number",
         "physics.external={ name = 'point_mass', mass = 0.1, softening = 0.5 }",
         "physics.heating={ name = 'relaxation', energy = 1.0, time = 0.1 }"],
    ]),
    ids=["plain", "rate of alpha", "shocks and contacts", "sum of the pressure", "sources"],
)  # fmt: skip
def test_fields_not_reordered_are_written_before_read(begin, monkeypatch, overrides):
    plain, shuffled = begin(BOX, *overrides), begin(BOX, *overrides)
    reorder = State.reorder

    def forget(state, order, names, team):
        reorder(state, order, names, team)
        if state is shuffled.particles:
            for field in state.fields:
                if field.name not in names:
                    getattr(state, field.name)[:] = np.nan

    monkeypatch.setattr(State, "reorder", forget)
    for simulation in (plain, shuffled):
        builds = simulation.list_builds
        while simulation.list_builds < builds + 2:
            simulation.advance(1.0)
    assert fingerprint(plain) == fingerprint(shuffled)


# --- where a step ends ------------------------------------------------------------------------


def test_step_cut_to_reach_requested_time(begin):
    simulation = begin(TUBE)
    allowed = simulation.limit.dt
    simulation.advance(0.3 * allowed)
    assert (simulation.time, simulation.step) == (0.3 * allowed, 1)
    while simulation.time < 0.07:
        simulation.advance(0.07)
        assert simulation.time <= 0.07
    assert simulation.time == 0.07
    assert simulation.step > 10


def test_step_follows_criteria(begin):
    simulation = begin(TUBE)
    allowed = simulation.limit.dt
    simulation.advance(math.inf)
    assert (simulation.time, simulation.step, simulation.steps_here) == (allowed, 1, 1)


@pytest.mark.parametrize(
    ("short_of", "steps"), [(0.0, 1), (1e-10, 1), (-1e-10, 1), (1e-6, 1), (-1e-6, 2)]
)
def test_step_remainder_of_round_off_is_no_step(begin, short_of, steps):
    """short_of: by what part of a step the first one would pass the end."""
    simulation = begin(TUBE)
    until = simulation.limit.dt * (1 - short_of)
    while simulation.time < until:
        simulation.advance(until)
    assert (simulation.time, simulation.step) == (until, steps)


def test_step_limit_names_particle_and_criterion(begin):
    simulation = begin(SHEAR)
    p, limit = simulation.particles, simulation.limit
    i = int(np.flatnonzero(p.id == limit.particle)[0])
    assert limit.criterion == "signal_speed"
    # eq 32 with the fastest signal of that particle; one division and one product of rounding
    expected = 0.15 * 2 * p.support[i] / p.signal_speed[i]
    assert limit.dt == pytest.approx(expected, rel=4e-16)
    assert limit.dt == pytest.approx(0.15 * np.min(2 * p.support / p.signal_speed), rel=4e-16)


def test_step_limited_by_energy_criterion(begin):
    heating = [
        "problem.left={density=1.0,velocity=5.0,pressure=1.0e-3}",
        "problem.right={density=1.0,velocity=-5.0,pressure=1.0e-3}",
    ]
    limited = begin(TUBE, *heating)
    free = begin(TUBE, *heating, "physics.energy_limit=false")
    p = limited.particles
    with np.errstate(divide="ignore"):
        expected = 0.15 * np.min(p.internal_energy / np.abs(p.energy_rate))
    assert limited.limit.criterion == "energy"
    assert limited.limit.dt == pytest.approx(expected, rel=4e-16)
    assert free.limit.criterion == "signal_speed"
    assert free.limit.dt > 2 * limited.limit.dt


# --- what is measured -------------------------------------------------------------------------


def test_totals_match_sums_over_particles(begin):
    simulation = begin(SHEAR)
    simulation.advance(math.inf)
    p, totals = simulation.particles, simulation.totals
    kinetic = 0.5 * math.fsum(p.mass * (p.velocity**2).sum(axis=0))
    internal = math.fsum(p.mass * p.internal_energy)
    # 4200 positive terms added in any order: N/2 roundings of 1e-16 at the very worst
    assert totals.kinetic_energy == pytest.approx(kinetic, rel=1e-12)
    assert totals.internal_energy == pytest.approx(internal, rel=1e-12)
    assert totals.energy == totals.kinetic_energy + totals.internal_energy
    for axis in range(2):
        size = np.sum(p.mass * np.abs(p.velocity[axis]))
        momentum = math.fsum(p.mass * p.velocity[axis])
        assert totals.momentum[axis] == pytest.approx(momentum, abs=1e-12 * size)
    for name, values in (("density", p.density), ("internal_energy", p.internal_energy)):
        assert getattr(totals, f"min_{name}") == values.min()
        assert getattr(totals, f"max_{name}") == values.max()


# --- numbers that mean nothing ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [("internal_energy", -1.0), ("internal_energy", np.nan), ("velocity", np.inf)],
)
def test_unphysical_particle_is_named(begin, name, value):
    simulation = begin(TUBE, "physics.energy_limit=false")
    simulation.advance(math.inf)  # what a run begins with cannot be helped by smaller steps
    getattr(simulation.particles, name)[..., 7] = value
    with pytest.raises(NumericalError) as caught:
        simulation.measure()
    words = name.replace("_", " ")
    assert f"{words} of particle {simulation.particles.id[7]} at (" in str(caught.value)
    assert f"{value}" in str(caught.value)
    assert "; 1 particle affected" in str(caught.value)
    assert "Try: a smaller physics.C" in str(caught.value)


def test_support_too_large_for_box_is_refused_at_start(begin):
    with pytest.raises(NumericalError, match=r"particle \d+ needs a support radius of .* times"):
        begin(TUBE, "problem.boundary=periodic", "physics.eta=5e4")


def test_injected_energy_counts_both_half_steps(begin):
    simulation = begin(TUBE)
    (energy,) = simulation.evolved

    def injecting(update, given):
        def updated(*arguments):
            update(*arguments)
            return given

        return updated

    rule = energy.rule._replace(
        predict=injecting(energy.rule.predict, 5.0), correct=injecting(energy.rule.correct, 7.0)
    )
    simulation.evolved = (energy._replace(rule=rule),)
    simulation.advance(math.inf)
    assert simulation.energy_injected == 12.0
