"""Updates that keep internal energy positive, and every bound of the time step."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph.integrators import leapfrog, step_size
from sph.integrators.step_size import Bounds, Past

MASS = np.array([1.0, 2.0, 3.0, 4.0])


def test_energy_update_is_linear_if_half_remains():
    energy, rate, full = np.array([1.0, 2.0]), np.array([-0.5, 3.0]), np.empty(2)
    assert leapfrog.predict_energy(1.0, energy, rate, MASS[:2], full) == 0.0
    assert full.tolist() == [0.5, 5.0]
    assert energy.tolist() == [0.75, 3.5]
    assert leapfrog.correct_energy(1.0, energy, rate, MASS[:2]) == 0.0
    assert energy.tolist() == [0.5, 5.0]


@pytest.mark.parametrize("cooling", [1.1, 10.0, 1e3, 1e300])
def test_energy_update_stays_positive_and_reports_injected_energy(cooling):
    energy, full = np.array([1.0, 0.0, 3.0]), np.empty(3)
    rate = np.array([-2.0 * cooling, -1.0, 1.0])
    straight = energy + 0.5 * rate
    given = leapfrog.predict_energy(1.0, energy, rate, MASS[:3], full)
    assert (energy >= 0).all()
    assert (full >= 0).all()
    assert np.isfinite(energy).all()
    assert energy[1] == full[1] == 0.0  # nothing is taken where there is nothing
    # a sum of three products: a few roundings of the largest
    assert given == pytest.approx(MASS[:3] @ (energy - straight), rel=1e-14)
    start = energy.copy()
    given = leapfrog.correct_energy(1.0, energy, rate, MASS[:3])
    assert (energy >= 0).all()
    assert given == pytest.approx(MASS[:3] @ (energy - start - 0.5 * rate), rel=1e-14)


def test_energy_update_joins_exponential_smoothly():
    change = -0.5 + np.array([-1e-6, 0.0, 1e-6])
    energy = np.ones(3)
    leapfrog.correct_energy(2.0, energy, change, MASS[:3])
    # slope 1 on both sides; the curvature 2 makes 1e-12 of it over 1e-6, rounding 1e-10
    assert np.diff(energy) / 1e-6 == pytest.approx([1.0, 1.0], abs=3e-6)
    assert energy[1] == 0.5


def test_energy_update_propagates_nan():
    energy = np.array([np.nan, 1.0, 1.0])
    leapfrog.correct_energy(1.0, energy, np.array([1.0, np.nan, -np.inf]), MASS[:3])
    assert np.isnan(energy[:2]).all()


# --- the time step ----------------------------------------------------------------------------


def particles(**changed):
    """Two particles; the first alone would take a step of 2 H/v_sig = 0.2."""
    arrays = {
        "position": np.zeros((2, 2)),
        "support": np.array([0.1, 0.2]),
        "internal_energy": np.ones(2),
        "energy_rate": np.zeros(2),
        "acceleration": np.zeros((1, 2)),
        "id": np.array([8, 5]),
    }
    return SimpleNamespace(**arrays | changed)


SIGNALS = np.array([1.0, 1.0])
ALL = Bounds(courant=0.5, energy=True, acceleration=True, end=100.0)


def test_step_limited_by_signal_speed():
    assert step_size.limit(ALL, particles(), SIGNALS, None, None) == (0.1, 8, "signal_speed")


def test_step_limited_by_heating_if_enabled():
    rates = np.array([0.0, -10.0])
    limit = step_size.limit(ALL, particles(energy_rate=rates), SIGNALS, None, None)
    assert limit == (0.05, 5, "energy")
    free = ALL._replace(energy=False)
    limit = step_size.limit(free, particles(energy_rate=rates), SIGNALS, None, None)
    assert limit.criterion == "signal_speed"


def test_step_with_zero_energy_is_finite():
    cold = particles(internal_energy=np.zeros(2), energy_rate=np.array([1.0, 0.0]))
    assert step_size.limit(ALL, cold, SIGNALS, None, None) == (0.1, 8, "signal_speed")


def test_step_limited_by_external_field():
    pulled = particles(acceleration=np.array([[0.0, 2000.0]]))
    # 0.5 sqrt(0.2/2000), two roots and a product of rounding
    assert step_size.limit(ALL, pulled, SIGNALS, None, None) == (
        pytest.approx(0.005, rel=1e-15), 5, "acceleration",
    )  # fmt: skip
    aslant = particles(acceleration=np.array([[0.0, 1200.0], [0.0, 1600.0]]))
    limit = step_size.limit(ALL, aslant, SIGNALS, None, None)
    assert limit.dt == pytest.approx(0.005, rel=1e-15)
    without = ALL._replace(acceleration=False)
    assert step_size.limit(without, pulled, SIGNALS, None, None).criterion == "signal_speed"


def test_step_limited_by_support_change():
    """It halved in a step of 0.01: at that pace 0.2 of it takes 0.002."""
    past = Past(dt=0.01, limit=1.0, support=np.array([0.1, 0.4]))
    limit = step_size.limit(ALL, particles(), SIGNALS, None, past)
    assert limit == (pytest.approx(0.002, rel=1e-15), 5, "support")
    grown = Past(dt=0.01, limit=1.0, support=np.array([0.1, 0.1]))
    assert step_size.limit(ALL, particles(), SIGNALS, None, grown).dt == pytest.approx(0.002)


def test_step_limited_in_expansion():
    """In 2-D supports grow by div v/2: 0.2 of them takes 0.004."""
    parting = np.array([100.0, -20.0])
    limit = step_size.limit(ALL, particles(), SIGNALS, parting, None)
    assert limit == (pytest.approx(0.004, rel=1e-15), 8, "support")
    past = Past(dt=0.01, limit=1.0, support=np.array([0.1, 0.4]))  # is not asked then
    assert step_size.limit(ALL, particles(), SIGNALS, parting, past) == limit
    meeting = step_size.limit(ALL, particles(), SIGNALS, np.array([20.0, -100.0]), None)
    assert meeting == (pytest.approx(0.004, rel=1e-15), 5, "support")
    slow = np.array([1.0, -2.0])
    assert step_size.limit(ALL, particles(), SIGNALS, slow, past).criterion == "signal_speed"


def test_step_not_limited_by_support_change_in_tiny_step():
    past = Past(dt=1e-9, limit=0.1, support=np.array([0.1, 0.201]))
    assert step_size.limit(ALL, particles(), SIGNALS, None, past).criterion == "signal_speed"


def test_step_growth_is_limited():
    past = Past(dt=1e-3, limit=1e-3, support=np.array([0.1, 0.2]))
    limit = step_size.limit(ALL, particles(), SIGNALS, None, past)
    assert limit == (pytest.approx(1.5e-3), 0, "growth")
    twice = Past(dt=0.05, limit=0.05, support=np.array([0.1, 0.2]))  # 0.1 would be allowed
    limit = step_size.limit(ALL, particles(), SIGNALS, None, twice)
    assert limit == (pytest.approx(0.075), 0, "growth")


def test_step_cut_for_output_does_not_shorten_next():
    past = Past(dt=1e-9, limit=0.1, support=np.array([0.1, 0.2]))
    assert step_size.limit(ALL, particles(), SIGNALS, None, past).dt == 0.1


@pytest.mark.parametrize(
    ("alike", "divergence", "past", "criterion"),
    [
        ({}, None, None, "signal_speed"),
        ({"energy_rate": np.full(2, 10.0)}, None, None, "energy"),
        ({"acceleration": np.full((1, 2), 2000.0)}, None, None, "acceleration"),
        ({}, np.full(2, 100.0), None, "support"),
        ({}, None, Past(dt=0.01, limit=1.0, support=np.full(2, 0.2)), "support"),
    ],
)
def test_step_limit_tie_names_lowest_id(alike, divergence, past, criterion):
    """Memory order must not show: it changes with the lists."""
    both = particles(support=np.full(2, 0.1), **alike)
    limit = step_size.limit(ALL, both, SIGNALS, divergence, past)
    assert (limit.particle, limit.criterion) == (5, criterion)


def test_gas_at_rest_without_pressure_takes_one_step():
    limit = step_size.limit(ALL, particles(internal_energy=np.zeros(2)), np.zeros(2), None, None)
    assert limit == (100.0, 0, "end")


# --- damping ----------------------------------------------------------------------------------


def growth(damping, frequency, dt=1.0):
    """The largest factor by which a step multiplies an oscillator's state, of the leapfrog itself.

    Its acceleration is -frequency^2 x - damping v, with the velocity that eq 4 predicts.
    """
    columns = []
    for state in np.eye(3):
        x, v, a = (np.array([[part]]) for part in state)
        predicted = np.empty((1, 1))
        leapfrog.predict(dt, x, v, a, predicted)
        a = -(frequency**2) * x - damping * predicted
        leapfrog.correct(dt, v, a)
        columns.append([x[0, 0], v[0, 0], a[0, 0]])
    return np.abs(np.linalg.eigvals(np.array(columns))).max()


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.3, 0.7, 0.95])
def test_leapfrog_stable_up_to_formula(damping):
    """lambda dt + (w dt)^2/4 < 1; eigenvalues of 1 in size are good to the root of rounding."""
    for inside in (0.01, 0.5, 0.99):
        assert growth(damping, 2 * np.sqrt(inside * (1 - damping))) < 1 + 1e-7
    assert growth(damping, 2 * np.sqrt(1.02 * (1 - damping))) > 1.001


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
    bounds = ALL._replace(courant=C, alpha=alpha)
    assert bounds.held == (pytest.approx(held, rel=1e-6), criterion)
    if held < C:
        assert 2 * alpha * bounds.held[0] + 4 * bounds.held[0] ** 2 == pytest.approx(1.0)
    else:
        assert bounds.held[0] == C  # to the last bit
    limit = step_size.limit(bounds, particles(), SIGNALS, None, None)
    assert limit == (pytest.approx(0.2 * held, rel=1e-6), 8, criterion)


def test_courant_number_limited_by_conductivity():
    strong = ALL._replace(courant=0.15, conductivity=30.0)
    limit = step_size.limit(strong, particles(), SIGNALS, None, None)
    assert limit == (pytest.approx(0.2 * 0.05), 8, "conductivity")
    assert strong._replace(conductivity=10.0).held == (0.15, "signal_speed")
