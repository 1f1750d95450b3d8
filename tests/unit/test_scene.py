"""What a configuration compiles in: every property of a scene, where it holds and where not."""

import math

import numpy as np
import pytest

from sph import config as configuration
from sph.formulations.gas.smoothing import Smoothing
from sph.formulations.gas.weighting import ByMass, ByNumber
from sph.parts.conductivity.pressure_jump import PressureJump
from sph.scene import Scene

TEXT = '[problem]\nname = "uniform"\nn = 64\nboundary = "open"\n'
FIELD = 'physics.external={ name = "point_mass", mass = 1.0 }'
HEATING = 'physics.heating={ name = "relaxation", energy = 1.0, time = 0.1 }'
RANGE = "physics.alpha={ min = 0.1, max = 2.0 }"
SHOCKS = 'physics.alpha={ min = 0.1, max = 2.0, switch = "cullen_dehnen" }'
CONTACTS = 'physics.conductivity={ name = "pressure_jump", switched = true }'
STILL = "physics.balsara=false"
LINE = "problem.dimension=1"


def scene(*overrides):
    return Scene(configuration.from_text(TEXT).override(overrides))


def has_field(*names):
    return lambda scene: set(names) <= {field.name for field in scene.fields}


def has_pass(phase):
    return lambda scene: phase in {one.phase for one in scene.passes}


@pytest.mark.parametrize(
    ("holds", "there", "absent"),
    [
        (has_field("alpha"), [[RANGE], [SHOCKS]], [[]]),
        (has_field("alpha_rate", "predicted_alpha"), [[RANGE]], [[], [SHOCKS]]),
        (has_pass("viscosity"), [[SHOCKS]], [[], [RANGE]]),
        (lambda scene: scene.formulation.exchanges,
         [["physics.conductivity=approach"], [CONTACTS]], [[]]),
        (has_field("exchange_share"), [[CONTACTS]], [[], ["physics.conductivity=pressure_jump"]]),
        (has_pass("conductivity"), [[CONTACTS]], [[], ["physics.conductivity=pressure_jump"]]),
        (has_field("pressure", "energy_shift"), [["physics.scheme=pressure_energy"]], [[]]),
        # heavy gas beside light, and a field: neither sends a signal that would bound the step
        (lambda scene: scene.step_bounds.acceleration,
         [[FIELD], ["physics.density=number"]], [[], [HEATING]]),
        (has_field("curl_v"), [[]], [[STILL], [LINE]]),
        (has_field("div_v"), [[], [LINE], [STILL, RANGE]], [[STILL], [STILL, LINE]]),
        (has_field("balsara"), [[], [LINE]], [[STILL], [STILL, RANGE]]),
        (lambda scene: scene.adds_energy, [[HEATING]], [[], [FIELD]]),
        (lambda scene: scene.is_filled,
         [["problem.boundary=mirror"], ["problem.boundary=periodic"]],
         [[], ["problem.boundary=['periodic', 'open']"]]),
    ],
    ids=["evolves alpha", "rate of alpha", "finds shocks", "conducts", "share of contacts",
         "finds contacts", "sums pressure", "bounds acceleration", "needs curl",
         "needs divergence", "limits viscosity", "adds energy", "is filled"],
)  # fmt: skip
def test_scene_property_set_only_where_needed(holds, there, absent):
    assert [holds(scene(*overrides)) for overrides in there] == [True] * len(there)
    assert [holds(scene(*overrides)) for overrides in absent] == [False] * len(absent)


EVERY = {
    "id", "mass", "position", "velocity", "internal_energy", "support", "density", "acceleration",
    "energy_rate", "omega",
}  # fmt: skip


@pytest.mark.parametrize(
    ("overrides", "stored"),
    [
        ([], set()),
        ([RANGE], {"alpha", "alpha_rate"}),
        ([SHOCKS], {"alpha"}),
        (["physics.scheme=pressure_energy"], {"pressure"}),
        ([CONTACTS], set()),
        ([FIELD, HEATING, STILL], set()),
    ],
)
def test_checkpoint_stores_start_of_step_without_work_arrays(overrides, stored):
    fields = scene(*overrides).fields
    assert {field.name for field in fields if field.stored} == EVERY | stored
    assert len({field.name for field in fields}) == len(fields)  # each has one owner


def test_scene_with_vacuum_has_no_expected_volume():
    closed = configuration.from_text('[problem]\nname = "noh"\nn = 50\n')
    assert set(closed.problem.boundaries) == {"mirror"}
    assert not Scene(closed).is_filled


@pytest.mark.parametrize(
    ("overrides", "kept"),
    [
        ([], [1.0, 1.0]),
        (["problem.boundary=['mirror', 'open']"], [0.0, 1.0]),
        (["problem.boundary=['periodic', 'mirror']"], [1.0, 0.0]),
        ([FIELD], [0.0, 0.0]),
    ],
)
def test_scene_momentum_conserved_without_walls_and_field(overrides, kept):
    np.testing.assert_array_equal(scene(*overrides).keeps_momentum, kept)


@pytest.mark.parametrize(
    ("boundary", "expected"),
    [("'open'", 6.0), ("['periodic', 'open']", math.inf), ("['open', 'mirror']", math.inf)],
)
def test_scene_all_axes_open_limits_supports(boundary, expected):
    domain = "problem.domain=[[0.0, 1.0], [0.0, 2.0]]"
    found = scene(domain, f"problem.boundary={boundary}", "physics.max_support=3.0")
    assert found.max_support == found.formulation.models.max_support == expected


def test_scene_models_match_configuration():
    plain = scene().formulation.models
    assert plain.smoothing == Smoothing(2, 1e-10)
    assert isinstance(plain.weighting, ByMass)  # both are equal to ()
    assert plain.balsara is not None
    assert plain.exchange is None
    other = scene("physics.density=number", "physics.density_passes=3", STILL).formulation.models
    assert other.smoothing == Smoothing(3, 1e-10)
    assert isinstance(other.weighting, ByNumber)
    assert other.balsara is None
    conducting = scene(CONTACTS).formulation.models.exchange
    assert conducting == PressureJump(1.0, True)
    assert type(conducting) is PressureJump
    for made in (scene(), scene("physics.density_passes='converged'")):
        assert made.formulation.starting_models.smoothing == Smoothing(0, 1e-10)
    assert made.formulation.models == made.formulation.starting_models
    begun = scene().formulation.starting_models
    assert plain._replace(smoothing=None) == begun._replace(smoothing=None)


PARTS = {
    "equation for alpha": [RANGE],
    "gradients of velocity": [SHOCKS],
    "pressure sum over neighbours": ["physics.scheme=pressure_energy"],
    "artificial conductivity": ["physics.conductivity=approach"],
    "switch of conductivity": [CONTACTS],
    "external field": [FIELD],
    "heating": [HEATING],
    "Balsara factor": ["physics.balsara=true"],
    "divergence of velocity": [RANGE],
    "curl of velocity": ["physics.balsara=true"],
    "individual time steps": ["time.stepping=individual"],
    "time step limit u/|du/dt|": ["physics.energy_limit=true"],
}
NOTHING = [STILL, "physics.energy_limit=false"]
# What a part has asked for where it is there without that.
WITHOUT = {"switch of conductivity": ["physics.conductivity=approach"]}


@pytest.mark.parametrize("part", PARTS)
def test_scene_part_included_or_left_out_with_reason(part):
    inside, outside = scene(*NOTHING, *PARTS[part]).described()
    assert part in inside
    assert not any(one.startswith(f"{part}: ") for one in outside)
    inside, outside = scene(*NOTHING, *WITHOUT.get(part, [])).described()
    assert part not in inside
    (said,) = (one for one in outside if one.startswith(f"{part}: "))
    assert said != f"{part}: "
    # each part of a scene that has none, but for what a part that is left out would list
    left_out = {one.split(": ")[0] for one in scene(*NOTHING).described()[1]}
    assert left_out == {*PARTS, "self-gravity"} - {*WITHOUT}  # which needs 3-D, so is not in PARTS


def test_scene_names_parts_always_included():
    inside, outside = scene("problem.boundary=periodic", "physics.density=number").described()
    assert inside[:7] == [
        "2-D, 9 image(s) of the box",
        "sums over neighbours in double precision",
        "scheme grad_h, kernel wendland_c2",
        "density by number",
        "equation of state ideal_gas",
        "2 density pass(es)",
        "Balsara factor",
    ]
    inside, outside = scene(
        LINE, "physics.kernel={ name = 'cubic_spline', flattened = true }",
        "physics.eta=1.2", "physics.density_passes='converged'",
    ).described()  # fmt: skip
    assert inside[0] == "1-D, 1 image(s) of the box"
    assert "scheme grad_h, kernel cubic_spline, gradient flattened" in inside
    assert "supports converged to 1e-10" in inside
    assert "curl of velocity: no curl in 1-D" in outside
