"""What a restart may change: every key has a class, and its change is told or refused by it."""

import pytest

from sph import config as configuration
from sph import registry
from sph.config import physics, restarts
from sph.config.sections import SECTIONS

START = """
[problem]
name = "uniform"
dimension = 1
n = 60
boundary = "open"
[physics]
alpha = 1.0
[time]
end = 0.2
[output]
interval = 0.05
"""
HEATING = 'physics.heating={ name = "relaxation", energy = 1.0, time = 0.1 }'
RANGE = "physics.alpha={ min = 0.1, max = 2.0 }"
GRAVITY = ["problem.dimension=3", "physics.gravity={ G = 1.0 }"]  # not in 1-D

PHYSICS = {name: physics.table(name) for name in registry.names(physics.FORMULATIONS, folders=True)}
TABLES = {"physics": PHYSICS[physics.DEFAULT], **SECTIONS}
WATER = 'physics.eos={ name = "tait", rho_0 = 1.0, c_0 = 1.0 }'
CONTINUUM = f"""
[problem]
name = "uniform"
[physics]
formulation = "continuum"
{WATER.removeprefix("physics.")}
strength = {{ name = "elastic", shear_modulus = 1.0 }}
"""

# a changed value of every key beside [problem], by what a restart does with it
FREE = ["time.end=0.3", "output.interval=0.1", "output.frames=5", "report.reference=fine",
        "run.threads=2", "physics.max_energy_drift=0.1"]  # fmt: skip
RECORDED = ["physics.scheme=variational", "physics.kernel=cubic_spline", "physics.density=number",
            "physics.alpha=2.0", "physics.conductivity=approach", "physics.eta=1.5",
            "physics.allow_pairing=true", "physics.max_support=2.0", "physics.C=0.1",
            "physics.balsara=false",
            "physics.density_passes=3", "physics.energy_limit=false",
            "run.precision=single"]  # fmt: skip
REFUSED = ["physics.gamma=1.6", 'physics.eos={ name = "ideal_gas", gamma = 1.6 }',
           'physics.external={ name = "point_mass", mass = 1.0 }', HEATING, RANGE,
           "problem.n=61", "problem.density=2.0", "time.stepping=individual"]  # fmt: skip

UNITS = ["units.length=pc", "units.mass=M_sun", "units.time=3e13"]  # free; all or none

# those of the formulation "continuum" only
CONTINUUM_FREE = ["physics.allow_tearing=true"]
CONTINUUM_RECORDED = ["physics.spacing_ratio=1.5", "physics.q_a=1.0", "physics.q_b=0.5",
                      "physics.tensile_correction=0.3", "physics.balsara=false"]  # fmt: skip
CONTINUUM_REFUSED = [
    "physics.correction=1",
    'physics.strength={ name = "elastic", shear_modulus = 2.0 }',
]


def changes(overrides, start=(), text=START):
    before = configuration.from_text(text).override(start)
    return restarts.changes(before, before.override(overrides))


@pytest.mark.parametrize("name", [*SECTIONS, *PHYSICS, *registry.names("sph.problems")])
def test_every_key_has_a_class(name):
    section = (SECTIONS | PHYSICS).get(name) or registry.load("sph.problems", name).Problem
    for key in section.model_fields:
        assert restarts.class_of(section, key) in restarts.CLASSES, key


def test_units_may_change():
    found = changes(UNITS)
    assert [one.rule for one in found] == ["free"] * 3
    assert restarts.refusals(found) == []
    assert "units" not in restarts.lineage(1, 0.1, found)


def test_every_key_is_covered_by_these_tests():
    overrides = FREE + RECORDED + REFUSED + GRAVITY + UNITS
    tried = {override.partition("=")[0] for override in overrides}
    keys = {f"{name}.{key}" for name, table in TABLES.items() for key in table.model_fields}
    # a change of the formulation would change the other keys too
    assert keys - {"physics.formulation", "physics.materials"} <= tried
    tried |= {one.partition("=")[0] for one in CONTINUUM_FREE + CONTINUUM_RECORDED}
    tried |= {"physics.correction", "physics.strength", "physics.materials"}  # CONTINUUM_REFUSED
    assert restarts.class_of(PHYSICS["continuum"], "materials") == "refused"  # replaces the laws
    assert {f"physics.{key}" for key in PHYSICS["continuum"].model_fields} - {
        "physics.formulation"
    } <= tried
    assert restarts.class_of(TABLES["physics"], "formulation") == "refused"


@pytest.mark.parametrize("override", FREE)
def test_restart_key_without_effect_is_free(override):
    changed = changes([override])
    assert [one.key for one in changed] == [override.partition("=")[0]]
    assert restarts.refusals(changed) == []
    assert restarts.lineage(7, 0.1, changed) == "restarted at step 7, t = 0.1"


@pytest.mark.parametrize(
    ("override", "rule"),
    [(one, "free") for one in CONTINUUM_FREE]
    + [(one, "recorded") for one in CONTINUUM_RECORDED]
    + [(one, "refused") for one in CONTINUUM_REFUSED],
)
def test_restart_keys_of_continuum_have_their_class(override, rule):
    (one,) = changes([override], text=CONTINUUM)
    found = "recorded" if one.rule == "same kind" else one.rule
    assert found == rule
    assert bool(restarts.refusals([one])) == (rule == "refused")


@pytest.mark.parametrize("override", RECORDED)
def test_restart_key_of_equations_is_recorded(override):
    changed = changes([override])
    assert restarts.refusals(changed) == []
    (one,) = changed
    assert restarts.lineage(7, 0.1, changed) == f"restarted at step 7, t = 0.1 with {one}"
    assert one.key in str(one)
    assert "(was " in str(one)


@pytest.mark.parametrize("override", REFUSED)
def test_restart_key_of_initial_state_is_refused(override):
    assert any(
        override.partition("=")[0] in line for line in restarts.refusals(changes([override]))
    )


@pytest.mark.parametrize(
    ("start", "override", "refused"),
    [
        ([HEATING], "physics.heating.energy=2.0", False),
        (GRAVITY, "physics.gravity.G=2.0", False),
        (GRAVITY[:1], GRAVITY[1], True),
        ([RANGE], "physics.alpha.max=1.0", False),
        ([RANGE], "physics.alpha=1.0", True),
    ],
)
def test_restart_same_kind_accepts_new_parameters_only(start, override, refused):
    assert bool(restarts.refusals(changes([override], start))) == refused


def test_lineage_states_change_step_and_time():
    lines = (
        "restarted at step 3, t = 0.05",
        restarts.lineage(9, 0.125, changes(["physics.alpha=2.0", "time.end=0.3"])),
        restarts.lineage(12, 0.15, changes(["physics.conductivity=approach"])),
    )
    assert lines[1] == "restarted at step 9, t = 0.125 with physics.alpha = 2.0 (was 1.0)"
    first, second = restarts.settings_changed(lines)
    assert first == "physics.alpha = 2.0 (was 1.0) at t = 0.125"
    assert second.startswith("physics.conductivity = {")
    assert second.endswith("(was not given) at t = 0.15")


def test_change_text_has_new_and_old_value():
    one = restarts.Change("physics.alpha", 1.0, 2.5, "recorded")
    assert str(one) == "physics.alpha = 2.5 (was 1.0)"
    assert str(one._replace(was=None)) == "physics.alpha = 2.5 (was not given)"
    assert str(one._replace(now=None)) == "physics.alpha = not given (was 1.0)"


@pytest.mark.parametrize(
    ("was", "now", "kind"),
    [
        (1.0, {"min": 0.1}, "one number"),
        ({"min": 0.1}, 1.5, "a table"),
        ("name", 1.5, "a name"),
        (None, 1.5, "none"),
    ],
)
def test_restart_other_kind_refused_naming_old_kind(was, now, kind):
    one = restarts.Change("physics.alpha", was, now, "same kind")
    (line,) = restarts.refusals([one])
    assert line.startswith("physics.alpha = ")
    assert "1.5" in line or "min" in line
    assert line.endswith(f": expected {kind}, as in the checkpoint")
    assert restarts.refusals([one._replace(now=was)]) == []
    assert restarts.refusals([one._replace(rule="recorded")]) == []


def test_lineage_change_of_same_kind_has_all_digits():
    alike = restarts.Change("physics.heating", {"energy": 1.0}, {"energy": 2.0}, "same kind")
    free = restarts.Change("run.threads", 1, 2, "free")
    line = restarts.lineage(7, 0.1234567890123, [free, alike])
    assert line.startswith("restarted at step 7, t = 0.1234567890123 with physics.heating = ")
    assert "threads" not in line
    assert restarts.settings_changed([line])[0].endswith(" at t = 0.123457")
