"""Every bound of the watchdog from both sides, on a state made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph import config as configuration
from sph import watchdog
from sph.errors import NumericalError
from sph.integrators import step_size
from sph.scene import Scene
from sph.state import COMMON


def quiet(**changed):
    """What the watchdog looks at of gas at rest in a box of 1 by 2, open along y."""
    n = 4
    arrays = {
        "id": np.array([14, 11, 13, 12]), "position": np.full((2, n), 0.5), "mass": np.ones(n),
        "velocity": np.zeros((2, n)), "internal_energy": np.ones(n), "density": np.ones(n),
        "acceleration": np.zeros((2, n)), "energy_rate": np.zeros(n),
    } | changed  # fmt: skip
    physics = SimpleNamespace(max_energy_drift=0.02, C=0.1)
    config = SimpleNamespace(physics=physics, time=SimpleNamespace(end=0.25))
    domain = SimpleNamespace(box=np.array([[0.0, 1.0], [0.0, 2.0]]), boundaries=("mirror", "open"))
    totals = SimpleNamespace(
        energy=1.0, kinetic_energy=0.0, internal_energy=1.0, energies={}, max_density=1.0,
        min_density=1.0, min_internal_energy=1.0, rates=0.0,
    )  # fmt: skip
    return SimpleNamespace(
        scene=SimpleNamespace(
            config=config, physics=physics, domain=domain, all_parts=(), is_single=False,
            step_bounds=step_size.Bounds(0.1, "signal_speed", False, False, 0.25),
            formulation=SimpleNamespace(fields=COMMON, neighbours_key="physics.eta"),
        ),
        particles=SimpleNamespace(**arrays), totals=totals, energy_drift=0.0, volume_ratio=None,
        limit=step_size.StepLimit(1e-3, 12, "signal_speed"), time=0.0, step=5,
    )  # fmt: skip


def refusal(state, check="check"):
    """The error that the watchdog raises, or None."""
    try:
        getattr(watchdog.Watchdog(state.scene), check)(state)
    except NumericalError as error:
        return error
    return None


@pytest.mark.parametrize("check", ["check", "check_range"])
def test_gas_at_rest_passes(check):
    assert refusal(quiet(), check) is None


@pytest.mark.parametrize(
    ("name", "within", "beyond"),
    [
        ("mass", (1.1e-100, 0.9e100), (0.9e-100, 1.1e100, 0.0, -1.0, np.nan)),
        ("position", (-0.9e100, 0.9e100), (-1.1e100, 1.1e100, np.nan)),
        ("velocity", (-0.9e100, 0.9e100), (-1.1e100, 1.1e100, np.nan)),
        ("internal_energy", (0.0, 0.9e100), (-1e-300, 1.1e100, np.nan)),
    ],
)
def test_initial_values_cubes_and_inverses_must_be_finite(name, within, beyond):
    for value in (*within, *beyond):
        state = quiet()
        getattr(state.particles, name)[..., 2] = value
        error = refusal(state, "check_range")
        if value in within:
            assert error is None
            continue
        assert error.particle == 13
        assert str(error).startswith(f"step 5, t = 0: {name.replace('_', ' ')} of particle 13")


@pytest.mark.parametrize(
    ("size", "is_wrong"), [(0.9e-100, True), (1.1e-100, False), (0.9e100, False), (1.1e100, True)]
)
def test_box_and_end_time_of_extreme_size_are_refused(size, is_wrong):
    tall, late = quiet(), quiet()
    tall.scene.domain.box = np.array([[0.0, 1.0], [0.0, size]])
    late.scene.config.time.end = size
    for state, words in ((tall, "along y is"), (late, "time.end")):
        error = refusal(state, "check_range")
        assert (error is not None) == is_wrong
        assert error is None or words in str(error)


@pytest.mark.parametrize("name", ["energy", "max_density", "rates"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_sum_of_finite_particles_is_detected(name, value):
    state = quiet()
    setattr(state.totals, name, value)
    assert "is not finite" in str(refusal(state))


@pytest.mark.parametrize("dt", [np.nan, np.inf, 0.0, -1.0])
def test_step_that_does_not_advance_time_is_detected(dt):
    state = quiet()
    state.limit = state.limit._replace(dt=dt)
    assert refusal(state) is not None


@pytest.mark.parametrize(
    ("name", "value", "is_wrong"),
    [
        ("internal_energy", -1e-300, True), ("internal_energy", 0.0, False),
        ("density", 0.0, True), ("density", 1e-300, False),
    ],
)  # fmt: skip
def test_zero_energy_accepted_and_zero_density_refused(name, value, is_wrong):
    state = quiet()
    getattr(state.particles, name)[2] = value
    setattr(state.totals, f"min_{name}", value)
    error = refusal(state)
    assert (error is not None) == is_wrong
    assert error is None or error.particle == 13


def test_suggestion_at_start_is_not_smaller_step():
    state = quiet()
    state.particles.density[2] = state.totals.min_density = 0.0
    assert "physics.C" in str(refusal(state))
    state.step = 0
    assert "code units" in str(refusal(state))


@pytest.mark.parametrize(("above", "is_torn"), [(1e-9, False), (0.0, True), (-1e-9, True)])
def test_zero_sound_speed_under_tension_is_detected(above, is_torn):
    liquid = '[problem]\nname = "uniform"\n[physics]\n'
    liquid += 'eos = { name = "stiffened_gas", gamma = 4.4, p_inf = 1.0 }\n'
    gas = Scene(configuration.from_text(liquid)).formulation
    gas.eos = SimpleNamespace(lowest_energy=lambda density: 0.25 * density)
    state = quiet(density=np.array([1.0, 1.0, 2.0, 1.0]))
    state.scene.all_parts = (gas,)
    state.particles.internal_energy[2] = 0.5 + above
    error = refusal(state)
    assert (error is not None) == is_torn
    assert error is None or error.particle == 13


@pytest.mark.parametrize(
    ("changed", "particle"),
    [
        ({"mass": np.array([1.0, 1.0, 3.0, 1.0])}, 13),
        # 3.5 of motion and 1 of heat, against 4
        ({"velocity": np.array([[0.0, 2.0, 0.0, 0.0], [0.0, np.sqrt(3.0), 0.0, 0.0]]),
          "internal_energy": np.array([4.0, 1.0, 1.0, 1.0])}, 11),
        # 2 of motion and 1 of heat
        ({"velocity": np.array([[0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]]),
          "internal_energy": np.array([3.5, 1.0, 1.0, 1.0])}, 14),
    ],
)  # fmt: skip
def test_energy_drift_names_most_energetic_particle(changed, particle):
    state = quiet(**changed)
    state.energy_drift = np.nan
    assert refusal(state).particle == particle
    state.energy_drift = -0.02
    assert refusal(state) is None


@pytest.mark.parametrize(
    ("y", "is_lost"), [(-199.0, False), (-201.0, True), (201.0, False), (203.0, True)]
)
def test_particle_lost_beyond_hundred_box_lengths(y, is_lost):
    state = quiet()
    state.particles.position[:, 2] = 1e9, y  # along x there is a wall
    state.particles.position[1, 0] = 200.0 if y < 0.0 else -199.0  # the farthest on the other side
    error = refusal(state)
    assert (error is not None) == is_lost
    assert error is None or error.particle == 13


@pytest.mark.parametrize(
    ("covered", "words"),
    [
        ((1.0, 1.1e-6), None),
        ((1.0, 0.9e-6), "collapsed"),
        ((1.0, 0.9e-6, 1.0), "collapsed"),
        ((1e-3, 1.0, 1e-3, 1.1e-6), None),
        # of 0.25, all of which are left, and of 0.15
        ((0.26e-12,), None),
        ((0.24e-12,), "cannot reach"),
        ((0.1, 0.16e-12), "collapsed"),
    ],
)
def test_pace_that_never_finishes_is_reported(covered, words):
    def run():
        state = quiet()
        dog = watchdog.Watchdog(state.scene)
        dog.check_pace(state)
        for length in covered:
            state.step, state.time = state.step + watchdog.WINDOW, state.time + length
            dog.check_pace(state)

    if words is None:
        run()
        return
    with pytest.raises(NumericalError, match=words):
        run()


def test_remaining_steps_counted_from_now():
    """A pace of 0.2e-12 a window is too slow for 0.25 and not for the 0.15 that are left."""
    dog, state = watchdog.Watchdog(quiet().scene), quiet()
    state.time = 0.1
    dog.check_pace(state)
    state.step, state.time = state.step + watchdog.WINDOW, state.time + 0.2e-12
    dog.check_pace(state)
    late = quiet()
    dog = watchdog.Watchdog(late.scene)
    dog.check_pace(late)
    late.step, late.time = late.step + watchdog.WINDOW, 0.2e-12
    with pytest.raises(NumericalError, match="cannot reach"):
        dog.check_pace(late)


@pytest.mark.parametrize(("step", "is_looked_at"), [(1999, False), (2000, True)])
def test_pace_window_starts_after_last(step, is_looked_at):
    """A restart at step 1000: the first look is after a whole window."""
    dog, state = watchdog.Watchdog(quiet().scene), quiet()
    state.step = 1000
    dog.check_pace(state)
    state.step = step
    if not is_looked_at:
        dog.check_pace(state)
        return
    with pytest.raises(NumericalError, match="cannot reach"):
        dog.check_pace(state)
