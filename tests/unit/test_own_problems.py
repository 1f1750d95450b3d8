"""Problems from outside the package: in a file of the user's, and in an installed distribution."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from sph import config as configuration
from sph import fingerprint
from sph.analysis import trial
from sph.analysis.info import settings
from sph.cli import main
from sph.clock import Clock
from sph.config import copies, outside
from sph.errors import ConfigError, DeclarationError, FileError
from sph.output import checkpoint as checkpoints
from sph.scene import Scene
from sph.simulation import Simulation

ROOT = Path(__file__).parents[2]
CLOUDS = (ROOT / "docs" / "notebooks" / "two_clouds.py").read_text()
CONFIG = """\
[problem]
file = "clouds.py"
n = 256
[time]
end = 0.02
[output]
interval = 0.01
[run]
threads = 1
"""


def sph_(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


@pytest.fixture
def home(tmp_path):
    """A directory with a configuration and a problem file."""
    (tmp_path / "clouds.toml").write_text(CONFIG)
    (tmp_path / "clouds.py").write_text(CLOUDS)
    return tmp_path


def run(home, *options, into="run"):
    done = sph_("run", home / "clouds.toml", "-o", home / into, *options)
    assert done.exit_code == 0, done.output
    return home / into


def edited(home, old, new):
    text = (home / "clouds.py").read_text()
    assert old in text
    (home / "clouds.py").write_text(text.replace(old, new))


def digest_of(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_problem_file_gives_name_keys_defaults_and_diagnostics(home):
    found = configuration.load(home / "clouds.toml", ["problem.radius=0.2"])
    assert found.problem.name == "clouds"
    assert found.problem.file == str(home / "clouds.py")
    assert found.problem.file_sha256 == digest_of(home / "clouds.py")
    assert (found.problem.n, found.problem.radius, found.problem.contrast) == (256, 0.2, 4.0)
    assert found.physics.gamma == 5.0 / 3.0
    changed = [one["key"] for one in settings.different(found)]
    assert changed == ["problem.n", "problem.radius", "time.end", "output.interval", "run.threads"]
    summary = json.loads((run(home) / "summary.json").read_text())
    assert summary["problem"] == "clouds"
    header, first = (home / "run" / "history.csv").read_text().splitlines()[:2]
    columns = dict(zip(header.split(","), first.split(","), strict=True))
    assert float(columns["kinetic_energy_x"]) == float(columns["kinetic_energy"]) > 0.0


def test_path_in_file_begins_at_its_directory_and_that_of_set_at_current_one(home, monkeypatch):
    (home / "elsewhere").mkdir()
    other = CLOUDS.replace("Field(default=0.1, gt=0", "Field(default=0.2, gt=0")
    (home / "elsewhere" / "clouds.py").write_text(other)
    monkeypatch.chdir(home / "elsewhere")
    assert configuration.load(home / "clouds.toml").problem.radius == 0.1
    there = configuration.load(home / "clouds.toml", ["problem.file=clouds.py"])
    assert there.problem.radius == 0.2


def test_template_reads_back_and_leaves_hash_open(home):
    done = sph_("new", home / "clouds.py", "-o", home / "new.toml")
    assert done.exit_code == 0, done.output
    text = (home / "new.toml").read_text()
    assert "# radius of each cloud\n#   a number greater than 0 and less than 0.25" in text
    assert "\n# file_sha256 =\n" in text
    (home / "clouds.py").write_text(CLOUDS + "\n")  # an edit is no error
    assert configuration.load(home / "new.toml").problem.n == 4096


def test_hash_that_is_given_is_checked(home, messages):
    run(home)
    (home / "clouds.py").write_text(CLOUDS + "\n# edited\n")
    with messages.raised(ConfigError, digest_of(home / "clouds.py"), mask="[0-9a-f]{64}"):
        configuration.load(home / "run" / "config.toml")


@pytest.mark.parametrize(
    "text", ['file = "clouds.py" # mine', "file = 'clouds.py'", "n = 256\nfile='clouds.py'"]
)
def test_copy_of_configuration_finds_problem_file(home, tmp_path_factory, text):
    (home / "clouds.toml").write_text(f"[problem]\n{text}\n")
    copy = tmp_path_factory.mktemp("copy") / "base.toml"
    copy.write_text(copies.read_to_copy(home / "clouds.toml"))
    assert configuration.load(copy).problem.file == str(home / "clouds.py")
    assert ("# mine" in copy.read_text()) == ("# mine" in text)


def test_copy_of_configuration_has_absolute_paths_that_problem_declares(home, tmp_path_factory):
    text = (
        CLOUDS
        + """
    paths: ClassVar = ("table",)
    table: str = Field(default="", description="a file")
    radii: str = Field(default="", description="no file")
"""
    )
    (home / "clouds.py").write_text(text)
    keys = 'file = "clouds.py"\ntable = "a.csv"\nradii = "a.csv"\n'
    (home / "clouds.toml").write_text(f"[problem]\n{keys}")
    copy = tmp_path_factory.mktemp("copy") / "base.toml"
    copy.write_text(copies.read_to_copy(home / "clouds.toml"))
    found = configuration.load(copy).problem
    assert found.file == str(home / "clouds.py")
    assert (found.table, found.radii) == (str(home / "a.csv"), "a.csv")
    assert found.table == configuration.load(home / "clouds.toml").problem.table


@pytest.mark.slow
def test_sweep_finds_problem_file(home):
    done = sph_(
        "sweep", home / "clouds.toml", "--vary", "problem.speed=0.1,0.2", "-o", home / "sweep",
        "--set", "time.end=0.001",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert len(list((home / "sweep").glob("*/summary.json"))) == 2


# --- what is compiled, and what a restart says ------------------------------------------------


def test_edit_of_problem_file_recompiles_nothing(home):
    run(home)
    before = fingerprint.key()
    edited(home, "self.speed * (", "2.0 * self.speed * (")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    code = "from sph import fingerprint; import sys; print(fingerprint.key(), file=sys.stderr)"
    command = f"{code}\nfrom sph.cli import main\nmain()"
    done = subprocess.run(
        [sys.executable, "-c", command, "run", "clouds.toml", "-o", "again"],
        cwd=home, env=environment, capture_output=True, text=True, timeout=200,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[0] == before
    cost = json.loads((home / "again" / "summary.json").read_text())["cost"]
    assert cost["session"]["compile_cpu_seconds"] == 0.0
    energies = [
        (home / name / "history.csv").read_text().splitlines()[1].split(",")[5]
        for name in ("run", "again")
    ]
    assert float(energies[1]) == pytest.approx(4.0 * float(energies[0]), rel=1e-12)  # round-off


def test_restart_with_unchanged_file_says_nothing_and_continues_bit_for_bit(home):
    run(home)
    middle = home / "run" / "checkpoints" / "checkpoint_000001.h5"
    done = sph_("restart", middle, "-o", home / "again")
    assert done.exit_code == 0, done.output
    assert "changed" not in done.stderr
    ends = [home / one / "checkpoints" / "checkpoint_000002.h5" for one in ("run", "again")]
    states = [checkpoints.read(one).particles.arrays() for one in ends]
    assert checkpoints.state_hash(states[0]) == checkpoints.state_hash(states[1])
    assert (home / "again" / "problem.py").read_text() == CLOUDS


def test_restart_with_changed_file_says_so_and_records_it(home):
    run(home, "--set", "time.end=0.01")
    old = digest_of(home / "clouds.py")
    edited(home, 'default=1.0, description="speed', 'default=0.7, description="speed')
    new = digest_of(home / "clouds.py")
    at_end = sph_("restart", home / "run")  # an edited file is no setting that a step would use
    assert (at_end.exit_code, "has reached its end" in at_end.stderr) == (0, True)
    done = sph_("restart", home / "run", "--set", "time.end=0.02")
    assert done.exit_code == 0, done.output
    assert f"{home / 'clouds.py'} has changed since the checkpoint was written" in done.stderr
    change = f'problem.file_sha256 = "{new}" (was "{old}")'
    assert change in done.stderr
    last = checkpoints.read(home / "run" / "checkpoints" / "checkpoint_000002.h5")
    assert last.config.problem.file_sha256 == new
    assert last.config.problem.speed == 1.0  # a key of the run, whatever the default is now
    assert any(change in line for line in last.lineage)
    first = checkpoints.read(home / "run" / "checkpoints" / "checkpoint_000000.h5")
    assert first.config.problem.file_sha256 == old
    assert (home / "run" / "problem.py").read_text() == CLOUDS
    # the checkpoint before is of the old file, and nevertheless of the same run
    middle = home / "run" / "checkpoints" / "checkpoint_000001.h5"
    again = sph_("restart", middle, "--set", "time.end=0.03")
    assert again.exit_code == 0, again.output


def test_other_problem_key_cannot_change_in_restart(home):
    run(home)
    done = sph_("restart", home / "run", "--set", "problem.speed=0.1", "--set", "time.end=0.03")
    assert (done.exit_code, "problem.speed cannot be changed" in done.stderr) == (2, True)


@pytest.mark.parametrize("command", [["restart"], ["plot"]])
def test_run_whose_file_is_gone_is_refused(home, messages, command):
    run(home)
    (home / "clouds.py").unlink()
    done = sph_(*command, home / "run")
    assert done.exit_code == FileError.exit_code
    messages.check(done.stderr)


def test_run_whose_file_lost_a_key_is_refused(home, messages):
    run(home)
    edited(home, "    speed: float = Field", "    velocity: float = Field")
    done = sph_("restart", home / "run")
    assert done.exit_code == FileError.exit_code
    messages.check(done.stderr)


# --- mistakes of the user ---------------------------------------------------------------------

HEAD = "from sph.problems import base\n\n"
EMPTY = HEAD + "class Problem(base.Problem):\n"
WRONG_FILES = {
    "no class": ("x = 1\n", "clouds.py: expected a class Problem"),
    "no class of ours": ("class Problem:\n    pass\n", "Problem is not a subclass of"),
    "no initial": (EMPTY + "    n: int = 10\n", "expected a class Problem with a method initial"),
    "syntax": ("x = (\n\n", "clouds.py, line 1: SyntaxError: "),
    "indentation": (EMPTY + "n = 1\n", "clouds.py, line 4: SyntaxError: "),
    "missing module": ("\nimport no_such_module\n", "clouds.py, line 2: ModuleNotFoundError: "),
    "error in class": (EMPTY + "    n: int = 1 // 0\n", "clouds.py, line 4: ZeroDivisionError: "),
    "default in no table": (
        CLOUDS.replace('"time.end"', '"tim.end"'), "defaults has 'tim.end', which is not a key"
    ),
    "default of no key": (
        CLOUDS.replace('"time.end"', '"time.ende"'), "defaults has 'time.ende', which is not a key"
    ),
    "default of no key of physics": (
        CLOUDS.replace("physics.alpha", "physics.alhpa"),
        "defaults has 'physics.alhpa', which is not a key",
    ),
    "error in validator": (
        CLOUDS + "\n    @__import__('pydantic').model_validator(mode='after')\n"
        "    def _check(self):\n        raise KeyError('radius')\n",
        ": KeyError: 'radius'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG_FILES)
def test_wrong_problem_file_is_refused_without_traceback(home, name, messages):
    text, words = WRONG_FILES[name]
    (home / "clouds.py").write_text(text)
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert done.exit_code == 2, done.output
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (home / "run").exists()
    messages.check(done.stderr, mask=r"(?<=Error: ).*")  # Python's words depend on its version


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ('"none.py"', 'clouds.toml, line 2: problem.file = "none.py": '),
        ('"clouds.toml"', "expected a Python file, NAME.py"),
        ('"."', "expected a Python file, NAME.py"),
        ("3", "problem.file = 3: expected a string"),
        ('""', 'problem.file = "": expected a string'),
        ('"clouds.py"\nname = "noh"', 'problem.name = "noh": expected "clouds"'),
        ('"clouds.py"\nradios = 1.0', "problem.radios is not a key of [problem]; did you mean"),
        ('"clouds.py"\nradius = -1.0', "problem.radius = -1.0: expected a number greater than 0"),
    ],
)
def test_wrong_key_is_refused(home, value, words):
    (home / "clouds.toml").write_text(CONFIG.replace('"clouds.py"', value))
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert done.exit_code == 2, done.output
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_missing_problem_mentions_file(home):
    (home / "clouds.toml").write_text("[problem]\nn = 10\n")
    with pytest.raises(ConfigError, match=r"or problem\.file"):
        configuration.load(home / "clouds.toml")


BODIES = {
    "raise": ("raise RuntimeError('no gas')", "RuntimeError: no gas"),
    "divide": ("return 1 / 0", "ZeroDivisionError: division by zero"),
    "inside numpy": ("return np.zeros(3) + np.zeros(4)", "ValueError: operands could not be"),
    "value error": ("raise ValueError('too few')", "ValueError: too few"),
}


@pytest.mark.parametrize("name", BODIES)
def test_exception_in_initial_names_file_and_line(home, name):
    body, words = BODIES[name]
    edited(home, "        low, high = self.domain\n        side", f"        {body}\n        side")
    line = next(k for k, text in enumerate((home / "clouds.py").read_text().splitlines(), 1)
                if body in text)  # fmt: skip
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert done.exit_code == 2, done.output
    assert f"sph: {home / 'clouds.py'}, line {line}, in initial: {words}" in done.stderr
    assert "Traceback" not in done.stderr


WRONG_STATES = {
    "None": ("None", "initial returned a NoneType; expected sph.problems.base.InitialState"),
    "transposed": (
        "base.InitialState(position.T, velocity, mass, mass)",
        "position of the shape (256, 2); expected (D, N) = (2, 256). Try: the transpose",
    ),
    "one mass": ("base.InitialState(position, velocity, 1.0, mass)", "mass of the shape ()"),
    "short": ("base.InitialState(position, velocity, mass, mass[1:])", "expected (N,) = (256,)"),
    "text": ("base.InitialState(position, velocity, mass, mass.astype(str))", "of the type <U"),
    "NaN": ("base.InitialState(position, velocity, mass, mass * np.nan)", "that are not finite"),
}


@pytest.mark.parametrize("name", WRONG_STATES)
def test_wrong_initial_state_is_refused(home, name):
    value, words = WRONG_STATES[name]
    edited(
        home, "return base.InitialState(position, velocity, mass, eos", f"return {value}\n        ("
    )
    edited(home, "(.internal_energy(density, 1.0))", "")
    scene = Scene(configuration.load(home / "clouds.toml"))
    with pytest.raises(DeclarationError, match=re.escape(words)):
        scene.initial_state()


# --- methods that a run calls only at its end, tried before the first step ---------------------

ARGUMENTS = {
    "diagnostics": "particles",
    "exact": "eos, time, position",
    "exact_ends": "eos",
    "undisturbed": "eos, time",
    "error_region": "eos, time, position",
    "departs": "physics",
    "remarks": "",
    "theory": "eos, times",
    "over_time": "eos, history",
}
FOUR = (
    '"density": position[0], "velocity": position, "pressure": {}, "internal_energy": position[0]'
)
LATE = [
    ("diagnostics", "[1.0]", "expected a dictionary of numbers by name"),
    ("diagnostics", '{"a": particles.mass}', "diagnostics returned a = a ndarray; expected a"),
    ("diagnostics", "particles.masses", "in diagnostics: AttributeError: "),
    ("exact", '{"density": 1.0}', "expected a dictionary of density, velocity, pressure, "),
    ("exact", '{"density": 1.0}', "a dictionary without velocity, pressure, internal_energy;"),
    ("exact", "1.0", "exact returned 1.0; expected a dictionary"),
    ("exact", f"{{{FOUR.format(1.0)}}}", "pressure of the shape (); expected (N,) = (3,)"),
    ("exact", f"{{{FOUR.format('np.ones(self.n)')}}}", "pressure of the shape (256,); expected"),
    ("exact", "{}[time]", "in exact: KeyError: 0.0 (t = 0, 3 points)\n    return {}[time]"),
    (
        "exact",
        "None if time == 0 else 1 / 0",
        "in exact: ZeroDivisionError: division by zero (t = 0.02, ",
    ),
    ("exact_ends", "0.5", "exact_ends returned 0.5; expected a time and a text"),
    ("undisturbed", "[0.0, 1.0]", "undisturbed returned an array of the shape (2,); expected (D, "),
    ("error_region", "position[0] > 0", "expected a mask of the shape (N,) = (3,) and a text"),
    ("error_region", "(position > 0, '')", "expected a mask of the shape (N,) = (3,) and a text"),
    ("remarks", "'two clouds'", "remarks returned 'two clouds'; expected a list of texts"),
    ("departs", "True", "departs returned True; expected a text"),
    ("theory", "{'t': 1.0}", "theory returned t of the shape (); expected numbers of the shape"),
    ("report", "1.0", "report returned 1.0; expected a dictionary"),
    ("report", "particles[2].positions", "in report: AttributeError: "),
    ("compare", "particles[2].position[2, 0]", "in compare: IndexError: index 2 is out of bounds"),
    ("compare", "self.compared", "in compare: AttributeError: "),
    ("over_time", "history['kinetic']", "in over_time: KeyError: 'kinetic'"),
    ("diagnostics", "particles.velocity.fill(0) or {}", "ValueError: assignment destination is re"),
    ("report", "particles[2].density.fill(1) or {}", "ValueError: assignment destination is read-"),
    ("diagnostics", "{'a,b': 1.0}", "the name 'a,b'; expected a name without commas"),
    ("diagnostics", "setattr(self, 'n', 3)", "self.n is set: keys of a problem do not change. Tr"),
]


def with_method(home, method, value):
    """Let the problem's `method` return `value`, and return the line where it does."""
    text = CLOUDS.replace("def diagnostics", "def _no_diagnostics")
    text += f"\n    def {method}(self, {ARGUMENTS.get(method, '*particles')}):\n"
    text += f"        return {value}\n"
    (home / "clouds.py").write_text(text)
    return text.count("\n")


@pytest.mark.parametrize(("method", "value", "words"), LATE)
def test_fault_of_late_method_is_found_before_first_step(home, method, value, words, monkeypatch):
    last = with_method(home, method, value)
    monkeypatch.setattr(Simulation, "proceed", lambda *_: pytest.fail("a step was taken"))
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert done.exit_code == 2, done.output
    assert words in done.stderr
    line = last if f", in {method}: " in done.stderr else last - 1
    assert f"{home / 'clouds.py'}, line {line}" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("method", "value"),
    [
        ("report", "{'last': np.flatnonzero(particles[2].density > 100)[-1]}"),
        ("compare", "{'last': particles[2].density[particles[2].density > 100].max()}"),
        ("over_time", "{'rate': 1.0 / int(np.ptp(history['kinetic_energy']))}"),
    ],
)
def test_method_that_fails_only_with_initial_values_is_noted(home, method, value):
    """A maximum over the particles that a shock has passed, a fit: not before the first step."""
    with_method(home, method, value)
    simulation = Simulation.start(Scene(configuration.load(home / "clouds.toml")), 1, Clock())
    (note,) = trial.notes(simulation)
    assert f"in a trial call with the initial state, {home / 'clouds.py'}, line " in note
    assert f"in {method}: " in note


def test_class_of_another_name_is_named(home):
    edited(home, "class Problem(", "class Clouds(")
    with pytest.raises(ConfigError, match="expected a class Problem, but it has Clouds"):
        configuration.load(home / "clouds.toml")


def test_negative_initial_energy_is_refused_with_remedy(home):
    edited(home, "eos.internal_energy(density, 1.0)", "eos.internal_energy(density, -1.0)")
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert (done.exit_code, "are not negative" in done.stderr) == (3, True), done.output


def test_wrong_arguments_are_refused_with_expected_ones(home):
    (home / "clouds.py").write_text(f"{CLOUDS}\n    def exact(self, position):\n        pass\n")
    with pytest.raises(ConfigError, match=r"exact has the arguments \(self, position\); expected "):
        configuration.load(home / "clouds.toml")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("profiles: ClassVar = ('density', 'Mach')", "expected four of density, internal_energy, "),
        ("limits: ClassVar = {'energy_drift': 1e-3}", "limits has 'energy_drift': 0.001; expected"),
        ("quantities: ClassVar = {'a': 'length'}", "quantities has 'a': 'length'; expected"),
    ],
)
def test_wrong_class_attribute_is_refused(home, line, words):
    (home / "clouds.py").write_text(f"{CLOUDS}\n    {line}\n")
    with pytest.raises(ConfigError, match=re.escape(words)):
        configuration.load(home / "clouds.toml")


@pytest.mark.parametrize(
    ("method", "close"),
    [
        ("def exakt(self): ...", "exact"),
        ("def diagnostic(self): ...", "diagnostics"),
        ("@property\n    def Clamps(self): ...", "clamps"),
        ("@staticmethod\n    def inital(): ...", "initial"),
    ],
)
def test_misspelt_method_is_refused_with_its_line(home, method, close):
    (home / "clouds.py").write_text(f"{CLOUDS}\n    {method}\n")
    line = len(CLOUDS.splitlines()) + 2
    with pytest.raises(
        ConfigError, match=f"line {line}: .* no problem has: did you mean {close}[?]"
    ):
        configuration.load(home / "clouds.toml")


def test_methods_of_other_names_are_helpers(home):
    helpers = ("def mass_at(self): ...", "def _exakt(self): ...", "def exact_density(self): ...")
    (home / "clouds.py").write_text(CLOUDS + "".join(f"\n    {one}\n" for one in helpers))
    assert configuration.load(home / "clouds.toml").problem.name == "clouds"


def test_problem_of_package_sph_is_not_tried(monkeypatch):
    found = configuration.load(ROOT / "configs" / "sod.toml", ["problem.n=100"])
    simulation = SimpleNamespace(scene=Scene(found), particles=None)
    monkeypatch.setattr(type(found.problem), "exact", lambda *_: pytest.fail("exact was called"))
    assert list(trial.notes(simulation)) == []


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{'t': 1.0}", "diagnostics returned t, which the history has already"),
        ("{f'a{len(self.model_dump.cache)}': 1.0}", "in some steps only; expected the names of"),
    ],
)
def test_wrong_names_of_diagnostics_are_refused(home, value, words):
    with_method(home, "diagnostics", value.replace("len(self.model_dump.cache)", "count()"))
    text = (home / "clouds.py").read_text()
    calls = "import itertools\n_calls = itertools.count()\n"
    # another name from the first step on: the trial and the header of the history call before
    counted = f"{calls}\n\ndef count():\n    return max(0, next(_calls) - 2)\n\n\nclass Problem"
    (home / "clouds.py").write_text(text.replace("class Problem", counted))
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert (done.exit_code, words in done.stderr) == (2, True), done.output


# --- runs that fail before their first checkpoint, or at their end -----------------------------


def test_run_that_fails_before_first_step_leaves_no_directory(home):
    with_method(home, "report", "1.0")
    for into in ("run", "new/below/run"):
        assert sph_("run", home / "clouds.toml", "-o", home / into).exit_code == 2
    edited(home, "        low, high = self.domain\n        side", "        1 / 0\n        side")
    assert sph_("run", home / "clouds.toml", "-o", home / "run").exit_code == 2
    assert sorted(one.name for one in home.iterdir()) == ["clouds.py", "clouds.toml"]


def test_forced_run_without_initial_state_keeps_earlier_run(home):
    before = sorted(run(home).rglob("*"))
    edited(home, "        low, high = self.domain\n        side", "        1 / 0\n        side")
    assert sph_("run", home / "clouds.toml", "-o", home / "run", "--force").exit_code == 2
    assert sorted((home / "run").rglob("*")) == before


def test_directory_of_user_stays_when_run_fails(home):
    with_method(home, "report", "1.0")
    (home / "run").mkdir()
    assert sph_("run", home / "clouds.toml", "-o", home / "run").exit_code == 2
    assert list((home / "run").iterdir()) == []


def test_fault_at_end_says_how_to_complete_run(home):
    with_method(home, "report", "{'a': 1 / int(eos is None or args[0] < 0.02)}")
    edited(home, "self, *particles)", "self, eos, *args)")
    (home / "clouds.toml").write_text(CONFIG.replace("end = 0.02", "end = 0.01"))
    done = sph_("run", home / "clouds.toml", "-o", home / "run", "--set", "time.end=0.02")
    assert (done.exit_code, "in a trial call" in done.stderr) == (2, True), done.output
    assert f"`sph restart {home / 'run'}` writes the summary" in done.stderr
    edited(home, "1 / int(eos is None or args[0] < 0.02)", "1.0")
    done = sph_("restart", home / "run")
    assert done.exit_code == 0, done.output
    assert json.loads((home / "run" / "summary.json").read_text())["report"] == {"a": 1.0}


def test_restart_tries_changed_file_before_anything_changes(home):
    run(home)
    edited(
        home, "    def diagnostics", "    def exact(*_):\n        return 1.0\n\n    def diagnostics"
    )
    middle = home / "run" / "checkpoints" / "checkpoint_000001.h5"
    before = sorted((home / "run").rglob("*"))
    for options in ([], ["-o", home / "again"]):
        done = sph_("restart", middle, *options)
        assert (done.exit_code, "exact returned 1.0" in done.stderr) == (2, True), done.output
    assert sorted((home / "run").rglob("*")) == before
    assert not (home / "again").exists()


@pytest.mark.parametrize(
    ("old", "new"),
    [('"kinetic_energy_x"', '"energy_x"'), ("def diagnostics", "def _none")],
    ids=["renamed", "removed"],
)
def test_restart_with_other_diagnostics_says_that_file_has_changed(home, messages, old, new):
    run(home)
    edited(home, old, new)
    middle = home / "run" / "checkpoints" / "checkpoint_000001.h5"
    for options in ([], ["-o", home / "again"]):
        done = sph_("restart", middle, *options)
        assert done.exit_code == FileError.exit_code
        assert not (home / "again").exists()
    messages.check(done.stderr)
    shutil.copy(middle, home / "copy.h5")  # the way out that the message names
    done = sph_("restart", home / "copy.h5", "-o", home / "again")
    assert done.exit_code == 0, done.output


def test_restart_with_added_diagnostics_says_that_file_has_changed(home, messages):
    (home / "clouds.py").write_text(CLOUDS.replace("def diagnostics", "def _none"))
    run(home)
    (home / "clouds.py").write_text(CLOUDS)
    done = sph_("restart", home / "run" / "checkpoints" / "checkpoint_000001.h5")
    assert done.exit_code == FileError.exit_code
    messages.check(done.stderr)


# --- in Python -------------------------------------------------------------------------------

SCRIPT = """\
import sph
sph.run("clouds.toml", output="run")
"""


@pytest.mark.parametrize("body", ["1 / 0", "np.zeros(3) + np.zeros(4)", "return 1.0"])
def test_traceback_in_python_is_short_and_shows_users_code_only(home, body):
    edited(home, "        low, high = self.domain\n        side", f"        {body}\n        side")
    (home / "script.py").write_text(SCRIPT)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "script.py"], cwd=home, env=environment,
                          capture_output=True, text=True, timeout=200)  # fmt: skip
    frames = re.findall(r'  File "(.*)", line', done.stderr)
    ours = [one for one in frames if one.startswith(str(ROOT))]
    assert [Path(one).name for one in ours] == ["concise.py"], done.stderr
    theirs = [Path(one).name for one in frames if one not in ours]
    assert theirs == (["script.py"] if "return" in body else ["clouds.py", "script.py"])
    last = done.stderr.strip().splitlines()
    assert f"sph.errors.DeclarationError: {home / 'clouds.py'}, line " in done.stderr
    assert last[-1] == f"    {body}" or "expected sph.problems.base.InitialState" in last[-1]


# --- problems of other packages ---------------------------------------------------------------


@pytest.fixture
def distribution(home, monkeypatch):
    """A made-up distribution `sky` on the path, with a problem `clouds_of_sky`."""

    def install(version="1.0", entries="clouds_of_sky = sky_problems.clouds", name="sky"):
        place = home / "site" / f"{name}-{version}.dist-info"
        place.mkdir(parents=True)
        (place / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        )
        (place / "entry_points.txt").write_text(f"[sph.problems]\n{entries}\n")
        (home / "site" / "sky_problems").mkdir(exist_ok=True)
        (home / "site" / "sky_problems" / "clouds.py").write_text(CLOUDS)
        for cached in (outside._entries, outside.of_package):
            cached.cache_clear()
        return place

    monkeypatch.syspath_prepend(home / "site")
    yield install
    for cached in (outside._entries, outside.of_package):
        cached.cache_clear()
    for one in [one for one in sys.modules if one.startswith("sky_problems")]:
        del sys.modules[one]


OF_SKY = CONFIG.replace('file = "clouds.py"', 'name = "clouds_of_sky"')


def test_problem_of_package_runs_is_listed_and_records_version(home, distribution):
    place = distribution()
    (home / "clouds.toml").write_text(OF_SKY)
    listed = sph_("list").stdout
    assert re.search(r"  clouds_of_sky +Two clouds in pressure .* \(sky 1\.0\)\n", listed)
    assert 'name = "clouds_of_sky"' in sph_("new", "clouds_of_sky").stdout
    directory = run(home, "--set", "time.end=0.01")
    first = checkpoints.read(directory / "checkpoints" / "checkpoint_000000.h5")
    assert (first.config.problem.name, first.config.problem.package) == ("clouds_of_sky", "sky 1.0")
    place.rename(place.with_name("sky-1.1.dist-info"))
    metadata = home / "site" / "sky-1.1.dist-info" / "METADATA"
    metadata.write_text(metadata.read_text().replace("Version: 1.0", "Version: 1.1"))
    for cached in (outside._entries, outside.of_package):
        cached.cache_clear()
    done = sph_("restart", directory, "--set", "time.end=0.02")
    assert done.exit_code == 0, done.output
    assert 'problem.package = "sky 1.1" (was "sky 1.0")' in done.stderr
    with pytest.raises(ConfigError, match=r'problem.package = "sky 1.0": sky 1.1 is installed'):
        configuration.load(home / "clouds.toml", ["problem.package=sky 1.0"])


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ("clouds_of_sky = sky_problems.nothing", "No module named 'sky_problems.nothing'"),
        ("clouds_of_sky = sky_problems.clouds:Nothing", "AttributeError: "),
        ("clouds_of_sky = sky_problems.clouds:np", "expected a class Problem"),
        ("clouds_of_sky = sky_problems.clouds:base.Fault", "Problem is not a subclass of"),
        ("noh = sky_problems.clouds", "there is another problem of this name"),
    ],
)
def test_wrong_entry_point_is_refused_without_traceback(home, distribution, entries, words):
    distribution(entries=entries)
    (home / "clouds.toml").write_text(OF_SKY)
    done = sph_("run", home / "clouds.toml", "-o", home / "run")
    assert done.exit_code == 2, done.output
    assert words in done.stderr
    assert "entry point" in done.stderr or "sky" in done.stderr


def test_entry_points_are_read_only_for_names_that_sph_lacks(monkeypatch):
    outside._entries.cache_clear()
    monkeypatch.setattr(
        outside.importlib.metadata, "entry_points", lambda **_: pytest.fail("entry points read")
    )
    assert outside.problem_class("noh") is not None
