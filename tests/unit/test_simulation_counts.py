"""What a simulation counts from step to step, and the phase of each part, without arithmetic."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from sph import compile_cache, resolution, simulation, totals
from sph import config as configuration
from sph.errors import NumericalError
from sph.formulations.gas.density import density
from sph.formulations.gas.rates import rates
from sph.integrators import leapfrog, step_size
from sph.integrators.step_size import StepLimit
from sph.neighbours.order import BLOCK
from sph.neighbours.search import Origin
from sph.parts.conductivity._contacts import contacts
from sph.parts.viscosity._shocks import shocks
from sph.scene import Scene
from sph.simulation import Simulation
from sph.totals import Baseline, Budget

# All that a step can have. Masses are of two kinds, so that a sum without them shows.
ALL = """
[problem]
name = "contrast"
dimension = 2
n = 64
[physics]
alpha = { min = 0.1, max = 2.0, switch = "cullen_dehnen" }
conductivity = { name = "pressure_jump", switched = true }
heating = { name = "relaxation", energy = 1.0, time = 0.1 }
"""


class Clock:
    """Knows the phase that is counted now."""

    now = "none"

    @contextmanager
    def phase(self, name):
        assert self.now == "none"  # a second would be counted twice
        self.now = name
        yield
        self.now = "none"


@pytest.fixture
def hollow(monkeypatch):
    """hollow(*overrides): a simulation whose parts do nothing; `called` has the phase of each."""

    def made(*overrides):
        clock, called = Clock(), {}

        def replace(owner, name, result=None, told=None):
            def stand_in(*_, **__):
                called.setdefault(told or name, set()).add(clock.now)
                return result

            monkeypatch.setattr(owner, name, stand_in)

        one = None
        config = configuration.from_text(ALL).override(overrides)
        replace(type(config.problem), "initial", config.problem.initial(Scene(config).eos))
        replace(compile_cache, "start_numba")
        one = Simulation.of_problem(Scene(config), 1, clock)
        one.asked = []  # the blocks that ask for wider lists, one entry a pass over the density

        def run(function, *_, **__):
            called.setdefault(function, set()).add(clock.now)
            if function is density:
                one.sweep.wanted[:] = 0.0
                one.sweep.wanted[one.asked.pop() if one.asked else []] = 1.0

        one.sweep.team = SimpleNamespace(run=run)
        n, sums = one.particles.number, SimpleNamespace(volume=1.0)
        for name, result in (("order", np.arange(n)), ("guess", np.ones(n)), ("skin_for", 0.1),
                             ("build", None), ("stale", True), ("widen", None),
                             ("forget", None)):  # fmt: skip
            replace(one.search, name, result)
        one.search.origin = Origin(one.particles.position, np.ones(n), 0.1)
        one.search.lists = SimpleNamespace(count=np.ones(1))
        for name, result in (("keep", None), ("predict", 5.0), ("correct", 7.0)):
            replace(leapfrog, name, result)
        for name in ("limit", "before_contact"):
            replace(step_size, name, StepLimit(0.125, 1, "signal_speed"))
        replace(totals, "of", sums)
        replace(Baseline, "at", SimpleNamespace(drift=lambda totals, added: added))
        for owner, name in ((one.watchdog, "check"), (one.watchdog, "check_range"),
                            (resolution, "check"), (resolution, "check_extent")):  # fmt: skip
            replace(owner, name, told=f"{owner.__class__.__name__}.{name}")
        one.called, one.clock = called, clock
        return one

    return made


PHASES = {
    "initial": "initial state",
    "start_numba": "start of Numba",
    "order": "order",
    "guess": "lists",
    "build": "lists",
    "widen": "lists",
    density: "density",
    shocks: "viscosity",
    contacts: "conductivity",
    rates: "rates",
    "predict": "predict, correct",
    "correct": "predict, correct",
    "stale": "predict, correct",
    "of": "step size, sums",
    "limit": "step size, sums",
}


def test_step_parts_timed_in_own_phase(hollow):
    one = hollow()
    one.begin()
    one.asked = [[0]]  # the first pass over the density asks for wider lists
    one.advance(np.inf)
    assert {part: one.called[part] for part in PHASES} == {
        part: {phase} for part, phase in PHASES.items()
    }
    assert one.list_builds == 2


@pytest.mark.parametrize(
    "guard", ["Watchdog.check_range", "module.check_extent", "module.check", "Watchdog.check"]
)
def test_all_guards_checked_before_first_step(hollow, guard):
    one = hollow()
    one.begin()
    assert guard in one.called


def test_injected_and_added_energy_add_up_over_steps(hollow):
    one = hollow()
    one.begin()
    p, lost = one.particles, 0.25
    # cooling that takes as much from every particle in every half step
    source = SimpleNamespace(heated=lambda energy, dt: energy - lost * (dt == 0.0625))
    (heating,) = (part for part in one.scene.parts if part.name == "heating")
    heating.source = source
    assert np.ptp(p.mass) > 0.0
    for step in (1, 2, 3):
        one.advance(np.inf)
        assert one.energy_injected == 12.0 * step
        assert one.energy_added == pytest.approx(-2.0 * step * lost * p.mass.sum(), rel=1e-12)
    assert one.energy_drift == one.energy_added  # as the stand-in of the baseline says


def test_restart_continues_step_and_time_and_resets_session_steps(hollow):
    one = hollow()
    one.begin()
    one.time, one.step = 2.0, 40
    one.advance(np.inf)
    one.advance(2.2)  # 0.075 of the 0.125 that are allowed
    assert (one.time, one.step, one.steps_here) == (2.2, 42, 2)
    assert 0.001 + (0.0153 - 0.001) != 0.0153  # an output is met to the last bit
    one.time = 0.001
    one.advance(0.0153)
    assert one.time == 0.0153


def test_energy_drift_excludes_heating(hollow):
    one = hollow()
    one.totals = SimpleNamespace(energy_without_bulk=7.0)
    budget = Budget(injected=3.0, added=2.0, baseline=Baseline.of(1.0, 3.0, 0.0))
    one.go_on_from(budget)
    assert (one.energy_injected, one.energy_added) == (3.0, 2.0)
    assert one.baseline is budget.baseline
    assert one.energy_drift == 0.25  # (7 - 2 - 4)/4
    assert one.budget == budget  # which the next restart goes on from


def test_limited_supports_counted_at_every_evaluation(hollow):
    one = hollow()
    one.particles.support[:] = 1.0
    one.particles.support[[3, 5]] = 2.0
    one.particles.density[:] = 1.0
    domain = one.scene.domain
    one.scene = SimpleNamespace(max_support=2.0)
    for _ in range(2):
        one._check_found()
        assert one.held_supports == 2
    one.scene = SimpleNamespace(max_support=np.inf, domain=domain)
    one._check_found()
    assert one.held_supports == 2  # nothing is held, and nothing is counted
    one.particles.density[3] = -1.0
    with pytest.raises(NumericalError) as caught:
        one._check_found()
    assert caught.value.particle == one.particles.id[3]


def test_lists_never_wide_enough_name_block(hollow):
    one = hollow()
    one.asked = [[2]] * 1000
    with pytest.raises(NumericalError) as caught:
        one._make(one.scene.passes[0])
    assert caught.value.particle == one.particles.id[2 * BLOCK]
    assert len(one.asked) == 1000 - simulation.MAX_WIDENINGS


def test_volume_ratio_uses_filled_box(hollow):
    one = hollow("problem.domain=[0.0, 2.0]")
    one.totals = SimpleNamespace(volume=3.0)
    assert one.volume_ratio == 0.75
    one.scene = SimpleNamespace(is_filled=False)
    assert one.volume_ratio is None


def test_restart_next_step_has_no_limiting_particle(hollow):
    whole = hollow()
    whole_baseline = Baseline.at(None, 0.0)  # its stand-in
    scene, particles, clock = whole.scene, whole.particles, whole.clock
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation.Search, "build", lambda *_: None)
        origin = Origin(particles.position, np.ones(particles.number), 0.1)
        resumed = scene, particles, 2.0, 40, 0.0625, origin, 1, clock
        one = Simulation.resume(*resumed)
        budget = Budget(3.0, 2.0, SimpleNamespace(drift=lambda totals, added: 10.0 * added))
        other = Simulation.resume(*resumed, budget)
    assert (one.time, one.step, one.steps_here) == (2.0, 40, 0)
    assert one.limit == StepLimit(0.0625, 0, "checkpoint")
    assert (one.energy_added, one.energy_injected) == (0.0, 0.0)
    assert one.budget.baseline is whole_baseline  # begun anew
    assert (other.energy_added, other.energy_injected, other.energy_drift) == (2.0, 3.0, 20.0)
    assert other.budget == budget
    for each in (one, other):
        each.close()
