"""Figures of a tube whose profiles are bent by known amounts."""

import numpy as np
import pytest

from sph import eos
from sph.exact import riemann
from sph.problems.shock_tube import Problem as ShockTube
from sph.problems.support import tube_figures

AIR = eos.make("ideal_gas", gamma=1.4)
TIME = 0.1
# Streams that collide: two shocks, the denser star state on the right, which moves to the left.
LEFT, RIGHT = riemann.State(1.0, 1.0, 1.0), riemann.State(2.0, -3.0, 2.0)
STAR, SPEED = riemann.star_state(LEFT, RIGHT, AIR), riemann.wave_speeds(LEFT, RIGHT, AIR)
ROUND_OFF = 1e-12  # sums of some thousand terms of order one


def tube(x=None, states=(LEFT, RIGHT), time=TIME, **changed):
    """The exact tube at places x (N,), of masses that are not alike, but for what is changed."""
    x = np.linspace(-0.6, 0.6, 1200) if x is None else x
    xi = x / time if time else np.sign(x) * np.inf
    density, velocity, pressure = riemann.solve(*states, AIR, xi)
    energy = AIR.internal_energy(density, pressure)
    exact = {"density": density, "internal_energy": energy}
    whole = tube_figures.Tube(
        states, AIR, time, x, np.ones(x.size, bool), density, velocity, pressure, energy,
        1.0 + np.arange(x.size) % 3, exact,
    )  # fmt: skip
    return whole._replace(**changed)


def test_colliding_gas_has_states_these_tests_need():
    assert SPEED.left_head == SPEED.left_tail < SPEED.contact < 0.0
    assert SPEED.right_head == SPEED.right_tail
    assert STAR.density_right > max(STAR.density_left, LEFT.density, RIGHT.density)


def test_peak_density_is_highest_of_all_states():
    assert tube_figures.of(tube())["peak_density_exact"] == STAR.density_right
    mirrored = tuple(one._replace(velocity=-one.velocity) for one in (RIGHT, LEFT))
    found = tube_figures.of(tube(states=mirrored))["peak_density_exact"]
    assert found == pytest.approx(STAR.density_right, rel=ROUND_OFF)
    parting = tuple(one._replace(velocity=-one.velocity) for one in (LEFT, RIGHT))
    assert tube_figures.of(tube(states=parting))["peak_density_exact"] == 2.0
    assert tube_figures.of(tube(states=(RIGHT, LEFT)))["peak_density_exact"] == 2.0


def test_density_error_adds_absolute_values():
    right = tube()
    factor = np.where(np.arange(right.x.size) % 2, 1.1, 0.95)
    wrong = right._replace(density=factor * right.density)
    volume = right.mass / wrong.density
    expected = volume @ np.abs(wrong.density - right.density) / (volume @ right.density)
    found = tube_figures.of(wrong)["density_L1_relative"]
    assert found == pytest.approx(expected, rel=ROUND_OFF)


def test_vacuum_tube_has_no_plateaus_and_shocks():
    parting = riemann.State(1.0, -9.0, 1.0), riemann.State(1.0, 9.0, 1.0)
    x = np.linspace(0.35, 0.9, 50)  # the vacuum ends at 0.31
    states = {"peak_density_exact", "density_L1_relative"}
    assert set(tube_figures.of(tube(np.concatenate([-x, x]), parting))) == states
    assert set(tube_figures.of(tube(time=0.0))) == states


def test_plateau_is_median_of_inner_part():
    """A hundred particles in each outer tenth and a third of those within are far off."""
    x, off = [], []
    for start, end in ((SPEED.left_tail, SPEED.contact), (SPEED.contact, SPEED.right_tail)):
        for low, high, wrong in (
            (0.0, 0.099, 1),
            (0.901, 1.0, 1),
            (0.101, 0.5, 0),
            (0.5, 0.899, 0),
        ):
            share = np.linspace(low, high, 100 if wrong else 15)
            x.append(TIME * (start + share * (end - start)))
            off.append(np.full(share.size, wrong))
            off[-1][::3] = 1
    exact = tube(np.concatenate(x))
    off = 5.0 * np.concatenate(off)
    found = tube_figures.of(
        exact._replace(
            density=exact.density * (1.01 + off), velocity=exact.velocity - 0.02 - off,
            pressure=exact.pressure * (0.97 + off),
        )
    )  # fmt: skip
    change = 1.0 - STAR.velocity  # of the left gas, more than that of the right
    assert change > STAR.velocity + 3.0 > 0.0
    for side in ("left", "right"):
        figures = [
            found[f"plateau_{side}_{name}_error"] for name in ("density", "velocity", "pressure")
        ]
        assert figures == pytest.approx([0.01, -0.02 / change, -0.03], rel=1e-9)


@pytest.mark.parametrize("too_far", [0.05, -0.05])
@pytest.mark.parametrize("side", ["left", "right"])
def test_shock_distance_relative_to_gas_ahead(side, too_far):
    """The jump is a slope, between whose particles the middle is found to round-off."""
    left = side == "left"
    shock, ahead = (SPEED.left_head, LEFT) if left else (SPEED.right_head, RIGHT)
    behind = STAR.density_left if left else STAR.density_right
    exact = tube()
    way = (shock - ahead.velocity) * TIME
    place = shock * TIME + too_far * way
    outward = (exact.x - place) * (-1.0 if left else 1.0)
    share = np.clip(0.5 - outward / 0.02, 0.0, 1.0)  # 0 ahead of the shock and 1 behind it
    density = ahead.density + share * (behind - ahead.density)
    here = exact.x < SPEED.contact * TIME if left else exact.x > SPEED.contact * TIME
    bent = exact._replace(density=np.where(here, density, exact.density))
    assert tube_figures.of(bent)[f"shock_{side}_error"] == pytest.approx(too_far, rel=1e-9)


def test_weak_shock_is_not_measured():
    """Of 1 % in density, as states in a few digits leave; one of 4 % is a shock."""
    for rise, there in ((1.014, False), (1.057, True)):
        push = riemann.State(1.0, 0.0, 1.0), riemann.State(1.0, 0.0, rise**2)
        assert ("shock_left_error" in tube_figures.of(tube(states=push))) == there


def test_contact_heating_is_maximum_between_outer_waves():
    exact = tube()
    heat = np.ones(exact.x.size)
    inner = np.flatnonzero((SPEED.left_tail * TIME < exact.x) & (exact.x < SPEED.right_tail * TIME))
    heat[inner[[3, 7]]] = 1.2, 1.1
    heat[[inner[0] - 1, inner[-1] + 1]] = 3.0  # in the gas outside
    found = tube_figures.of(exact._replace(internal_energy=heat * exact.internal_energy))
    assert found["contact_energy_excess"] == pytest.approx(0.2, rel=1e-9)


def test_tube_figures_from_diaphragm_within_error_region():
    problem = ShockTube(n=100, discontinuity=0.1, error_range=[-0.3, 0.4])
    position, _, mass, *_ = problem.initial(AIR)
    exact = problem.exact(AIR, TIME, position)
    outside = (position[0] < -0.3) | (position[0] > 0.4)
    assert outside.any()
    velocity = -exact["velocity"]
    particles = type("Particles", (), {
        "position": position, "mass": mass, "velocity": velocity,
        "density": np.where(outside, 9.0, exact["density"]),
        "internal_energy": exact["internal_energy"],
    })  # fmt: skip
    found = problem.report(AIR, TIME, particles, None)
    found |= problem.compare(AIR, TIME, particles, exact["pressure"])
    assert found["peak_density"] == exact["density"][~outside].max()
    assert found["density_L1_relative"] == 0.0
    assert abs(found["plateau_left_density_error"]) < ROUND_OFF
    # of gas that goes the wrong way
    assert found["plateau_left_velocity_error"] == pytest.approx(-2.0, rel=1e-9)
