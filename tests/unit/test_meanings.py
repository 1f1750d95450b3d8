"""Every column of the history and every entry of the summary has a meaning and a unit."""

import ast
import inspect
import re
import runpy
import textwrap
from pathlib import Path

import pytest

from sph import columns, config, meanings, quantity, registry
from sph.integrators.step_size import CRITERIA
from sph.quantity import Quantity
from sph.scene import Scene
from sph.summary import Summary

ROOT = Path(__file__).parents[2]
PROBLEMS = registry.names("sph.problems")
METHODS = ("diagnostics", "report", "compare", "over_time")
FIELDS = {"density", "velocity", "pressure", "internal_energy", "stress"}  # no figures
POWER = r"\^(-?\d+|-D|\(\d-D\))"
UNIT = re.compile(
    rf"((length|mass|time)({POWER})?( (?=\w)|$))*|s|CPU s|\(CPU s\)\^-1|bytes|unit of the field"
)


def problem_class(name):
    return registry.load("sph.problems", name).Problem


def everything():
    """Name and quantity of all that is declared."""
    yield from columns.OF_ALL.items()
    yield from ((name, one) for name, (one, _) in columns.OF_SOME.items())
    yield from meanings.of_summary().items()
    for formulation in registry.names("sph.formulations", folders=True):
        yield from meanings.of_part_columns(formulation).items()
    for name in PROBLEMS:
        yield from problem_class(name).quantities.items()


def test_page_matches_sources():
    script = runpy.run_path(str(ROOT / "scripts" / "write_output.py"))
    written = (ROOT / "docs" / "output.md").read_text()
    assert written == script["text"](), "run: python scripts/write_output.py"


def test_every_declaration_has_a_help_text_and_a_known_unit():
    for name, one in everything():
        assert isinstance(one, Quantity), name
        assert len(one.help) > 8, name
        assert not one.help.endswith("."), name
        assert UNIT.fullmatch(one.unit), f"{name}: {one.unit}"


def test_scene_and_declared_columns_have_the_same_names():
    """Scene.columns decides which columns there are, sph.columns what they mean."""
    text = '[problem]\nname = "evrard"\nn = 100\n[physics.heating]\nname = "relaxation"\n'
    rest = 'energy = 1.0\ntime = 1.0\n[time]\nstepping = "individual"\n'
    scene = Scene(config.from_text(text + rest))
    assert {*scene.columns} == {
        "held_supports", "gravitational_energy", "energy_added", "shortest_step", "updates"
    }  # fmt: skip
    closed = Scene(config.from_text('[problem]\nname = "uniform"\n'))
    assert closed.columns == ("volume_ratio",)
    for one in (scene, closed):
        for name in one.columns:
            assert meanings.of_column(one.config, name) is not None, name


def keys_in(function) -> set[str]:
    """The keys of dictionaries that a function writes out as texts."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    dicts = [node for node in ast.walk(tree) if isinstance(node, ast.Dict)]
    keys = [key for node in dicts for key in node.keys]
    keys += [
        node.slice
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store)
    ]
    return {key.value for key in keys if isinstance(key, ast.Constant) and key.value is not None}


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_figure_that_a_problem_writes_out_is_declared(name):
    problem = problem_class(name)
    for method in METHODS:
        for key in keys_in(getattr(problem, method)) - FIELDS:
            assert quantity.meaning(problem.quantities, key), f"{name}.{method}: {key}"


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_limited_figure_is_declared(name):
    problem = problem_class(name)
    tables = {one.partition(".")[2] for one in meanings.of_summary()}
    for figure in {*problem.limits, *problem.swamped}:
        if not figure.startswith("l1."):
            known = figure in tables or quantity.meaning(problem.quantities, figure)
            assert known, f"{name}: {figure}"


def test_column_of_the_history_is_found_by_name():
    ring = config.from_text('[problem]\nname = "keplerian_ring"\n')
    assert meanings.of_column(ring, "t").unit == "time"
    assert meanings.of_column(ring, "potential_energy").unit == "mass length^2 time^-2"
    assert "width of the ring" in meanings.of_column(ring, "radial_deviation").help
    assert meanings.of_column(ring, "nothing") is None


def test_entry_of_the_summary_is_found_by_name():
    bodies = problem_class("bodies")
    assert meanings.of_entry(bodies, "errors.fields.density.L1").unit == "unit of the field"
    assert meanings.of_entry(bodies, "cost.session.wall_seconds").unit == "s"
    assert meanings.of_entry(bodies, "report.body_0_velocity_x").unit == "length time^-1"
    assert meanings.of_entry(bodies, "report.peak_density") is None
    assert meanings.of_entry(bodies, "report").unit == ""


def test_entry_without_declaration_is_named(monkeypatch):
    monkeypatch.setitem(Summary.__annotations__, "more", int)
    with pytest.raises(KeyError, match="more"):
        meanings._entries(Summary, "")


def test_every_criterion_has_words():
    found = meanings.criteria()
    assert {*CRITERIA, "viscosity", "conductivity"} <= {*found}
    assert "None" not in found.values()
    assert meanings.of_criterion("gas", "viscosity") == found["viscosity"]
    assert meanings.of_criterion("gas", "nothing") is None


@pytest.mark.parametrize(
    ("unit", "powers"),
    [
        ("", (0, 0, 0)),
        (quantity.DENSITY, (-3, 1, 0)),
        (quantity.PRESSURE, (-1, 1, -2)),
        (quantity.SPECIFIC_ENERGY, (2, 0, -2)),
        ("mass length^(3-D) time^-2", (0, 1, -2)),
        (quantity.CPU_SECONDS, None),
        ("unit of the field", None),
    ],
)
def test_exponents_of_units_are_those_of_a_layer_one_unit_deep(unit, powers):
    assert quantity.exponents(unit) == powers


def test_compared_declares_expected_value_and_error():
    found = quantity.compared({"a": Quantity("a figure", "time")}, "reference")
    assert [*found] == ["a", "a_reference", "a_error"]
    assert [one.unit for one in found.values()] == ["time", "time", ""]
