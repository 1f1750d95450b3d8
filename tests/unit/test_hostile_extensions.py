"""Files in `sph_extensions` that are wrong: each error names file or class and what is expected."""

import importlib
import sys
import textwrap

import numpy as np
import pytest
from click.testing import CliRunner

from sph import columns, config, declarations, parts, preview, registry, runner
from sph.cli import main
from sph.clock import Clock
from sph.config import choices, physics
from sph.declarations import parts as declared
from sph.errors import ConfigError, DeclarationError, NumericalError
from sph.output import checkpoint, stored
from sph.scene import Scene
from sph.simulation import Simulation
from sph.state import State

KERNEL = '''
"""A kernel."""
from typing import NamedTuple
from sph.kernels import Defaults
from sph.model import model

@model(Defaults)
class Mine(NamedTuple):
    """A kernel."""
    def normalisation(self, dim): return 1.0
    def w(self, dim, q): return 1.0 - q
    def dw_over_q(self, dim, q): return -1.0
    def force_over_q(self, dim, q): return -1.0
'''
SWITCH = '''
"""A switch."""
from typing import Annotated, NamedTuple
from sph.model import model
from sph.parts.viscosity import HIGHEST, LOWEST, Switch

@model(Switch)
class Mine(NamedTuple):
    """A switch."""
    min: Annotated[float, LOWEST]
    max: Annotated[float, HIGHEST]
    def alpha_rate(self, alpha, h, sound_speed, divergence): return 0.0 * alpha
'''
PART = '''
"""A part."""
from sph.integrators.leapfrog import STRAIGHT
from sph.part import Evolved, Key, Part, Pass
from sph.quantity import Quantity
from sph.state import Field, Public

def one(column): return {column: Quantity("help")}

class Mine(Part):
    """A part."""
    keys = (Key("mine", "help", kind=float, restart="same kind"),)
    @classmethod
    def of(cls, scene):
        return None if scene.physics.mine is None else cls()
'''
SCENE = '[problem]\nname = "shock_tube"\nn = 60\n[physics]\n{}\n[time]\nend = 0.1\n'
PART_FILE = "parts/mine/__init__.py"


def with_body(text):
    return PART + textwrap.indent(textwrap.dedent(text), "    ")


def with_pass(arguments):
    return with_body(
        f'fields = (Field("a"),)\ndef __init__(self):\n    self.passes = (Pass({arguments}),)\n'
    )


def evolved(*ranks, stored="True"):
    fields = ", ".join(
        f'Field("a{k}", rank={rank}, stored={stored})' for k, rank in enumerate(ranks)
    )
    return with_body(f'fields = ({fields},)\nevolved = (Evolved("a0", "a1", "a2", STRAIGHT),)')


def forget():
    for cached in (
        parts.classes, physics.table, registry.part_class, registry.model_class,
        choices.labelled_table,
    ):  # fmt: skip
        cached.cache_clear()
    for name in [name for name in sys.modules if name.startswith("sph_extensions")]:
        del sys.modules[name]
    registry._known.clear()
    importlib.invalidate_caches()


@pytest.fixture
def extension(tmp_path, monkeypatch):
    """Write a file of sph_extensions, where this process finds it."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(name, text):
        path = tmp_path / "sph_extensions" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        forget()

    yield write
    monkeypatch.undo()
    forget()


def read(settings="mine = 1.0"):
    return config.from_text(SCENE.format(settings), "the test")


def described(settings):
    preview.describe(read(settings))


BROKEN_MODELS = {
    "a syntax error": ("def (:", r"bad\.py, line 1: cannot be imported: SyntaxError"),
    "an import": ("\nimport nothing_here", r"bad\.py, line 2: .* 'nothing_here'"),
    "no class": ("x = 1", r"bad\.py: expected one class that is a NamedTuple, found none"),
    "two classes": (KERNEL + KERNEL.replace("class M", "class N"), "found Mine, Nine"),
    "no decorator": (KERNEL.replace("@model(Defaults)", ""), r"bad: decorate Mine with @model"),
    "no method": (KERNEL.replace("def w(", "def v("), r"bad\.Mine: w missing"),
    "other arguments": (KERNEL.replace("w(self, dim, q)", "w(self, dim, x)"), "expected w.*, q"),
    "a parameter `name`": (KERNEL + "    name: float = 1.0\n", "'name': this name is reserved"),
    "a parameter `issues`": (KERNEL + "    issues: float = 1.0\n", "'issues': this name is"),
    "a list": (KERNEL + "    k: list = [1.0]\n", r"'k': the default is \[1.0\], expected a number"),
    "an annotation": (KERNEL + '    k: "Nonsense" = 1.0\n', "annotation cannot be resolved"),
}


@pytest.mark.parametrize("case", BROKEN_MODELS)
def test_a_kernel_that_is_wrong(extension, case):
    text, message = BROKEN_MODELS[case]
    extension("kernels/bad.py", text)
    with pytest.raises(DeclarationError, match=message):
        described('kernel = "bad"')


@pytest.mark.parametrize(
    ("file", "text"), [("kernels/wendland_c2.py", KERNEL), ("parts/heating/__init__.py", PART)]
)
def test_a_name_that_sph_has_is_refused_not_ignored(extension, file, text):
    extension(file, text)
    with pytest.raises(DeclarationError, match="has a choice of this name"):
        described('kernel = "wendland_c2"')


def test_a_switch_without_its_range_or_its_rate(extension):
    for missing in ("    min: Annotated[float, LOWEST]\n", "def alpha_rate"):
        extension(
            "parts/viscosity/switches/bad.py",
            SWITCH.replace(missing, "def other" * ("def" in missing)),
        )
        with pytest.raises(DeclarationError, match=r"bad\.Mine: (min|alpha_rate) missing"):
            described('alpha = { switch = "bad", min = 0.1, max = 1.0 }')


def test_a_parameter_without_help_and_bounds_is_a_plain_number(extension):
    extension("kernels/good.py", KERNEL + "    k: float = 1.0\n")
    assert read('kernel = { name = "good", k = 2.0 }').physics.kernel_model().k == 2.0


BROKEN_PARTS = {
    "a syntax error": ("def (:", r"__init__\.py, line 1: cannot be imported"),
    "no class": ("x = 1", "expected one class that is a subclass of Part, found none"),
    "two classes": (PART + PART.replace("class M", "class N"), "found Mine, Nine"),
    "no of": (PART.replace("def of", "def off"), r"Mine: expected a class method of\(scene\)"),
    "no keys": (PART.replace("keys = (K", "others = (K"), "keys: expected at least one"),
    "one key without a comma": (PART.replace('kind"),)', 'kind"))'), "a comma is missing"),
    "a key without a type": (PART.replace("kind=float, ", ""), "expected kind, a type"),
    "a key with a space": (PART.replace('"mine"', '"my key"'), "letters, digits and _"),
    "a class of restart": (PART.replace("same kind", "never"), "restart='never', expected one"),
    "a key of [physics]": (PART.replace('"mine"', '"C"'), "'C' is declared by the table"),
    "an attribute of [physics]": (PART.replace('"mine"', '"shown"'), "'shown' is declared by"),
    "a key of another part": (PART.replace('"mine"', '"heating"'), r"declared by sph.*too"),
    "a folder of models": (
        PART.replace("kind=float", 'models="sph.parts.nowhere"'), "sph.parts.nowhere has none"
    ),
    "a default model": (
        PART.replace("kind=float", 'models="sph.eos", default_model="x"'), "has ideal_gas, mie_gr"
    ),
    "a formulation": (
        with_body('formulations = ("gaz",)'), "'gaz' is none, expected one of continuum, gas"
    ),
    "another object": (PART.replace("cls()", "cls"), "expected a Mine or None"),
    "rank 5": (with_body('fields = (Field("a", rank=5),)'), r"rank = 5, expected 0 \(scalar\)"),
    "no field": (with_body('fields = ("a",)'), "'a' is not a Field"),
    "a second ID": (with_body('fields = (Field("a", integer=True),)'), "only the ID"),
    "a field twice": (with_body('fields = (Field("a"), Field("a"))'), "'a' is declared by .* too"),
    "a public name twice": (
        with_body('fields = (Field("a", public=Public("Masses", 0, 0, 0, 0, "")),)'),
        "public name 'Masses' is that of field 'mass' too",
    ),
    "no public name": (
        with_body('fields = (Field("a", public="A"),)'), "expected public=Public"
    ),
    "a public link": (
        with_body('fields = (Field("a", public=Public("Density", 0, 0, 0, 0, "")),)'),
        "'Density' is reserved",
    ),
    "a public tensor": (
        with_body('fields = (Field("a", rank=2, public=Public("A", 0, 0, 0, 0, "")),)'),
        "'a': a tensor has no public name",
    ),
    "a stage": (
        with_pass('"later", "x", print, (), ()'),
        "stage 'later': expected one of prediction, density",
    ),
    "a pass that reads nothing": (with_pass('"rates", "x", print, ("b",), ()'), "'b' is not a f"),
    "a pass that writes nothing": (with_pass('"rates", "x", print, (), ("b",)'), "'b' is not a f"),
    "names as a text": (with_pass('"rates", "x", print, "mass", ()'), "reads = 'mass': expected"),
    "no function": (with_pass('"rates", "x", None, (), ()'), "function = None is not a function"),
    "unknown evolved": (with_body('evolved = (Evolved("b", "b", "b", STRAIGHT),)'), "evolved: 'b'"),
    "evolved of two ranks": (evolved(1, 0, 0), "expected three fields of equal rank"),
    "evolved, not stored": (evolved(0, 0, 0, stored="False"), "expected value and rate to be st"),
    "no rule": (evolved(0, 0, 0).replace("STRAIGHT)", "None)"), "expected a Rule, not None"),
    "a need": (with_body('needs = ("vorticity",)'), "needs: 'vorticity' is not a field"),
    "a term": (with_body('terms = {"magic": None}'), "'magic': .*Gas calls one of viscosity"),
    "the viscosity": (with_body('terms = {"viscosity": None}'), "'viscosity' is that of"),
    "a column of every history": (with_body('columns = one("t")'), "column 't': expected a name"),
    "a column with a comma": (with_body('columns = one("a,b")'), "column 'a,b': expected a name"),
    "columns as a text": (with_body('columns = "abc"'), "expected names with quantities"),
    "a column without meaning": (with_body('columns = {"a": Quantity("")}'), "'a' has no meaning"),
    "a column without a quantity": (with_body('columns = {"a": "x"}'), "'a' has no meaning"),
    "no description": (with_body("def described(self): return 'x'"), "expected a pair of lists"),
    "an issue of no key": (
        with_body("@classmethod\ndef issues(cls, physics, problem): return [('b', 'text')]"),
        r"\('b', 'text'\), expected \(key of",
    ),
    "no list of issues": (
        with_body("@classmethod\ndef issues(cls, physics, problem): return None"),
        "issues returned None, expected a list",
    ),
    "state that a restart may drop": (
        with_body('fields = (Field("a"),)').replace("same kind", "recorded"),
        r"\"same kind\" or, for kind=bool, \"refused\".*\(a\)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN_PARTS)
def test_a_part_that_is_wrong(extension, case):
    text, message = BROKEN_PARTS[case]
    extension(PART_FILE, text)
    with pytest.raises(DeclarationError, match=message):
        described("mine = 1.0")


def test_names_that_a_state_or_a_checkpoint_has_are_no_fields(extension):
    for name in ("number", "get", "arrays", "fields", "time", "list_support", "My field"):
        extension(PART_FILE, with_body(f'fields = (Field("{name}"),)'))
        with pytest.raises(DeclarationError, match=f"field '{name}': expected a name"):
            described("mine = 1.0")


@pytest.mark.parametrize("name", ["density", "omega", "balsara", "energy_shift", "exchange_share"])
def test_a_field_of_another_part_cannot_be_declared_even_where_its_owner_is_left_out(
    extension, name
):
    """Zeros in `balsara` would turn viscosity off, without a word."""
    extension(PART_FILE, with_body(f'fields = (Field("{name}"),)'))
    with pytest.raises(DeclarationError, match=f"field '{name}' is declared by sph.* too"):
        described("mine = 1.0\nbalsara = false")


def test_two_parts_cannot_share_a_field_or_a_column(extension):
    for what in ('fields = (Field("a"),)', 'columns = one("a")'):
        extension("parts/other/__init__.py", with_body(what).replace("mine", "other"))
        extension(PART_FILE, with_body(what))
        with pytest.raises(DeclarationError, match=r"'a' is declared by .*mine\.Mine too"):
            described("mine = 1.0\nother = 1.0")


def test_what_the_parts_of_sph_declare_in_some_scenes_is_reserved():
    """In every scene of the test of passes: a name missing there could be taken by a user."""
    from test_declared_fields import SCENES, scene_of

    # in every scene of a formulation
    gas = {"omega", "pressure_term"}
    continuum = {"density_rate", "predicted_density", "div_v", "velocity_gradient"}
    for settings in SCENES:
        for part in scene_of(settings).all_parts:
            always = {field.name for field in type(part).fields}
            always |= {"gas": gas, "continuum": continuum}.get(part.name, set())
            assert {field.name for field in part.fields} <= always | {*part.reserves}


def test_reserved_names_are_those_of_checkpoints_and_histories():
    checkpoint = {*stored.SCALARS, *stored.ENERGIES, *stored.LISTS}
    assert checkpoint <= declared.NOT_FIELDS
    assert {*columns.shared(3), *columns.OF_SOME} == declared.NOT_COLUMNS
    assert (stored.NAME, 1 + max(r for r, _ in stored.ENTRIES)) == (
        declared.NAME, len(declared.RANKS)
    )  # fmt: skip


def returned(extension, body):
    """Check what the methods of a part with this body return."""
    extension(PART_FILE, with_body(body))
    scene = Scene(read())
    state = State.at_start(scene.fields, *scene.initial_state().particles)
    declarations.check_returned(scene.all_parts, state)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("def energies(self, s): return {'e': s.mass}", r"return \(e\), expected .*: \(\)"),
        ("columns = one('e')", r"return \(\), expected .*: \(e\)"),
        (
            "columns = one('e')\ndef energies(self, s): return {'e': 0.0}",
            r"e has the shape \(\)",
        ),
        (
            "columns = one('e')\ndef sums(self, s): return {'e': s.mass}",
            "e is .*, expected a number",
        ),
        (
            "columns = one('e')\ndef sums(self, s): return {'e': None}",
            "e is None, expected a number",
        ),
        ("def step_limit(self, s): return 0.1", r"step_limit has the shape \(\)"),
    ],
)
def test_what_methods_return(extension, body, message):
    with pytest.raises(DeclarationError, match=message):
        returned(extension, body)


def started(extension, body):
    extension(PART_FILE, with_body(body))
    return Simulation.start(Scene(read()), 1, Clock())


def test_a_limit_on_the_step_that_is_nan_is_a_numerical_failure(extension):
    with pytest.raises(NumericalError, match=r"fell to nan, which is not finite.*physics\.mine"):
        started(extension, "def step_limit(self, s): return s.mass * float('nan')")


def test_a_sum_that_is_nan_is_a_numerical_failure(extension):
    """A history with it could not be read by a restart."""
    simulation = started(
        extension, "columns = one('e')\ndef sums(self, s): return {'e': float('nan')}"
    )
    with pytest.raises(NumericalError, match="e is nan"):
        simulation.columns()


def test_stored_fields_are_checked_before_a_checkpoint_is_written(extension):
    """What such a checkpoint holds no restart could read."""
    with pytest.raises(NumericalError, match=r"a of particle .* is 0\.0"):
        started(extension, 'fields = (Field("a", above=0.0),)')
    simulation = started(extension, 'fields = (Field("a"),)')
    simulation.check_fields()
    simulation.particles.a[3] = np.nan
    with pytest.raises(NumericalError, match=r"a of particle .* is nan; 1 particle affected"):
        simulation.check_fields()
    simulation.particles.a = simulation.particles.mass.astype(np.float32)
    with pytest.raises(DeclarationError, match="'a' became float32"):
        simulation.check_fields()
    simulation.particles.a = simulation.particles.position
    with pytest.raises(DeclarationError, match=r"'a' became float64 \(1, \d+\), expected"):
        simulation.check_fields()


def test_the_command_line_exits_with_2_and_lists_files_without_a_docstring(extension, tmp_path):
    extension("kernels/plain.py", KERNEL.replace('"""A kernel."""\nfrom', "from"))
    listed = CliRunner().invoke(main, ["list"])
    assert listed.exit_code == 0
    assert "plain                    (no docstring)" in listed.output
    extension(PART_FILE, with_body("columns = one('t')"))
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format("mine = 1.0"))
    failed = CliRunner().invoke(main, ["run", str(scene), "-o", str(tmp_path / "run")])
    assert failed.exit_code == 2
    assert not (tmp_path / "run").exists()
    extension(PART_FILE, "def (:")
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(""))
    for command in (["list"], ["new", "shock_tube"], ["run", str(scene), "--dry-run"]):
        failed = CliRunner().invoke(main, command)
        assert failed.exit_code == 2, command
        assert "__init__.py, line 1: cannot be imported" in failed.output + failed.stderr


def test_a_checkpoint_whose_extension_is_missing_names_the_key_and_the_folder(
    extension, tmp_path, monkeypatch
):
    simulation = started(extension, 'fields = (Field("a"),)')
    monkeypatch.setattr(
        checkpoint.fingerprint, "as_json", lambda: '{"sources of sph_extensions": ""}'
    )
    checkpoint.write(tmp_path / "checkpoint_000000.h5", runner.state_of(simulation))
    (tmp_path / "sph_extensions").rename(tmp_path / "elsewhere")
    forget()
    for command in ("restart", "plot"):
        failed = CliRunner().invoke(main, [command, str(tmp_path / "checkpoint_000000.h5")])
        assert failed.exit_code == 4
        told = failed.output + failed.stderr
        assert "physics.mine is not a key of [physics]" in told
        assert "with its sph_extensions on the Python path" in told


def test_a_problem_without_its_class(extension):
    extension("problems/bad.py", '"""A problem."""')
    with pytest.raises(DeclarationError, match=r"bad\.py: expected a class Problem"):
        config.from_text('[problem]\nname = "bad"\n', "the test")


def test_a_formulation_without_models(extension):
    text = PART.replace("(Part)", "(Formulation)").replace("scene.physics.mine", "cls")
    text = text.replace("class Mine", "from sph.formulations import Formulation\nclass Mine")
    extension("formulations/mine/__init__.py", text)
    with pytest.raises(DeclarationError, match=r"Mine: models missing"):
        described('formulation = "mine"')


def test_a_declaration_error_is_an_error_of_configuration():
    assert issubclass(DeclarationError, ConfigError)
    assert DeclarationError.exit_code == 2
