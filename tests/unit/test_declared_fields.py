"""A pass reads the fields that it declares to read and writes those it declares to write.

Before every pass all other fields are set to NaN, and after it what it may not write is put back:
nothing may change.
"""

import numpy as np
import pytest
from marks import slow_except

from sph import config, parts, registry
from sph.clock import Clock
from sph.scene import Scene
from sph.simulation import Simulation, carried

SHOCKS = 'physics.alpha={ min = 0.1, max = 1.5, switch = "cullen_dehnen" }'
RANGE = "physics.alpha={ min = 0.1, max = 1.5 }"
CONTACTS = 'physics.conductivity={ name = "pressure_jump", switched = true }'
FIELD = 'physics.external={ name = "point_mass", mass = 0.1, softening = 0.2 }'
HEATING = 'physics.heating={ name = "relaxation", energy = 2.0, time = 0.1 }'
PLASTIC = 'physics.strength={ name = "elastic_plastic", shear_modulus = 0.5, yield_stress = 0.05 }'
FORMULATION = "physics.formulation=continuum"
SOLID = (FORMULATION, PLASTIC, "physics.tensile_correction=0.3")
TWO = ("problem.dimension=2", "problem.domain=[[-0.5, 0.5], [0.0, 0.1]]", "problem.n=300")

SCENES = [
    (),
    ("physics.balsara=false",),
    (RANGE, "physics.scheme=variational"),
    (SHOCKS, CONTACTS),
    ("physics.scheme=pressure_energy", "physics.conductivity=approach"),
    (FIELD, HEATING, RANGE),
    (*TWO, SHOCKS, "physics.density=number"),
    (*TWO, RANGE, CONTACTS, "physics.density_passes=converged"),
    (FORMULATION, "physics.correction=-1"),
    (*TWO, *SOLID),
    (*TWO, *SOLID, "physics.correction=1"),
]


def scene_of(settings):
    text = '[problem]\nname = "shock_tube"\nn = 80\n[time]\nend = 0.2\n'
    if FORMULATION in settings:  # the keys of another one would remain
        text += '[physics]\nformulation = "continuum"\n'
    return Scene(config.from_text(text, "the test").override(settings))


def begun(settings):
    return Simulation.start(scene_of(settings), 1, Clock())


def advance(simulation, steps):
    for _ in range(steps):
        simulation.advance(1.0)
    return simulation.particles.arrays()


def poison(simulation):
    """Set to NaN, before every pass, all that it does not declare to read."""
    make, state = simulation._make, simulation.particles

    def poisoned(one):
        kept = {}
        for field in state.fields:
            if field.name not in one.fields_read and not field.integer:
                kept[field.name] = getattr(state, field.name).copy()
                getattr(state, field.name)[:] = np.nan
        make(one)
        for name, array in kept.items():
            if name not in one.fields_written:
                assert np.isnan(getattr(state, name)).all(), f"{one.phase} writes {name}"
                getattr(state, name)[:] = array

    simulation._make = poisoned


@pytest.mark.parametrize(
    "settings", slow_except({0, 3}, SCENES), ids=lambda one: " ".join(one) or "as it comes"
)
def test_passes_with_nan_in_undeclared_fields_give_equal_results(settings):
    simulation = begun(settings)
    expected = {name: array.copy() for name, array in advance(simulation, 8).items()}
    again = begun(settings)
    poison(again)
    for name, array in advance(again, 8).items():
        assert array.tobytes() == expected[name].tobytes(), name


@pytest.mark.parametrize(
    "settings", slow_except({0, 3}, SCENES), ids=lambda one: " ".join(one) or "as it comes"
)
def test_steps_with_nan_in_fields_not_reordered_give_equal_results(settings):
    """NaN in them, wherever lists are built, changes nothing."""
    simulation = begun(settings)
    expected = {name: array.copy() for name, array in advance(simulation, 8).items()}
    again = begun(settings)
    build = again._build_lists

    def forget(dt, guess=False):
        build(dt, guess)
        for field in again.particles.fields:
            if field.name not in carried(again.scene):
                getattr(again.particles, field.name)[:] = np.nan

    again._build_lists = forget
    again.search.lists = None  # so that the coming step builds them
    advanced = advance(again, 8)
    for name in ("position", "velocity", "internal_energy"):
        # lists built elsewhere take their candidates in another order
        scale = np.abs(expected[name]).max()
        order = np.argsort(again.particles.id), np.argsort(simulation.particles.id)
        moved = advanced[name][..., order[0]] - expected[name][..., order[1]]
        assert np.abs(moved).max() < 1e-11 * scale, name


def test_fields_have_one_owner():
    for settings in SCENES:
        names = [field.name for field in scene_of(settings).fields]
        assert len(names) == len(set(names))


@pytest.mark.slow
def test_columns_match_energies_and_sums_of_parts():
    for settings in SCENES:
        simulation = begun(settings)
        for part in simulation.scene.all_parts:
            state = simulation.particles
            assert tuple({**part.energies(state), **part.sums(state)}) == tuple(part.columns)


def test_part_with_stored_fields_cannot_change_in_restart():
    """A key whose part has columns or fields that cannot be remade is not free to change."""
    for name in registry.names("sph.parts", folders=True):
        kind = registry.part_class("sph.parts", name)
        kept = kind.columns or any(
            field.stored and not field.remade for field in getattr(kind, "fields", ())
        )
        if kept:
            assert kind.keys[0].restart in ("same kind", "refused")
    assert len(parts.classes("gas")) >= 4
