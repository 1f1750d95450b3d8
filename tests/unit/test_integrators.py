"""Updates that keep internal energy positive, and every bound of the time step."""

import numpy as np
import pytest

from sph import config as configuration
from sph.integrators import leapfrog, step_size
from sph.integrators.step_size import Bounds, Past
from sph.part import Evolved, Part
from sph.scene import Scene
from sph.state import COMMON, Field, State

MASS = np.array([1.0, 2.0, 3.0, 4.0])


def predict(dt, energy, rate, full):
    rows = energy[np.newaxis], rate[np.newaxis], MASS[: energy.size], full[np.newaxis]
    return leapfrog.POSITIVE.predict(0, energy.size, dt, *rows)


def correct(dt, energy, rate):
    rows = energy[np.newaxis], rate[np.newaxis], MASS[: energy.size]
    return leapfrog.POSITIVE.correct(0, energy.size, dt, *rows)


def test_energy_update_is_linear_if_half_remains():
    energy, rate, full = np.array([1.0, 2.0]), np.array([-0.5, 3.0]), np.empty(2)
    assert predict(1.0, energy, rate, full) == 0.0
    assert full.tolist() == [0.5, 5.0]
    assert energy.tolist() == [0.75, 3.5]
    assert correct(1.0, energy, rate) == 0.0
    assert energy.tolist() == [0.5, 5.0]


@pytest.mark.parametrize("cooling", [1.1, 10.0, 1e3, 1e300])
def test_energy_update_stays_positive_and_reports_injected_energy(cooling):
    energy, full = np.array([1.0, 0.0, 3.0]), np.empty(3)
    rate = np.array([-2.0 * cooling, -1.0, 1.0])
    straight = energy + 0.5 * rate
    given = predict(1.0, energy, rate, full)
    assert (energy >= 0).all()
    assert (full >= 0).all()
    assert np.isfinite(energy).all()
    assert energy[1] == full[1] == 0.0  # nothing is taken where there is nothing
    # a sum of three products: a few roundings of the largest
    assert given == pytest.approx(MASS[:3] @ (energy - straight), rel=1e-14)
    start = energy.copy()
    given = correct(1.0, energy, rate)
    assert (energy >= 0).all()
    assert given == pytest.approx(MASS[:3] @ (energy - start - 0.5 * rate), rel=1e-14)


def test_energy_update_joins_exponential_smoothly():
    change = -0.5 + np.array([-1e-6, 0.0, 1e-6])
    energy = np.ones(3)
    correct(2.0, energy, change)
    # slope 1 on both sides; the curvature 2 makes 1e-12 of it over 1e-6, rounding 1e-10
    assert np.diff(energy) / 1e-6 == pytest.approx([1.0, 1.0], abs=3e-6)
    assert energy[1] == 0.5


def test_energy_update_propagates_nan():
    energy = np.array([np.nan, 1.0, 1.0])
    correct(1.0, energy, np.array([1.0, np.nan, -np.inf]))
    assert np.isnan(energy[:2]).all()


# --- the time step ----------------------------------------------------------------------------


def particles(**changed):
    """Two particles; the first alone would take a step of 2 H/v_sig = 0.2."""
    arrays = {
        "id": np.array([8, 5]),
        "mass": np.ones(2),
        "position": np.zeros((2, 2)),
        "internal_energy": np.ones(2),
        "support": np.array([0.1, 0.2]),
        "acceleration": np.zeros((1, 2)),
        "energy_rate": np.zeros(2),
        "support_before": np.array([0.1, 0.2]),
        "signal_speed": np.ones(2),
    }
    return State((*COMMON, Field("div_v")), arrays | changed)


def limit_of(bounds, state, past=None, parts=()):
    return step_size.limit(bounds, state, parts, past)


ALL = Bounds(0.5, "signal_speed", energy=True, acceleration=True, end=100.0)


def test_step_limited_by_signal_speed():
    assert limit_of(ALL, particles()) == (0.1, 8, "signal_speed")


def test_step_limited_by_heating_if_enabled():
    rates = np.array([0.0, -10.0])
    limit = limit_of(ALL, particles(energy_rate=rates))
    assert limit == (0.05, 5, "energy")
    free = ALL._replace(energy=False)
    limit = limit_of(free, particles(energy_rate=rates))
    assert limit.criterion == "signal_speed"


def test_step_with_zero_energy_is_finite():
    cold = particles(internal_energy=np.zeros(2), energy_rate=np.array([1.0, 0.0]))
    assert limit_of(ALL, cold) == (0.1, 8, "signal_speed")


def test_step_limited_by_external_field():
    pulled = particles(acceleration=np.array([[0.0, 2000.0]]))
    # 0.5 sqrt(0.2/2000), two roots and a product of rounding
    assert limit_of(ALL, pulled) == (
        pytest.approx(0.005, rel=1e-15), 5, "acceleration",
    )  # fmt: skip
    aslant = particles(acceleration=np.array([[0.0, 1200.0], [0.0, 1600.0]]))
    limit = limit_of(ALL, aslant)
    assert limit.dt == pytest.approx(0.005, rel=1e-15)
    without = ALL._replace(acceleration=False)
    assert limit_of(without, pulled).criterion == "signal_speed"


def test_step_limited_by_support_change():
    """It halved in a step of 0.01: at that pace 0.2 of it takes 0.002."""
    past = Past(dt=0.01, limit=1.0)
    halved = particles(support_before=np.array([0.1, 0.4]))
    assert limit_of(ALL, halved, past) == (pytest.approx(0.002, rel=1e-15), 5, "support")
    grown = particles(support_before=np.array([0.1, 0.1]))
    assert limit_of(ALL, grown, past).dt == pytest.approx(0.002)


def test_step_limited_in_expansion():
    """In 2-D supports grow by div v/2: 0.2 of them takes 0.004."""
    parting = particles(div_v=np.array([100.0, -20.0]))
    limit = limit_of(ALL, parting)
    assert limit == (pytest.approx(0.004, rel=1e-15), 8, "support")
    # what supports did is not asked then
    past, halved = Past(dt=0.01, limit=1.0), {"support_before": np.array([0.1, 0.4])}
    assert limit_of(ALL, particles(div_v=parting.div_v, **halved), past) == limit
    meeting = limit_of(ALL, particles(div_v=np.array([20.0, -100.0])))
    assert meeting == (pytest.approx(0.004, rel=1e-15), 5, "support")
    slow = particles(div_v=np.array([1.0, -2.0]), **halved)
    assert limit_of(ALL, slow, past).criterion == "signal_speed"


def test_step_not_limited_by_support_change_in_tiny_step():
    settled = particles(support_before=np.array([0.1, 0.201]))
    assert limit_of(ALL, settled, Past(dt=1e-9, limit=0.1)).criterion == "signal_speed"


def test_step_growth_is_limited():
    past = Past(dt=1e-3, limit=1e-3)
    limit = limit_of(ALL, particles(), past)
    assert limit == (pytest.approx(1.5e-3), 0, "growth")
    twice = Past(dt=0.05, limit=0.05)  # 0.1 would be allowed
    limit = limit_of(ALL, particles(), twice)
    assert limit == (pytest.approx(0.075), 0, "growth")


def test_step_cut_for_output_does_not_shorten_next():
    past = Past(dt=1e-9, limit=0.1)
    assert limit_of(ALL, particles(), past).dt == 0.1


@pytest.mark.parametrize(
    ("alike", "past", "criterion"),
    [
        ({}, None, "signal_speed"),
        ({"energy_rate": np.full(2, 10.0)}, None, "energy"),
        ({"acceleration": np.full((1, 2), 2000.0)}, None, "acceleration"),
        ({"div_v": np.full(2, 100.0)}, None, "support"),
        ({"support_before": np.full(2, 0.2)}, Past(dt=0.01, limit=1.0), "support"),
    ],
)
def test_step_limit_tie_names_lowest_id(alike, past, criterion):
    """Memory order must not show: it changes with the lists."""
    both = particles(**{"support": np.full(2, 0.1), "support_before": np.full(2, 0.1)} | alike)
    limit = limit_of(ALL, both, past)
    assert (limit.particle, limit.criterion) == (5, criterion)


def test_gas_at_rest_without_pressure_takes_one_step():
    still = particles(internal_energy=np.zeros(2), signal_speed=np.zeros(2))
    assert limit_of(ALL, still) == (100.0, 0, "end")


class Strict(Part):
    """Bounds the step of each particle by itself."""

    def __init__(self, *times):
        self.times = np.array(times)

    def step_limit(self, state):
        return self.times


def test_step_limited_by_part():
    others = (Part(), Strict(0.3, 0.4))
    assert limit_of(ALL, particles(), parts=others) == (0.1, 8, "signal_speed")
    # not times the Courant number; of two alike the lower ID
    assert limit_of(ALL, particles(), parts=(*others, Strict(0.09, 0.02))) == (0.02, 5, Strict.name)
    assert limit_of(ALL, particles(), parts=(Strict(0.02, 0.02),)) == (0.02, 5, Strict.name)
    # of a part's bound as of every other, what supports and growth allow is less
    past = Past(dt=1e-3, limit=1e-3)
    assert limit_of(ALL, particles(), past, (Strict(0.02, 0.02),)).criterion == "growth"


# --- damping ----------------------------------------------------------------------------------


def growth(damping, frequency, dt=1.0):
    """The largest factor by which a step multiplies an oscillator's state, of the leapfrog itself.

    Its acceleration is -frequency^2 x - damping v, with the velocity that eq 4 predicts.
    """
    columns = []
    for given in np.eye(3):
        x, v, a = (np.array([[one]]) for one in given)
        arrays = {"position": x, "velocity": v, "acceleration": a, "mass": np.ones(1),
                  "predicted_velocity": np.empty((1, 1))}  # fmt: skip
        state = State(COMMON, arrays)
        leapfrog.predict(state, (), dt)
        a[:] = -(frequency**2) * x - damping * state.predicted_velocity
        leapfrog.correct(state, (), dt)
        columns.append([x[0, 0], v[0, 0], a[0, 0]])
    return np.abs(np.linalg.eigvals(np.array(columns))).max()


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.3, 0.7, 0.95])
def test_leapfrog_stable_up_to_formula(damping):
    """lambda dt + (w dt)^2/4 < 1; eigenvalues of 1 in size are good to the root of rounding."""
    for inside in (0.01, 0.5, 0.99):
        assert growth(damping, 2 * np.sqrt(inside * (1 - damping))) < 1 + 1e-7
    assert growth(damping, 2 * np.sqrt(1.02 * (1 - damping))) > 1.001


TEXT = '[problem]\nname = "uniform"\nn = 64\n[time]\nend = 100.0\n'


def bounds_of(**physics):
    settings = [f"physics.{key}={value}" for key, value in physics.items()]
    return Scene(configuration.from_text(TEXT).override(settings)).step_bounds


@pytest.mark.parametrize(
    ("C", "alpha", "held", "criterion"),
    [
        (0.15, 3.0, 0.15, "signal_speed"),  # no bound by viscosity
        (0.3, 1.0, 0.3, "signal_speed"),
        (2.0, 0.0, 0.5, "signal_speed"),
        (0.15, 8.0, 0.0615528, "viscosity"),
        (2.0, 1.0, 0.3090170, "viscosity"),
        (2.0, 0.5, 0.3903882, "signal_speed"),  # of sound, more than of viscosity
        (0.15, 1e200, 5e-201, "viscosity"),  # whose square is beyond the largest number
    ],
)
def test_courant_number_limited_by_viscosity(C, alpha, held, criterion):
    bounds = bounds_of(C=C, alpha=alpha)
    assert (bounds.courant, bounds.criterion) == (pytest.approx(held, rel=1e-6), criterion)
    if held < C:
        assert 2 * alpha * bounds.courant + 4 * bounds.courant**2 == pytest.approx(1.0)
    else:
        assert bounds.courant == C  # to the last bit
    limit = limit_of(bounds, particles())
    assert limit == (pytest.approx(0.2 * held, rel=1e-6), 8, criterion)


def test_courant_number_limited_by_maximum_of_switch():
    switched = bounds_of(alpha="{ min = 0.1, max = 8.0 }")
    assert switched == bounds_of(alpha=8.0)
    assert switched != bounds_of(alpha=0.1)


def test_courant_number_limited_by_conductivity():
    strong = bounds_of(C=0.15, conductivity="{ name = 'approach', strength = 30.0 }")
    limit = limit_of(strong, particles())
    assert limit == (pytest.approx(0.2 * 0.05), 8, "conductivity")
    weak = bounds_of(C=0.15, conductivity="{ name = 'approach', strength = 10.0 }")
    assert (weak.courant, weak.criterion) == (0.15, "signal_speed")
    none = bounds_of(C=0.15, conductivity="{ name = 'approach', strength = 0.0 }")
    assert none == weak
    both = {"alpha": 8.0, "conductivity": "{ name = 'approach', strength = 30.0 }"}
    assert bounds_of(**both) == strong  # the smaller of the two
    both["conductivity"] = "{ name = 'approach', strength = 20.0 }"
    assert bounds_of(**both) == bounds_of(alpha=8.0)


# --- what evolves -----------------------------------------------------------------------------


def test_evolved_fields_move_by_their_rules():
    """Half a step in place, a full one into the prediction, for scalars and tensors alike."""
    names = ("scalar", "tensor")
    fields = [Field(f"{name}{of}", rank) for name, rank in zip(names, (0, 2), strict=True)
              for of in ("", "_rate", "_predicted")]  # fmt: skip
    state = State.at_start((*COMMON, *fields), *np.zeros((2, 2, 3)), np.ones(3), np.ones(3))
    evolved = [Evolved(name, f"{name}_rate", f"{name}_predicted", leapfrog.STRAIGHT)
               for name in names]  # fmt: skip
    evolved.append(Evolved("internal_energy", "energy_rate", "predicted_energy", leapfrog.POSITIVE))
    random = np.random.default_rng(2)
    begun = {}
    for name in names:
        getattr(state, name)[:] = begun[name] = random.normal(size=getattr(state, name).shape)
        getattr(state, f"{name}_rate")[:] = random.normal(size=begun[name].shape)
    state.energy_rate[:] = -4.0
    leapfrog.keep(state, tuple(evolved))
    for name in names:
        assert (getattr(state, f"{name}_predicted") == begun[name]).all()
    given = leapfrog.predict(state, tuple(evolved), 0.5)
    # what the curve of u kept: u/2 e^(1 + 2 c/u) with c = -1, against u + c = 0, of three particles
    assert given == pytest.approx(1.5 * np.exp(-1.0), rel=1e-14)
    for name in names:
        rate = getattr(state, f"{name}_rate")
        predicted = begun[name] + rate * 0.5
        np.testing.assert_array_equal(getattr(state, f"{name}_predicted"), predicted)
        np.testing.assert_array_equal(getattr(state, name), begun[name] + 0.5 * rate * 0.5)
        rate[:] = random.normal(size=rate.shape)
    before = {name: getattr(state, name).copy() for name in names}
    state.energy_rate[:] = 0.0
    assert leapfrog.correct(state, tuple(evolved), 0.5) == 0.0
    for name in names:
        expected = before[name] + 0.5 * getattr(state, f"{name}_rate") * 0.5
        np.testing.assert_array_equal(getattr(state, name), expected)
