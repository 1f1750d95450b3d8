"""Errors of a simulation that cannot go on: which particle they name, and why."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph import config as configuration
from sph import faults
from sph.domain import Domain
from sph.integrators.step_size import Bounds, StepLimit
from sph.neighbours.order import BLOCK
from sph.part import Part
from sph.parts.external import External
from sph.scene import Scene


def state(n=4, dimension=2, boundary="open", parts=(), **changed):
    """A simulation at step 4 whose n particles have IDs from 11 on, the highest first."""
    arrays = {
        "id": np.arange(n)[::-1] + 11,
        "position": np.arange(dimension * n).reshape(dimension, n) / 8.0,
        "velocity": np.ones((dimension, n)),
        "internal_energy": np.ones(n),
        "energy_rate": np.ones(n),
        "density": np.ones(n),
    }
    totals = SimpleNamespace(kinetic_energy=1.0, internal_energy=1.0, energies={})
    box = np.array([[0.0, 2.0]] * dimension)
    return SimpleNamespace(
        step=4, steps_here=1, time=0.5, totals=totals,
        particles=SimpleNamespace(**arrays | changed),
        scene=SimpleNamespace(
            all_parts=parts, domain=Domain(box, (boundary,) * dimension),
            physics=SimpleNamespace(C=0.1), is_single=False,
            step_bounds=Bounds(0.1, "signal_speed", True, False, 1.0),
        ),
    )  # fmt: skip


def test_fault_message_has_time_cause_and_suggestion(messages):
    error = faults.fault(state(), "it broke", "another way", 7)
    assert error.particle == 7
    messages.check(error)


class Strict(Part):
    """A part that bounds the step of each particle, and says no more about that."""


def test_step_limit_text_names_particle_and_criterion(messages):
    criteria = [*sorted(faults.SETS), "viscosity", "conductivity", Strict.name]
    text = '[problem]\nname = "uniform"\n[physics]\nconductivity = "approach"\n'
    parts = (*Scene(configuration.from_text(text)).all_parts, Strict())
    assert set(criteria) - set(faults.SETS) < {part.name for part in parts}
    simulation = state(parts=parts)

    def said(criterion, particle=8):
        simulation.limit = StepLimit(0.1, particle, criterion)
        return faults.what_sets(simulation)

    texts = {criterion: said(criterion) for criterion in criteria}
    assert all("particle 8 " in text for text in texts.values())
    assert len(set(texts.values())) == len(texts)
    texts["growth"] = said("growth", particle=0)
    messages.check("\n".join(f"{criterion}: {text}" for criterion, text in texts.items()))


def test_bad_values_counted_by_particle_and_first_named(messages):
    velocity = np.array([[0.0, 1.0, np.nan, np.inf], [0.0, 2.0, np.nan, np.inf]])
    simulation = state(velocity=velocity)
    error = faults.fault_of(simulation, "velocity", velocity, ~np.isfinite(velocity), "-")
    assert error.particle == 12
    messages.check(error)
    density = np.array([1.0, -2.0, 1.0, 1.0])
    error = faults.fault_of(simulation, "density", density, density < 0.0, "-")
    assert error.particle == 13
    messages.check(error)


def potential(position):
    return -np.array([1.0, 3.0, 2.0, 1.0])


@pytest.mark.parametrize(
    ("total", "changed", "name", "particle"),
    [
        ("potential_energy", {}, "potential energy", 13),
        # the fastest, though not along x
        ("kinetic_energy", {"velocity": np.array([[1.0, 2.0, 0.0, 0.0], [0.0, 0.0, 0.0, -3.0]])},
         "kinetic energy", 11),
        ("internal_energy", {"internal_energy": np.array([1.0, 2.0, 5.0, 3.0])},
         "internal energy", 12),
        (None, {"energy_rate": np.array([1.0, 2.0, -5.0, 3.0])}, "rate of energy", 12),
    ],
)  # fmt: skip
def test_non_finite_sum_names_particle_with_largest_term(messages, total, changed, name, particle):
    field = External(SimpleNamespace(potential=potential, softening=0.0))
    simulation = state(parts=(Strict(), field), **changed)
    simulation.totals.energies["potential_energy"] = 1.0
    if total == "potential_energy":
        simulation.totals.energies[total] = np.inf
    elif total:
        setattr(simulation.totals, total, np.inf)
    error = faults.endless_sum(simulation)
    assert error.particle == particle
    assert name in str(error)
    assert f"particle {particle} at (" in str(error)
    assert ("softening" in str(error)) == (total == "potential_energy")
    messages.check(error)
    if total != "potential_energy":  # nor is it asked for where there is no field
        simulation.scene.all_parts = ()
        assert str(faults.endless_sum(simulation)) == str(error)


def test_non_finite_energy_of_part_without_own_suggestion_gets_general_one(messages):
    class Restless(Part):
        def energies(self, state):
            return {"rest_energy": potential(state.position)}

    simulation = state(parts=(Restless(),))
    simulation.totals.energies["rest_energy"] = np.nan
    error = faults.endless_sum(simulation)
    assert error.particle == 13
    assert "physics.C" in str(error)
    messages.check(error)


def test_missing_neighbours_names_particles_of_block(messages):
    simulation = state(n=BLOCK + 3)
    error = faults.starved(simulation, 1)
    assert error.particle == 13
    assert "[13, 12, 11]" in str(error)
    messages.check(error)


@pytest.mark.parametrize(("boundary", "images"), [("open", 0), ("mirror", 1)])
def test_coincident_particles_counted_with_images(messages, boundary, images):
    """The third of four particles is at the wall of x = 0, where its image is, and another's."""
    position = np.array([[0.5, 0.0, 0.0, 0.5], [0.5, 0.25, 0.25, 0.75]])
    density = np.array([1.0, 1.0, -1.0, 1.0])
    crowd = state(boundary=boundary, position=position, density=density)
    error = faults.crowded(crowd)
    assert error.particle == 12
    others = 1 + 2 * images
    assert f"particle 12 at (0, 0.25): {others} " in str(error)
    messages.check(error)
    alone = state(boundary=boundary, density=density)
    messages.check(faults.crowded(alone))


@pytest.mark.parametrize(
    ("high", "boundary", "words"),
    [
        (
            1000.0,
            "periodic",
            "extend over 0.1 % of the domain along x, [0, 1000], which is periodic",
        ),
        (1000.0, "open", None),
        (2.0, "periodic", None),
    ],
)
def test_box_in_another_unit_than_positions_is_noted(high, boundary, words):
    problem = SimpleNamespace(boundaries=(boundary,) * 2, box=np.array([[0.0, high]] * 2))
    particles = SimpleNamespace(position=np.tile(np.linspace(0.0, 1.0, 9), (2, 1)), number=9)
    note = faults.mostly_empty(SimpleNamespace(config=SimpleNamespace(problem=problem)), particles)
    assert (note is None) if words is None else words in note
