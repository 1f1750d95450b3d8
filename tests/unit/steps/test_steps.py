"""Compiled steps: the same bits as one step after another, and where Python takes over."""

from collections import Counter

import numpy as np
import pytest
from marks import slow_except

from sph import config, steps
from sph.clock import Clock
from sph.errors import NumericalError
from sph.scene import Scene
from sph.simulation import Simulation
from sph.steps import driver
from sph.steps.program import in_python_of, suits

RANGE = "physics.alpha={ min = 0.1, max = 1.5 }"
SHOCKS = 'physics.alpha={ min = 0.1, max = 1.5, switch = "cullen_dehnen" }'
CONTACTS = 'physics.conductivity={ name = "pressure_jump", switched = true }'
FIELD = 'physics.external={ name = "point_mass", mass = 0.1, softening = 0.2 }'
HEATING = 'physics.heating={ name = "relaxation", energy = 2.0, time = 0.1 }'
TWO = ("problem.dimension=2", "problem.domain=[[-0.5, 0.5], [0.0, 0.1]]", "problem.n=300")
PLASTIC = 'physics.strength={ name = "elastic_plastic", shear_modulus = 0.5, yield_stress = 0.05 }'
FORMULATION = "physics.formulation=continuum"
SOLID = (FORMULATION, PLASTIC, "physics.tensile_correction=0.3")
OPEN = ("problem.boundary=open", "physics.max_support=0.05")

SCENES = {
    "mirror": ("problem.boundary=mirror",),
    "two dimensions": (*TWO, RANGE, CONTACTS),
    "shocks": (SHOCKS, CONTACTS),
    "summed pressure": ("physics.scheme=pressure_energy", "physics.conductivity=approach"),
    "limited supports": OPEN,
    "no divergence": ("physics.balsara=false",),
    "single precision": ("run.precision=single",),
    "field": (FIELD, RANGE),
    "heating": (HEATING,),
    "fluid by continuity": (FORMULATION,),
    "solid": (*TWO, *SOLID),
    "counted corrections": (*TWO, *SOLID, "physics.correction=1"),
}
IN_PYTHON = {"field", "heating", "counted corrections"}


def started(*settings):
    text = '[problem]\nname = "shock_tube"\nn = 80\n[time]\nend = 0.2\n'
    if FORMULATION in settings:  # the keys of another one would remain
        text += '[physics]\nformulation = "continuum"\n'
    return Simulation.start(Scene(config.from_text(text).override(settings)), 1, Clock())


def taken(simulation, until=0.2, most=256):
    """Return the columns of the history, without seconds, and the message of a fault."""
    found, message = {}, None
    simulation.keep_row()
    try:
        while simulation.time < until and simulation.step < most:
            simulation.proceed(until, most - simulation.step)
    except NumericalError as error:
        message = str(error)
    for columns in simulation.take_rows():
        for name, values in columns.items():
            if not name.endswith("_seconds"):
                found.setdefault(name, []).extend(values)
    return found, message


@pytest.fixture
def ordinary(monkeypatch):
    """ordinary(*settings): a simulation that takes one step after another."""

    def made(*settings):
        with monkeypatch.context() as patch:
            patch.setattr(steps, "suits", lambda scene: False)
            return started(*settings)

    return made


@pytest.fixture
def reasons(monkeypatch):
    """How often the driver returned for each reason."""
    counted, call = Counter(), steps.Steps._call

    def counting(self, *arguments):
        reason = call(self, *arguments)
        counted[reason] += 1
        return reason

    monkeypatch.setattr(steps.Steps, "_call", counting)
    return counted


@pytest.mark.parametrize("name", slow_except({0, 1}, SCENES))
def test_compiled_steps_have_bits_of_ordinary_steps(name, ordinary, reasons):
    one, other = started(*SCENES[name]), ordinary(*SCENES[name])
    rows, _ = taken(one)
    expected, _ = taken(other)
    assert rows == expected
    assert (one.time, one.step, one.list_builds) == (0.2, other.step, other.list_builds)
    for field in one.particles.fields:
        array = getattr(one.particles, field.name)
        assert array.tobytes() == getattr(other.particles, field.name).tobytes(), field.name
    if name not in IN_PYTHON:
        assert reasons[driver.STALE] > 5
    assert bool(reasons) == (name not in IN_PYTHON)


def test_wider_lists_in_compiled_steps(reasons):
    taken(started(*SCENES["limited supports"]))
    assert reasons[driver.WIDER] > 1  # else the equality of bits above says nothing of them


def test_driver_is_compiled_once_for_all_scenes():
    for name in ("mirror", "two dimensions"):
        taken(started(*SCENES[name]), most=20)
    assert len(driver.take.signatures) == 1


def test_parts_with_methods_in_python_keep_ordinary_steps():
    def scene(*settings):
        return Scene(config.from_text('[problem]\nname = "shock_tube"\n').override(settings))

    assert suits(scene())
    assert not suits(scene(FIELD))
    assert not suits(scene(HEATING))
    tension = scene('physics.eos={ name = "stiffened_gas", gamma = 4.4, p_inf = 1.0 }')
    assert in_python_of(tension.formulation) == ["check"]
    assert in_python_of(scene().formulation) == []


# --- faults: the same message after the same step, and the rows of the steps before --------------


def same_fault(one, other, words):
    rows, message = taken(one)
    expected, expected_message = taken(other)
    assert words in message
    assert message == expected_message
    assert rows == expected
    assert one.step == other.step > steps.ORDINARY + 5


def test_drift_is_found_at_its_step(ordinary):
    rows, _ = taken(ordinary(*SCENES["mirror"]))
    drift = np.abs(rows["energy_drift"])
    settings = (*SCENES["mirror"], f"physics.max_energy_drift={drift[:30].max()}")
    same_fault(started(*settings), ordinary(*settings), "total energy has drifted")


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [("energy_rate", np.nan, "internal energy"), ("acceleration", np.inf, "density of particle")],
)
def test_numbers_that_are_not_finite_are_found_at_their_step(ordinary, field, value, words):
    simulations = started(*SCENES["mirror"]), ordinary(*SCENES["mirror"])
    for one in simulations:
        broken_at(one, 20, field, value)
    same_fault(*simulations, words)


def broken_at(simulation, step, field, value):
    """Set an entry of a field at a step."""
    proceed = simulation.proceed

    def broken(until, most, pause=np.inf):
        if simulation.step == step:
            getattr(simulation.particles, field)[..., 7] = value
        proceed(until, min(most, 1), pause)

    simulation.proceed = broken


def test_energy_injected_has_bits_of_ordinary_steps(ordinary):
    """Cooling of a particle by more than half of its internal energy, 2.5, in half a step."""
    settings = (*SCENES["mirror"], "physics.max_energy_drift=1.0")
    simulations = started(*settings), ordinary(*settings)
    for one in simulations:
        broken_at(one, 20, "energy_rate", -4.0 / one.limit.dt)
    rows, _ = taken(simulations[0], most=30)
    expected, _ = taken(simulations[1], most=30)
    assert rows == expected
    assert rows["energy_injected"][-1] > 0.0


def test_particle_far_outside_is_found_at_its_step(ordinary, monkeypatch):
    monkeypatch.setattr("sph.watchdog.FAR", 0.1)  # which expanding gas soon reaches
    simulations = started("problem.boundary=open"), ordinary("problem.boundary=open")
    same_fault(*simulations, "outside the open domain")


def test_volume_that_misfits_box_is_found_at_its_step(ordinary):
    settings = ("physics.eta=0.8", *TWO)
    same_fault(started(*settings), ordinary(*settings), "the densities do not fit the box")


def test_collapsed_pace_is_found_at_its_step(ordinary, monkeypatch):
    monkeypatch.setattr("sph.watchdog.WINDOW", 20)
    monkeypatch.setattr("sph.watchdog.MOST_WINDOWS", 2.0)
    simulations = started(*SCENES["mirror"]), ordinary(*SCENES["mirror"])
    same_fault(*simulations, "the run cannot reach time.end")


# --- when a call ends ----------------------------------------------------------------------------


def test_call_ends_at_output_after_most_steps_and_after_seconds(monkeypatch):
    one = started(*SCENES["mirror"])
    taken(one, most=20)
    assert one.step == 20
    one.proceed(0.2, 5)
    assert one.step == 25
    one.proceed(one.time + 1.5 * one.limit.dt, 100)
    assert one.step == 27
    monkeypatch.setattr(steps, "LONGEST", 0.0)  # so that stop signals are heeded
    one.proceed(0.2, 100)
    assert one.step == 28


def test_more_steps_than_rows_are_kept(monkeypatch):
    monkeypatch.setattr(steps, "MOST", 7)
    one = started(*SCENES["mirror"])
    rows, _ = taken(one)
    assert rows["step"] == list(range(one.step + 1))


def test_seconds_of_rows_increase_and_phases_add_up():
    one = started(*SCENES["mirror"])
    taken(one, most=20)
    before = one.clock.seconds.copy()
    wall, cpu = one.clock.wall, one.clock.cpu
    one.proceed(0.2, 256)
    (columns,) = one.take_rows()[:1]
    for name, begin, end in (
        ("wall_seconds", wall, one.clock.wall), ("cpu_seconds", cpu, one.clock.cpu),
    ):  # fmt: skip
        values = columns[name]
        assert len(values) > 1
        assert values == sorted(values)
        assert begin < values[0] < values[-1] < end
    for name in ("density", "rates", "predict, correct", "step size, sums"):
        assert one.clock.seconds[name] > before[name]


def test_shared_passes_keep_ordinary_steps():
    one = started(*SCENES["mirror"])
    taken(one, most=20)
    assert one._steps.may_begin()
    one.team.shares = lambda *_: True
    assert not one._steps.may_begin()
