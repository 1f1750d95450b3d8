"""What float64 cannot resolve is refused before the first step, or told.

The thresholds are bracketed by powers of 2, at which the gap between numbers doubles.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sph import config as configuration
from sph import resolution
from sph.clock import Clock
from sph.errors import NumericalError
from sph.scene import Scene
from sph.simulation import Simulation

CONFIGS = Path(__file__).parents[2] / "configs"

UNIFORM = """
[problem]
name = "uniform"
dimension = {dimension}
n = 100
domain = [{low!r}, {high!r}]
boundary = "{boundary}"
[time]
end = 0.2
[output]
interval = 0.2
"""


def far_box(dimension, gap, boundary="periodic"):
    """Gas in a box of length 1 so far from 0 that neighbouring numbers are `gap` apart there."""
    low = gap * 2.0**52
    return configuration.from_text(
        UNIFORM.format(dimension=dimension, low=low, high=low + 1.0, boundary=boundary)
    )


# spacings are 0.01 in 1-D and 0.1 in 2-D
@pytest.mark.parametrize("boundary", ["periodic", "open", "mirror"])
@pytest.mark.parametrize(
    ("dimension", "refused", "doubted"), [(1, 2.0**-18, 2.0**-28), (2, 2.0**-15, 2.0**-25)]
)
def test_position_resolution_at_both_thresholds(simulate, dimension, refused, doubted, boundary):
    with pytest.raises(NumericalError, match=r"resolve the position[\s\S]*closer to 0") as caught:
        resolution.check(simulate(far_box(dimension, refused, boundary)))
    assert caught.value.particle > 0
    for gap in (refused / 2, doubted):
        simulation = simulate(far_box(dimension, gap, boundary))
        resolution.check(simulation)
        assert "does not resolve the position" in resolution.doubt(simulation)
    simulation = simulate(far_box(dimension, doubted / 2, boundary))
    resolution.check(simulation)
    assert resolution.doubt(simulation) is None


@pytest.mark.parametrize("dimension", [1, 2])
def test_particles_coincident_by_rounding_are_refused(dimension):
    clock = Clock()
    simulation = Simulation.of_problem(Scene(far_box(dimension, 0.25)), 1, clock)
    with pytest.raises(NumericalError, match="does not resolve the position"):
        resolution.check_extent(simulation)
    simulation.close()
    clock.close()


def change(simulation):
    """Largest velocity over the speed of sound, and relative change of u, of gas at rest."""
    u = simulation.particles.internal_energy[0]
    while simulation.time < 0.2:
        simulation.advance(0.2)
    p = simulation.particles
    return max(np.abs(p.velocity).max() / np.sqrt(1.4 * 0.4 * u), np.ptp(p.internal_energy) / u)


def test_refused_positions_give_wrong_density_accepted_right(simulate, monkeypatch):
    assert change(simulate(far_box(1, 2.0**-19))) < 1e-3  # the largest gap that is not refused
    assert change(simulate(far_box(1, 2.0**-29))) < 1e-6  # the largest of which nothing is told
    monkeypatch.setattr(resolution, "REFUSED", np.inf)
    # eight times the smallest gap that is refused: errors scatter by a factor of five
    assert change(simulate(far_box(1, 2.0**-15))) > 1e-3


def moving(name, mach):
    config = configuration.load(CONFIGS / name)
    return config.override([f"problem.velocity=[{mach * np.sqrt(1.4):.17g}, 0.0]"])


def test_velocity_resolution_at_both_thresholds(simulate):
    shipped = simulate(configuration.load(CONFIGS / "moving_box.toml"))  # Mach 1e5
    resolution.check(shipped)
    assert resolution.doubt(shipped) is None
    told = simulate(moving("moving_box.toml", 1e11))
    resolution.check(told)
    assert "does not resolve the velocity" in resolution.doubt(told)
    for mach in (1e13, 1e17):
        with pytest.raises(NumericalError, match=r"resolve the velocity[\s\S]*bulk velocity"):
            resolution.check(simulate(moving("moving_box.toml", mach)))


def gas(velocity, n=4):
    return SimpleNamespace(
        mass=np.ones(n), position=np.linspace(0.0, 1.0, n)[None], velocity=np.array([velocity])
    )


@pytest.mark.parametrize(
    ("velocity", "sound_speed"),
    [
        ([1.0, 1.0, -1.0, -1.0], 1e-30),  # cold streams that meet: their velocities are resolved
        ([0.0, 0.0, 0.0, 0.0], 0.0),  # gas without pressure at rest
        ([0.0, 0.0, 0.0, 0.0], np.nan),  # gas torn apart: the watchdog tells
    ],
)
def test_cold_gas_is_accepted(velocity, sound_speed):
    gap = resolution.largest_gap(gas(velocity), 0.3, np.full(4, sound_speed))
    assert gap.ratio < 1e-14


def test_dense_cloud_far_from_origin_is_found(simulate):
    """Each particle is measured by its own spacing, not by a mean or a median."""
    particles = gas([0.0, 0.0, 0.0, 0.0])
    gap = resolution.largest_gap(particles, np.array([1.0, 1.0, 1e-13, 1.0]), np.ones(4))
    assert (gap.kind, gap.index) == ("position", 2)
    assert gap.ratio > resolution.REFUSED


def test_gaps_from_largest_component_and_median_velocity():
    """Of three particles: y at 2^20, whose gap is 2^-32, and speeds about a median of 2^10."""
    particles = SimpleNamespace(
        mass=np.ones(3),
        position=np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 2.0**20]]),
        velocity=np.array([[0.0, 0.0, 0.0], [2.0**10, 2.0**10 + 3.0, -1e6]]),
    )
    gap = resolution.largest_gap(particles, np.array([1.0, 1.0, 0.5]), 1.0)
    assert gap == ("position", 2, 2.0**-32, 0.5)
    assert gap.ratio == 2.0**-31
    near = SimpleNamespace(**vars(particles) | {"position": np.zeros((2, 3))})
    # the first is one sound speed from what can be lost, the second four
    assert resolution.largest_gap(near, 1.0, 1.0) == ("velocity", 0, 2.0**-42, 1.0)


@pytest.fixture
def simulation_with_gap(monkeypatch):
    """A function of kind and ratio: a simulation whose last particle has this gap over scale."""

    def made(kind, ratio):
        gap = resolution.Gap(kind, 2, ratio * 8.0, 8.0)
        monkeypatch.setattr(resolution, "_gap_of", lambda _: gap)
        particles = SimpleNamespace(
            id=np.array([5, 6, 9]), position=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
            velocity=-np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        )  # fmt: skip
        scene = SimpleNamespace(is_single=False)
        return SimpleNamespace(particles=particles, scene=scene, step=0, time=0.0)

    return made


@pytest.mark.parametrize(
    ("kind", "place", "words", "remedy"),
    [
        ("position", "(3, 6)", "the particle spacing (8)", "problem.domain"),
        ("velocity", "(-3, -6)", "the speed of sound (8)", "bulk velocity"),
    ],
)
def test_message_names_particle_gap_and_scale(simulation_with_gap, kind, place, words, remedy):
    simulation = simulation_with_gap(kind, 2e-3)
    with pytest.raises(NumericalError) as caught:
        resolution.check(simulation)
    assert caught.value.particle == 9
    said = str(caught.value)
    assert f"the {kind} {place} of particle 9: the next float64 number is 0.016 away" in said
    assert "which is 0.002 of" in said
    assert words in said
    assert remedy in said.partition("Try:")[2]
    doubt = resolution.doubt(simulation)
    assert "errors up to 0.01. Try" in doubt  # five times the ratio
    assert remedy in doubt.partition("Try:")[2]


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_thresholds_apply_to_ratio(simulation_with_gap, kind):
    for ratio, is_refused in ((2.1e-4, True), (1.9e-4, False)):
        simulation = simulation_with_gap(kind, ratio)
        if is_refused:
            with pytest.raises(NumericalError):
                resolution.check(simulation)
        else:
            resolution.check(simulation)
    assert resolution.doubt(simulation_with_gap(kind, 2.1e-7)) is not None
    assert resolution.doubt(simulation_with_gap(kind, 1.9e-7)) is None


@pytest.mark.parametrize(("dimension", "gap", "is_refused"), [
    (2, 2.0**-15, True), (2, 2.0**-16, False), (3, 2.0**-14, True), (3, 2.0**-15, False),
])  # fmt: skip
def test_spacing_before_supports_is_box_average(dimension, gap, is_refused):
    """64 particles in a box of 1: spacings of 1/8 and 1/4, of which 2e-4 is 2^-15.3 and 2^-14.3."""
    place = gap * 2.0**52
    domain = SimpleNamespace(box=np.array([[place, place + 1.0]] * dimension))
    simulation = SimpleNamespace(
        scene=SimpleNamespace(domain=domain),
        particles=SimpleNamespace(
            number=64, id=np.arange(64), mass=np.ones(64), velocity=np.zeros((dimension, 64)),
            position=np.full((dimension, 64), place),
        ), step=0, time=0.0,
    )  # fmt: skip
    if is_refused:
        with pytest.raises(NumericalError, match="does not resolve the position"):
            resolution.check_extent(simulation)
    else:
        resolution.check_extent(simulation)


def test_spacing_is_support_over_spacings_per_support():
    """H is 4 spacings; a particle without a support has an error of its own."""
    simulation = SimpleNamespace(
        scene=SimpleNamespace(
            formulation=SimpleNamespace(
                models=SimpleNamespace(support_ratio=2.5, eta=1.6),
                sound_speed=lambda p: p.internal_energy,
            ),
        ),
        particles=SimpleNamespace(
            mass=np.ones(3), density=np.array([1.0, 1.0, -1.0]), internal_energy=np.ones(3),
            support=np.array([1.0, 0.5, 1e-30]), velocity=np.zeros((1, 3)),
            position=np.full((1, 3), 2.0**20),
        ),
    )  # fmt: skip
    assert resolution._gap_of(simulation) == ("position", 1, 2.0**-32, 0.125)


@pytest.mark.parametrize("none", [0.0, np.nan])
def test_zero_sound_speed_does_not_hide_other_particles(none):
    sound_speed = np.array([none, none, 1e-10, 1.0])
    gap = resolution.largest_gap(gas([8.0] * 4), 0.3, sound_speed)
    assert gap == ("velocity", 2, 2.0**-49, 1e-10)


def test_nan_position_does_not_hide_other_particles():
    particles = gas([0.0] * 4)
    particles.position = np.array([[np.nan, 1.0, 2.0**20, 1.0]])
    gap = resolution.largest_gap(particles, 0.25, 1.0)
    assert gap == ("position", 2, 2.0**-32, 0.25)
