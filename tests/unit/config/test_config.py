"""The configuration: what it resolves to, that it reads back, and every error a user can make."""

import re

import pytest

from sph import config, registry
from sph.config import reading
from sph.config.errors import is_list_of_tables
from sph.errors import ConfigError, FileError
from sph.model import parameters
from sph.parts.viscosity import Viscosity, constant
from sph.parts.viscosity.switches import cullen_dehnen, morris_monaghan
from sph.scene import Scene

KERNELS = ", ".join(f'"{name}"' for name in registry.names("sph.kernels"))
MINIMAL = '[problem]\nname = "shock_tube"\n'


def read(text, overrides, path):
    if path is None:
        return config.from_text(text, "x.toml").override(overrides)
    path.write_text(text)
    return config.load(path, overrides)


def errors(text, overrides=(), path=None):
    """The lines of the error that a text (at `path`, in a file) and overrides lead to."""
    with pytest.raises(ConfigError) as caught:
        read(text, overrides, path)
    return str(caught.value).splitlines()


def only_error(text, overrides=()):
    (message,) = errors(text, overrides)
    return message


def default(*overrides):
    return config.from_text(MINIMAL).override(overrides)


# --- what it resolves to ----------------------------------------------------------------------


def test_defaults_come_from_tables_and_problem():
    found = default()
    assert found.physics.scheme == "grad_h"
    assert found.physics.C == 0.15
    assert found.run.threads == "all"
    shock_tube = registry.load("sph.problems", "shock_tube").Problem
    assert found.time.end == shock_tube.defaults["time.end"]
    assert found.output.interval == shock_tube.defaults["output.interval"]


def test_problem_default_yields_to_user_value(monkeypatch):
    shock_tube = registry.load("sph.problems", "shock_tube").Problem
    monkeypatch.setattr(
        shock_tube, "defaults", {"physics.gamma": 3.0, "time.end": 7.0, "output.interval": 1.0}
    )
    assert default().physics.gamma == 3.0
    found = config.from_text(MINIMAL + "[physics]\ngamma = 2.0\n")
    assert (found.physics.gamma, found.time.end) == (2.0, 7.0)


def test_problem_default_yields_to_alternative_key(monkeypatch):
    shock_tube = registry.load("sph.problems", "shock_tube").Problem
    monkeypatch.setitem(shock_tube.defaults, "physics.gamma", 3.0)
    found = config.from_text(MINIMAL + '[physics]\neos = { name = "ideal_gas", gamma = 2 }\n')
    assert found.physics.gamma is None
    assert found.physics.eos_model().gamma == 2.0


def test_override_of_member_keeps_rest_of_table(tmp_path):
    path = tmp_path / "minimal.toml"
    path.write_text(MINIMAL)
    for found in (default("problem.left.density=5"), config.load(path, ["problem.left.density=5"])):
        assert found.problem.left.density == 5.0
        assert found.problem.left.pressure == default().problem.left.pressure


@pytest.mark.parametrize(
    "table",
    [
        "right = { density = 1.0, velocity = 0.0 }",
        "right.density = 1.0",
        "[problem.right]\ndensity = 1.0",
    ],
)
def test_incomplete_table_in_file_is_refused(messages, tmp_path, table):
    path = tmp_path / "half.toml"
    path.write_text(MINIMAL + table + "\n")
    with messages.raised(ConfigError, "problem.right.pressure"):
        config.load(path)
    with messages.raised(ConfigError, "problem.right.pressure"):  # setting another fills no gap
        config.load(path, ["problem.right.velocity=1"])
    assert config.load(path, ["problem.right.pressure=0.2"]).problem.right.pressure == 0.2


def test_incomplete_table_in_override_is_refused(messages):
    with messages.raised(ConfigError, "problem.right"):
        default("problem.right={density=1.0}")


def test_integer_for_float_becomes_float():
    found = default("physics.alpha=1", "physics.gamma=2", "problem.domain=[-1, 1]")
    values = [found.physics.alpha, found.physics.gamma, *found.problem.domain]
    assert values == [1, 2, -1, 1]
    assert {type(value) for value in values} == {float}


def viscosity_of(*overrides):
    """The model of alpha in the scene with these overrides."""
    (found,) = (p.coefficient for p in Scene(default(*overrides)).parts if type(p) is Viscosity)
    return found


def test_models_from_scalar_settings():
    physics = default("physics.gamma=2").physics
    assert type(physics.kernel_model()) is registry.model_class("sph.kernels", "wendland_c2")
    assert physics.eos_model() == registry.model_class("sph.eos", "ideal_gas")(2.0)
    viscosity = viscosity_of("physics.alpha=2")
    assert type(viscosity) is constant.ConstantAlpha
    assert type(viscosity.alpha) is float


def test_models_from_tables():
    physics = default(
        "physics.kernel={name = 'cubic_spline', flattened = true}",
        "physics.eos={name = 'ideal_gas', gamma = 3}",
    ).physics
    viscosity = viscosity_of("physics.alpha={min = 0, max = 2}")
    assert type(viscosity) is morris_monaghan.MorrisMonaghan
    assert (type(viscosity.min), type(viscosity.max)) == (float, float)
    assert viscosity == (0.0, 2.0)
    other = viscosity_of("physics.alpha={min = 0, max = 2, switch = 'cullen_dehnen'}")
    assert type(other) is cullen_dehnen.CullenDehnen
    assert other == (0.0, 2.0, 0.05)
    assert physics.kernel_model().flattened is True
    assert physics.eos_model() == (3.0,)
    assert type(physics.eos_model().gamma) is float


PAIRS = '[problem]\nname = "uniform"\n[physics]\nkernel = "cubic_spline"\n'


@pytest.mark.parametrize(
    ("kernel", "dimension", "eta", "limit"),
    [("cubic_spline", 2, 1.41, "1.4"), ("cubic_spline", 3, 1.6, "1.2"),
     ("quintic_spline", 2, 2.2, "1.8"), ("quintic_spline", 3, 1.7, "1.6")],
)  # fmt: skip
def test_kernel_at_pairing_eta_is_refused(messages, tmp_path, kernel, dimension, eta, limit):
    path = tmp_path / "a.toml"
    path.write_text(PAIRS)
    keys = (f"physics.kernel={kernel}", f"problem.dimension={dimension}", f"physics.eta={eta}")
    with messages.raised(ConfigError):
        config.load(path, keys)
    assert config.load(path, (*keys, "physics.allow_pairing=true")).physics.eta == eta
    assert config.load(path, (*keys, f"physics.eta={limit}")).physics.eta == float(limit)
    assert config.load(path, (*keys, "problem.dimension=1")).physics.eta == eta
    for other in ("wendland_c2", "{name='cubic_spline', flattened=true}"):
        assert config.load(path, (*keys, f"physics.kernel={other}")).physics.eta == eta


def test_config_error_has_line_and_suggestion(messages, tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(PAIRS)
    suggestion = "physics.allow_pairing = true"
    with messages.raised(ConfigError, f"{path}, line 4: physics.kernel = ", suggestion):
        config.load(path)


def test_existing_run_with_refused_kernel_readable_but_not_changeable(messages):
    found = config.from_text(PAIRS)
    assert found.physics.kernel == {"name": "cubic_spline", "flattened": False}
    with messages.raised(ConfigError):
        found.override(["time.end=2"])
    assert found.override(["time.end=2", "physics.allow_pairing=true"]).time.end == 2.0


@pytest.mark.parametrize("value", ["1", "7", "converged"])
def test_density_passes_accepts_count_or_converged(value):
    assert str(default(f"physics.density_passes={value}").physics.density_passes) == value


# --- text and back ----------------------------------------------------------------------------

CHANGES = [
    (),
    ("physics.alpha={min = 0.1, max = 2}", "physics.density_passes=converged"),
    ("physics.alpha={min = 0.1, max = 2, switch = 'cullen_dehnen'}",),
    ("physics.kernel=cubic_spline", "run.threads=2", "time.end=1e-7"),
    ("physics.eos={name = 'ideal_gas', gamma = 1.1}", "problem.domain=[[-1, 1]]"),
]


@pytest.mark.parametrize("overrides", CHANGES)
def test_resolved_text_reads_back_equal(overrides):
    found = default(*overrides)
    again = config.from_text(found.to_toml())
    assert again == found
    assert again.to_toml() == found.to_toml()
    assert overrides == () or found != default()


def test_resolved_text_has_every_key_in_order():
    text = default().to_toml()
    keys = [line.split(" = ")[0] for line in text.splitlines() if " = " in line]
    sections = [default().problem, default().physics, default().time, default().output]
    sections += [default().report, default().run]
    declared = [
        key
        for section in sections
        for key in type(section).model_fields
        if getattr(section, key) is not None
    ]
    assert keys == declared


def test_recorded_text_has_no_key_that_changes_no_result():
    found = default("run.threads=1", "run.precision=single")
    assert "threads" not in found.recorded
    assert config.from_text(found.recorded) == found.override(["run.threads=all"])


@pytest.mark.parametrize("folder", ["sph.kernels", "sph.eos", "sph.parts.external"])
def test_template_models_list_their_parameters(folder):
    text = config.template("shock_tube")
    for name in registry.names(folder):
        for key, (_, declared) in parameters(registry.model_class(folder, name)).items():
            assert declared.help != key  # has a help text
            assert f"#   {name}: {key}: {declared.help[:40]}" in text


@pytest.mark.parametrize("problem", registry.names("sph.problems"))
def test_template_reads_back_as_default_and_explains_every_key(problem):
    text = config.template(problem)
    plain = config.from_text(f'[problem]\nname = "{problem}"\n')
    assert config.from_text(text) == plain
    lines = text.splitlines()
    words = " ".join(text.replace("\n#", " ").split())
    for section in (plain.problem, plain.physics, plain.time, plain.output, plain.run):
        for key, field in type(section).model_fields.items():
            assert " ".join((field.description or "").split()) in words
            found = [
                i for i, line in enumerate(lines) if line.startswith((f"{key} =", f"# {key} ="))
            ]
            assert found  # two tables may have a key of one name
            assert all(lines[at - 1].startswith("# ") for at in found)
    if plain.physics.formulation != "gas":
        return
    # a long default stands in a line of its own
    assert "of at least 0 or a table { min, max, switch, ell } default" in words.replace(";", "")


def test_template_unknown_problem_names_nearest(messages):
    with messages.raised(ConfigError):
        config.template("shock_tub")


# --- overrides --------------------------------------------------------------------------------


def test_override_replaces_adds_and_merges(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(MINIMAL + "[physics]\nalpha = { min = 0.1, max = 2.0 }\n")
    found = config.load(path, ["physics.alpha.max=3", "time.end=9", "physics.kernel=cubic_spline"])
    assert (found.physics.alpha.min, found.physics.alpha.max) == (0.1, 3.0)
    assert found.time.end == 9.0
    assert found.physics.kernel == {"name": "cubic_spline", "flattened": False}


@pytest.mark.parametrize(("text", "value"), [(".25", 0.25), ("2.e-1", 0.2), ("+.5", 0.5)])
def test_override_number_needs_no_digits_beside_its_point(text, value):
    found = default(f"physics.C={text}").physics.C
    assert found == value


@pytest.mark.parametrize("text", [".25", "-.5", "2.", "[1., 2.]"])
def test_number_without_digits_beside_its_point_is_explained(text):
    with pytest.raises(ConfigError, match=r"digits on both sides of a point: 0\.5"):
        config.from_text(f"{MINIMAL}[physics]\nC = {text}\n")


def test_override_repeated_last_one_wins():
    assert default("time.end=1", "time.end=2").time.end == 2.0


def test_override_of_problem_name_changes_problem(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('[problem]\nname = "nonsense"\n')
    assert config.load(path, ["problem.name=shock_tube"]) == default()


def test_override_none_leaves_key_out(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('[problem]\nname = "gresho"\nmach = 0.1\n[problem.relax]\nseed = 3\n')
    assert config.load(path).problem.relax.seed == 3
    found = config.load(path, ["problem.relax=none", "problem.mach = none "])
    assert found == config.from_text('[problem]\nname = "gresho"\n')
    assert config.as_overrides({"problem.relax": None}) == ["problem.relax=none"]
    # in place of another key it gives nothing: gamma stays
    assert default("physics.gamma=2", "physics.eos=none").physics.gamma == 2.0
    # the last one wins
    assert config.load(path, ["problem.relax=none", "problem.relax={}"]).problem.relax.seed == 0
    assert config.load(path, ["problem.n=none", "problem.n=64"]).problem.n == 64


@pytest.mark.parametrize(
    "key", ["problem.n", "physics.gamma", "problem.left.density", "problem.lefd", "time.end"]
)
def test_override_none_of_key_that_needs_value_is_refused(messages, key):
    with messages.raised(ConfigError, key):
        default(f"{key}=none")


def test_override_none_of_key_with_default_of_problem_is_refused(messages):
    text = '[problem]\nname = "rayleigh_taylor"\n'
    with messages.raised(ConfigError, "physics.external"):
        config.from_text(text).override(["physics.external=none"])


def test_override_leaves_original_unchanged():
    before = default("problem.left.density=2")
    before.override(["problem.left.density=3", "physics.alpha={min=0, max=1}"])
    assert before == default("problem.left.density=2")


def test_override_of_eos_replaces_gamma_and_back():
    changed = default("physics.eos={name='ideal_gas', gamma=1.9}")
    assert changed.physics.gamma is None
    assert changed.override(["physics.gamma=1.3"]).physics.eos is None


@pytest.mark.parametrize("override", ["physics.alpha", "=3", "physics..alpha=3", "physics.=3"])
def test_override_malformed_is_refused(messages, override):
    message = only_error(MINIMAL, [override])
    assert message.startswith(f"--set {override}: ")
    messages.check(message)


def test_override_invalid_is_named_as_source(messages, tmp_path):
    text = MINIMAL + "[physics]\nalpha = { min = 0.1, max = 2.0 }\ngamma = 0.5\n"
    found = errors(text, ["physics.alpha={min = 0, max = 'a'}"], tmp_path / "a.toml")
    places = (
        f"{tmp_path}/a.toml, line 5: physics.gamma",
        "--set physics.alpha={min = 0, max = 'a'}: ",
    )
    assert [line.startswith(place) for line, place in zip(found, places, strict=True)] == [True] * 2
    messages.check("\n".join(found))


# --- errors -----------------------------------------------------------------------------------

# the text after [problem] and its name (lines 1 and 2), and the line and key of its one error
WRONG = {
    "type": ("n = 1.5", 3, "problem.n"),
    "bool for int": ("n = true", 3, "problem.n"),
    "string for number": ('[physics]\neta = "1"', 4, "physics.eta"),
    "bool for number": ("[physics]\n\nalpha = true", 5, "physics.alpha"),
    "number for bool": ("[physics]\nbalsara = 1", 4, "physics.balsara"),
    "bound": ("[physics]\ngamma = 1", 4, "physics.gamma"),
    "negative": ("[physics]\nalpha = -0.1", 4, "physics.alpha"),
    "zero": ("[time]\nend = 0", 4, "time.end"),
    "count or word": ("[physics]\ndensity_passes = 0", 4, "physics.density_passes"),
    "wrong word": ('[physics]\ndensity_passes = "convergd"', 4, "physics.density_passes"),
    "threads": ("[run]\nthreads = 0", 4, "run.threads"),
    "infinite": ("[output]\ninterval = inf", 4, "output.interval"),
    "undefined, deep": ("left = { density = nan }", 3, "problem.left.density"),
    "too large for a float": (f"[time]\nend = {'9' * 400}", 4, "time.end"),
    "dotted key": ("[physics]\nalpha.min = 0\nalpha.max = -1", 5, "physics.alpha.max"),
    "table header": ("[physics.alpha]\nmin = 2\nmax = 1", 4, "physics.alpha.min"),
    "wrong switch": (
        '[physics.alpha]\nmin = 1\nmax = 2\nswitch = "cullen"',
        6,
        "physics.alpha.switch",
    ),
    "parameter of another switch": (
        "[physics.alpha]\nmin = 1\nmax = 2\nell = 0.1",
        6,
        "physics.alpha.ell",
    ),
    "inline table, missing": ("[physics]\nalpha = { min = 0 }", 4, "physics.alpha.max"),
    "multi-line list": ('domain = [\n  -1,\n  "a" ]', 3, "problem.domain[1]"),
    "list of lists": ('domain = [[0, "a"]]', 3, "problem.domain[0][1]"),
    "name in a union": ('boundary = "miror"', 3, "problem.boundary"),
    "unknown key": ("[physics]\ngama = 1.4", 4, "physics.gama"),
    "unknown key, case": ("[physics]\nc = 0.1", 4, "physics.c"),
    "unknown key, all capitals": ("[physics]\nBALSARA = true", 4, "physics.BALSARA"),
    "unknown key, unlike any": ("[time]\nzzz = 1", 4, "time.zzz"),
    "unknown key, deep": (
        "left = { density = 1, pressure = 1, velocty = 1 }",
        3,
        "problem.left.velocty",
    ),
    "key of another table": ("alpha = 1", 3, "problem.alpha"),
    "unknown table": ("[phisics]\nalpha = 1", 3, "phisics"),
    "table for a number": ("[time]\nend = { a = 1 }", 4, "time.end"),
    "array of tables": ("[[time]]\nend = 1", 3, "time"),
    "unknown kernel": ('[physics]\nkernel = "wendland_c3"', 4, "physics.kernel"),
    "unknown kernel in a table": (
        '[physics]\nkernel = { name = "cubc_spline" }',
        4,
        "physics.kernel.name",
    ),
    "kernel table without a name": (
        "[physics]\nkernel = { flattened = true }",
        4,
        "physics.kernel.name",
    ),
    "unknown kernel parameter": (
        '[physics]\nkernel = { name = "cubic_spline", flatened = true }',
        4,
        "physics.kernel.flatened",
    ),
    "type of a kernel parameter": (
        '[physics]\nkernel = { name = "cubic_spline", flattened = 1 }',
        4,
        "physics.kernel.flattened",
    ),
    "kernel that is no name": ("[physics]\nkernel = 3", 4, "physics.kernel"),
    "bound of an eos parameter": (
        '[physics]\neos = { name = "ideal_gas", gamma = 1 }',
        4,
        "physics.eos.gamma",
    ),
    "missing eos parameter": ('[physics]\neos = { name = "ideal_gas" }', 4, "physics.eos.gamma"),
    "eos and gamma": (
        '[physics]\ngamma = 1.4\neos = { name = "ideal_gas", gamma = 1.4 }',
        5,
        "physics.eos",
    ),
    "domain upside down": ("domain = [1, 0]", 3, "problem.domain"),
    "domain upside down, on which another key's check relies": (
        "domain = [2, 0]\ndiscontinuity = 0.9",
        3,
        "problem.domain",
    ),
    "domain of too many axes": ("domain = [[-1, 1], [-1, 1]]", 3, "problem.domain"),
    "domain of too few axes": ("domain = [[-1, 1], [-1, 1]]\ndimension = 3", 3, "problem.domain"),
    "ragged domain": ("dimension = 2\ndomain = [[-1, 1], 3]", 4, "problem.domain"),
    "empty domain": ("domain = []", 3, "problem.domain"),
    "too few boundaries": ('dimension = 2\nboundary = ["open"]', 4, "problem.boundary"),
}


@pytest.mark.parametrize(("text", "line", "key"), WRONG.values(), ids=WRONG)
def test_each_error_gives_one_message(messages, text, line, key):
    message = only_error(MINIMAL + text)
    assert re.match(rf"x\.toml, line {line}: {re.escape(key)}(?![\w.])", message)
    messages.check(message)


# a whole text, and where its one error is and about what
ALONE = {
    "unknown scheme": (MINIMAL + '[physics]\nscheme = "grad_hh"', ", line 4", "physics.scheme"),
    "unknown problem": ('[problem]\nname = "shock_tub"\n', ", line 2", "problem.name"),
    "problem name of the wrong type": ("[problem]\nname = 3\n", ", line 2", "problem.name"),
    "no problem": ("", "", "problem.name"),
    "key outside its table": ("eta = 1\n" + MINIMAL, ", line 1", "eta"),
    "key outside all tables": ("zzz = 1\n" + MINIMAL, ", line 1", "zzz"),
    "a problem's own check": (
        "# a gas\n" + MINIMAL + "discontinuity = 9.0", ", line 2", "problem: discontinuity",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "place", "key"), ALONE.values(), ids=ALONE)
def test_error_of_whole_text_gives_one_message(messages, text, place, key):
    message = only_error(text)
    assert message.startswith(f"x.toml{place}: {key} ")
    messages.check(message)


def test_required_key_missing_is_refused(messages, monkeypatch):
    shock_tube = registry.load("sph.problems", "shock_tube").Problem
    monkeypatch.delitem(shock_tube.defaults, "time.end")
    for text, place in ((MINIMAL, ""), (MINIMAL + "[output]\n[time]\n", ", line 4")):
        message = only_error(text)
        assert message.startswith(f"x.toml{place}: time.end ")
        messages.check(message)


def test_override_of_run_refused_names_run(messages):
    message = only_error(MINIMAL, ["physics.alpha=x"])
    assert message.startswith("--set physics.alpha=x: physics.alpha ")
    messages.check(message)


def test_all_errors_reported_at_once_in_line_order(messages, tmp_path):
    text = """\
n = 3
[time]
end = -1
[problem]
name = "shock_tube"
n = "many"
domain = [1, 0]
gamma = 1.4
[physics]
alpha = { mn = 0.1, max = "high" }
kernel = { name = "cubic_spline", flat = 1 }
C = inf
[outptu]
interval = 1
"""
    found = errors(text, ["run.threads=-1"], tmp_path / "a.toml")
    places = [line.split(": ")[0].removeprefix(f"{tmp_path}/a.toml, ") for line in found]
    lines = [f"line {line}" for line in (1, 3, 6, 7, 8, 10, 10, 10, 11, 12, 13)]
    assert sorted(places[:9]) == sorted(lines[:9])
    assert places == [*lines, "--set run.threads=-1"]
    messages.check("\n".join(found))


def test_unknown_problem_other_tables_still_checked():
    found = errors('[problem]\nname = "x"\n[physics]\neta = 0\n')
    assert [line.split(": ")[0] for line in found] == ["x.toml, line 2", "x.toml, line 4"]


def test_messages_hide_library_wording(messages):
    text = MINIMAL + "\n".join(
        ["n = {}", "domain = 3", "left = 1", "[physics]", "alpha = []", "kernel = 1.5", "eos = 2"]
    )
    found = "\n".join(errors(text))
    assert len(found.splitlines()) == 6
    for word in ("Input", "valid", "pydantic", "dict", "int", "float", "None"):
        assert not re.search(rf"\b{word}\b", found)
    messages.check(found)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[problem]\nname = \n", "line 2, column 8"),
        ("[problem]\nname = 'a", "line 2"),
        ("a = 1\na = 2\n", "line 2, column 6"),
    ],
)
def test_invalid_toml_is_refused_with_line(messages, text, place):
    message = only_error(text)
    assert message.startswith(f"x.toml, {place}: ")
    messages.check(message, mask=r"(?<=TOML: ).*")  # the words of Python's own reader


# --- files ------------------------------------------------------------------------------------


def test_file_with_byte_order_mark_and_crlf_loads(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    assert config.load(path) == default()


def test_unreadable_file_is_refused(messages, tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\x89HDF\xff\xfe")
    for path in (tmp_path / "none.toml", tmp_path, binary):
        with messages.raised(FileError) as caught:
            config.load(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert caught.value.exit_code == 4


def test_too_many_checkpoints_is_refused(messages):
    text = '[problem]\nname = "shock_tube"\n[time]\nend = 0.2\n[output]\ninterval = {}\n'
    with messages.raised(ConfigError, "line 6", "output.interval"):
        config.from_text(text.format("1.9e-6"))
    assert config.from_text(text.format("2.1e-6")).output.interval == 2.1e-6


@pytest.mark.parametrize(("formulation", "key", "owner"), [
    ("continuum", "alpha", "gas"), ("continuum", "eta", "gas"), ("gas", "q_a", "continuum"),
])  # fmt: skip
def test_key_of_another_formulation_is_named(formulation, key, owner):
    text = f'{MINIMAL}\n[physics]\nformulation = "{formulation}"\n{key} = 1.0\n'
    assert only_error(text).endswith(
        f'physics.{key} is not a key of [physics]: {key} belongs to physics.formulation = "{owner}"'
    )


# --- tables of several things -----------------------------------------------------------------


@pytest.mark.parametrize("key", reading.REPEATED)
@pytest.mark.parametrize(
    ("first", "second"), [("[{}]", "[{}]"), ("[[{}]]", "[{}] # one"), ("[{}]", "[[ {} ]]")]
)
def test_table_given_twice_without_double_brackets(key, first, second):
    headers = [one.format(f"problem.{key}") for one in (first, second)]
    message = only_error("\n".join(headers))
    assert message.startswith("x.toml, line 2, column ")
    assert message.endswith(f". Try: [[problem.{key}]] for each, in place of [problem.{key}]")


def test_table_given_twice_that_occurs_once():
    assert "Try" not in only_error("[problem.relax]\n[problem.relax]")


def test_keys_that_are_repeated_tables():
    found = {
        key
        for name in registry.names("sph.problems")
        for key, field in registry.load("sph.problems", name).Problem.model_fields.items()
        if is_list_of_tables(field.annotation)
    }
    assert found == set(reading.REPEATED)


def test_fault_of_table_that_an_override_makes_names_the_override():
    text = '[problem]\nname = "regions"\nboundary = "open"\n'
    message = only_error(text, ["problem.relax.seed=1"])
    assert message.startswith("--set problem.relax.seed=1: problem.relax needs closed boundaries")


def test_fault_of_table_in_file_names_its_line(tmp_path):
    text = '[problem]\nname = "regions"\nboundary = "open"\n[problem.relax]\nresidual = 0.1\n'
    (message,) = errors(text, ["problem.relax.seed=1"], tmp_path / "x.toml")
    assert "x.toml, line 4: problem.relax needs" in message


def test_fault_of_all_keys_does_not_name_one_override():
    tables = {"problem": {"name": "particles", "n": 3}}
    with pytest.raises(ConfigError, match=r"^the configuration: problem: n = 3: expected 4"):
        config.from_tables(tables, ["problem.dimension=1"])
