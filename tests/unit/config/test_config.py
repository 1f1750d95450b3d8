"""The configuration: what it resolves to, that it reads back, and every error a user can make."""

import re

import pytest

from sph import config, registry
from sph.errors import ConfigError, FileError
from sph.viscosity import constant
from sph.viscosity.switches import cullen_dehnen, morris_monaghan

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
def test_incomplete_table_in_file_is_refused(tmp_path, table):
    path = tmp_path / "half.toml"
    path.write_text(MINIMAL + table + "\n")
    message = "problem.right.pressure is missing: expected a number greater than 0"
    with pytest.raises(ConfigError, match=message):
        config.load(path)
    with pytest.raises(ConfigError, match=message):  # nor does setting another member fill it
        config.load(path, ["problem.right.velocity=1"])
    assert config.load(path, ["problem.right.pressure=0.2"]).problem.right.pressure == 0.2


def test_incomplete_table_in_override_is_refused():
    with pytest.raises(ConfigError, match=r"problem\.right\.pressure is missing"):
        default("problem.right={density=1.0}")


def test_integer_for_float_becomes_float():
    found = default("physics.alpha=1", "physics.gamma=2", "problem.domain=[-1, 1]")
    values = [found.physics.alpha, found.physics.gamma, *found.problem.domain]
    assert values == [1, 2, -1, 1]
    assert {type(value) for value in values} == {float}


def test_models_from_scalar_settings():
    physics = default("physics.gamma=2", "physics.alpha=2").physics
    assert type(physics.kernel_model()) is registry.model_class("sph.kernels", "wendland_c2")
    assert physics.eos_model() == registry.model_class("sph.eos", "ideal_gas")(2.0)
    assert type(physics.viscosity_model()) is constant.ConstantAlpha
    assert type(physics.viscosity_model().alpha) is float


def test_models_from_tables():
    physics = default(
        "physics.alpha={min = 0, max = 2}",
        "physics.kernel={name = 'cubic_spline', flattened = true}",
        "physics.eos={name = 'ideal_gas', gamma = 3}",
    ).physics
    viscosity = physics.viscosity_model()
    assert type(viscosity) is morris_monaghan.MorrisMonaghan
    assert (type(viscosity.min), type(viscosity.max)) == (float, float)
    assert viscosity == (0.0, 2.0)
    other = default("physics.alpha={min = 0, max = 2, switch = 'cullen_dehnen'}").physics
    assert type(other.viscosity_model()) is cullen_dehnen.CullenDehnen
    assert other.viscosity_model() == (0.0, 2.0, 0.05)
    assert physics.kernel_model().flattened is True
    assert physics.eos_model() == (3.0,)
    assert type(physics.eos_model().gamma) is float


PAIRS = '[problem]\nname = "uniform"\n[physics]\nkernel = "cubic_spline"\n'


@pytest.mark.parametrize(
    ("kernel", "dimension", "eta", "limit"),
    [("cubic_spline", 2, 1.41, "1.4"), ("cubic_spline", 3, 1.6, "1.2"),
     ("quintic_spline", 2, 2.2, "1.8"), ("quintic_spline", 3, 1.7, "1.6")],
)  # fmt: skip
def test_kernel_at_pairing_eta_is_refused(tmp_path, kernel, dimension, eta, limit):
    path = tmp_path / "a.toml"
    path.write_text(PAIRS)
    keys = (f"physics.kernel={kernel}", f"problem.dimension={dimension}", f"physics.eta={eta}")
    with pytest.raises(ConfigError, match=rf"physics\.kernel = .*{dimension}-D .* above {limit}"):
        config.load(path, keys)
    assert config.load(path, (*keys, "physics.allow_pairing=true")).physics.eta == eta
    assert config.load(path, (*keys, f"physics.eta={limit}")).physics.eta == float(limit)
    assert config.load(path, (*keys, "problem.dimension=1")).physics.eta == eta
    for other in ("wendland_c2", "{name='cubic_spline', flattened=true}"):
        assert config.load(path, (*keys, f"physics.kernel={other}")).physics.eta == eta


def test_config_error_has_line_and_suggestion(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(PAIRS)
    with pytest.raises(ConfigError) as error:
        config.load(path)
    assert str(error.value).startswith(f"{path}, line 4: physics.kernel = ")
    assert "physics.allow_pairing = true" in str(error.value)
    assert "Wendland" in str(error.value)


def test_existing_run_with_refused_kernel_readable_but_not_changeable():
    found = config.from_text(PAIRS)
    assert found.physics.kernel == {"name": "cubic_spline", "flattened": False}
    with pytest.raises(ConfigError, match="particles pair"):
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


def test_run_table_may_be_omitted():
    found = default("run.threads=1")
    text = found.to_toml(include_run=False)
    assert "[run]" not in text
    assert config.from_text(text) == found.override(["run.threads=all"])


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
    assert "of at least 0 or a table { min, max, switch, ell }; default" in words


def test_template_unknown_problem_names_nearest():
    with pytest.raises(ConfigError, match='no problem "shock_tub"; did you mean shock_tube'):
        config.template("shock_tub")


# --- overrides --------------------------------------------------------------------------------


def test_override_replaces_adds_and_merges(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(MINIMAL + "[physics]\nalpha = { min = 0.1, max = 2.0 }\n")
    found = config.load(path, ["physics.alpha.max=3", "time.end=9", "physics.kernel=cubic_spline"])
    assert (found.physics.alpha.min, found.physics.alpha.max) == (0.1, 3.0)
    assert found.time.end == 9.0
    assert found.physics.kernel == {"name": "cubic_spline", "flattened": False}


def test_override_repeated_last_one_wins():
    assert default("time.end=1", "time.end=2").time.end == 2.0


def test_override_of_problem_name_changes_problem(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('[problem]\nname = "nonsense"\n')
    assert config.load(path, ["problem.name=shock_tube"]) == default()


def test_override_leaves_original_unchanged():
    before = default("problem.left.density=2")
    before.override(["problem.left.density=3", "physics.alpha={min=0, max=1}"])
    assert before == default("problem.left.density=2")


def test_override_of_eos_replaces_gamma_and_back():
    changed = default("physics.eos={name='ideal_gas', gamma=1.9}")
    assert changed.physics.gamma is None
    assert changed.override(["physics.gamma=1.3"]).physics.eos is None


@pytest.mark.parametrize("override", ["physics.alpha", "=3", "physics..alpha=3", "physics.=3"])
def test_override_malformed_is_refused(override):
    assert errors(MINIMAL, [override]) == [f"--set {override}: expected TABLE.KEY=VALUE"]


def test_override_invalid_is_named_as_source(tmp_path):
    text = MINIMAL + "[physics]\nalpha = { min = 0.1, max = 2.0 }\ngamma = 0.5\n"
    found = errors(text, ["physics.alpha={min = 0, max = 'a'}"], tmp_path / "a.toml")
    assert found == [
        f"{tmp_path}/a.toml, line 5: physics.gamma = 0.5: expected a number greater than 1",
        "--set physics.alpha={min = 0, max = 'a'}: physics.alpha.max = \"a\": "
        "expected a number of at least 0",
    ]


# --- errors -----------------------------------------------------------------------------------

# the text after [problem] and its name (lines 1 and 2), and the message it must lead to
WRONG = {
    "type": ("n = 1.5", "line 3: problem.n = 1.5: expected a whole number from 2 to 100000000"),
    "bool for int": (
        "n = true",
        "line 3: problem.n = true: expected a whole number from 2 to 100000000",
    ),
    "string for number": (
        '[physics]\neta = "1"',
        'line 4: physics.eta = "1": expected a number greater than 0',
    ),
    "bool for number": (
        "[physics]\n\nalpha = true",
        "line 5: physics.alpha = true: expected a number of at least 0 or a table "
        "{ min, max, switch, ell }",
    ),
    "number for bool": (
        "[physics]\nbalsara = 1",
        "line 4: physics.balsara = 1: expected true or false",
    ),
    "bound": (
        "[physics]\ngamma = 1",
        "line 4: physics.gamma = 1: expected a number greater than 1",
    ),
    "negative": (
        "[physics]\nalpha = -0.1",
        "line 4: physics.alpha = -0.1: expected a number of at least 0 or a table "
        "{ min, max, switch, ell }",
    ),
    "zero": ("[time]\nend = 0", "line 4: time.end = 0: expected a number greater than 0"),
    "count or word": (
        "[physics]\ndensity_passes = 0",
        'line 4: physics.density_passes = 0: expected a whole number from 1 to 100 or "converged"',
    ),
    "wrong word": (
        '[physics]\ndensity_passes = "convergd"',
        'line 4: physics.density_passes = "convergd": expected a whole number from 1 to 100 or '
        '"converged"; did you mean "converged"?',
    ),
    "threads": (
        "[run]\nthreads = 0",
        'line 4: run.threads = 0: expected a whole number of at least 1 or "all"',
    ),
    "infinite": (
        "[output]\ninterval = inf",
        "line 4: output.interval = inf: expected a finite number",
    ),
    "undefined, deep": (
        "left = { density = nan }",
        "line 3: problem.left.density = nan: expected a finite number",
    ),
    "too large for a float": (
        f"[time]\nend = {'9' * 400}",
        f"line 4: time.end = {'9' * 57}...: expected a number greater than 0",
    ),
    "dotted key": (
        "[physics]\nalpha.min = 0\nalpha.max = -1",
        "line 5: physics.alpha.max = -1: expected a number of at least 0",
    ),
    "table header": (
        "[physics.alpha]\nmin = 2\nmax = 1",
        "line 4: physics.alpha.min = 2.0: expected at most max = 1.0",
    ),
    "wrong switch": (
        '[physics.alpha]\nmin = 1\nmax = 2\nswitch = "cullen"',
        'line 6: physics.alpha.switch = "cullen": expected one of "cullen_dehnen", '
        '"morris_monaghan"; did you mean "cullen_dehnen"?',
    ),
    "parameter of another switch": (
        "[physics.alpha]\nmin = 1\nmax = 2\nell = 0.1",
        'line 6: physics.alpha.ell is no parameter of "morris_monaghan"',
    ),
    "inline table, missing": (
        "[physics]\nalpha = { min = 0 }",
        "line 4: physics.alpha.max is missing: expected a number of at least 0",
    ),
    "multi-line list": (
        'domain = [\n  -1,\n  "a" ]',
        'line 3: problem.domain[1] = "a": expected a number or a list of these',
    ),
    "list of lists": (
        'domain = [[0, "a"]]',
        'line 3: problem.domain[0][1] = "a": expected a number',
    ),
    "name in a union": (
        'boundary = "miror"',
        'line 3: problem.boundary = "miror": expected "periodic", "mirror" or "open", '
        'or a list of these; did you mean "mirror"?',
    ),
    "unknown key": (
        "[physics]\ngama = 1.4",
        "line 4: physics.gama is not a key of [physics]; did you mean gamma?",
    ),
    "unknown key, case": (
        "[physics]\nc = 0.1",
        "line 4: physics.c is not a key of [physics]; did you mean C?",
    ),
    "unknown key, all capitals": (
        "[physics]\nBALSARA = true",
        "line 4: physics.BALSARA is not a key of [physics]; did you mean balsara?",
    ),
    "unknown key, unlike any": (
        "[time]\nzzz = 1",
        "line 4: time.zzz is not a key of [time]; there are end",
    ),
    "unknown key, deep": (
        "left = { density = 1, pressure = 1, velocty = 1 }",
        "line 3: problem.left.velocty is not a key of [problem.left]; did you mean velocity?",
    ),
    "key of another table": (
        "alpha = 1",
        "line 3: problem.alpha is not a key of [problem]: alpha belongs in [physics]",
    ),
    "unknown table": (
        "[phisics]\nalpha = 1",
        "line 3: phisics is not a table of a configuration; did you mean physics?",
    ),
    "table for a number": (
        "[time]\nend = { a = 1 }",
        "line 4: time.end = { a = 1 }: expected a number greater than 0",
    ),
    "array of tables": (
        "[[time]]\nend = 1",
        "line 3: time = [{ end = 1 }]: expected a table [time]",
    ),
    "unknown kernel": (
        '[physics]\nkernel = "wendland_c3"',
        f'line 4: physics.kernel = "wendland_c3": expected one of {KERNELS}, '
        'or a table { name, its parameters }; did you mean "wendland_c6"?',
    ),
    "unknown kernel in a table": (
        '[physics]\nkernel = { name = "cubc_spline" }',
        f'line 4: physics.kernel.name = "cubc_spline": expected one of {KERNELS}; '
        'did you mean "cubic_spline"?',
    ),
    "kernel table without a name": (
        "[physics]\nkernel = { flattened = true }",
        f"line 4: physics.kernel.name is missing: expected one of {KERNELS}",
    ),
    "unknown kernel parameter": (
        '[physics]\nkernel = { name = "cubic_spline", flatened = true }',
        "line 4: physics.kernel.flatened is not a key of [cubic_spline]; did you mean flattened?",
    ),
    "type of a kernel parameter": (
        '[physics]\nkernel = { name = "cubic_spline", flattened = 1 }',
        "line 4: physics.kernel.flattened = 1: expected true or false",
    ),
    "kernel that is no name": (
        "[physics]\nkernel = 3",
        f"line 4: physics.kernel = 3: expected one of {KERNELS}, "
        "or a table { name, its parameters }",
    ),
    "bound of an eos parameter": (
        '[physics]\neos = { name = "ideal_gas", gamma = 1 }',
        "line 4: physics.eos.gamma = 1: expected a number greater than 1",
    ),
    "missing eos parameter": (
        '[physics]\neos = { name = "ideal_gas" }',
        "line 4: physics.eos.gamma is missing: expected a number greater than 1",
    ),
    "eos and gamma": (
        '[physics]\ngamma = 1.4\neos = { name = "ideal_gas", gamma = 1.4 }',
        "line 5: physics.eos stands in place of physics.gamma: give one of the two",
    ),
    "domain upside down": (
        "domain = [1, 0]",
        "line 3: problem.domain = [1, 0]: expected lo below hi",
    ),
    "domain upside down, on which another key's check relies": (
        "domain = [2, 0]\ndiscontinuity = 0.9",
        "line 3: problem.domain = [2, 0]: expected lo below hi",
    ),
    "domain of too many axes": (
        "domain = [[-1, 1], [-1, 1]]",
        "line 3: problem.domain = [[-1, 1], [-1, 1]]: expected [lo, hi] for all axes in 1-D",
    ),
    "domain of too few axes": (
        "domain = [[-1, 1], [-1, 1]]\ndimension = 3",
        "line 3: problem.domain = [[-1, 1], [-1, 1]]: expected [lo, hi] for all axes, "
        "or a list of one for each in 3-D",
    ),
    "ragged domain": (
        "dimension = 2\ndomain = [[-1, 1], 3]",
        "line 4: problem.domain = [[-1, 1], 3]: expected [lo, hi] for all axes, "
        "or a list of one for each in 2-D",
    ),
    "empty domain": (
        "domain = []",
        "line 3: problem.domain = []: expected [lo, hi] for all axes in 1-D",
    ),
    "too few boundaries": (
        'dimension = 2\nboundary = ["open"]',
        'line 4: problem.boundary = ["open"]: expected one for all axes, '
        "or a list of one for each in 2-D",
    ),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
def test_each_error_gives_one_message(text, message):
    assert only_error(MINIMAL + text) == f"x.toml, {message}"


def test_unknown_scheme_names_the_nearest():
    message = only_error(MINIMAL + '[physics]\nscheme = "grad_hh"')
    assert message.startswith('x.toml, line 4: physics.scheme = "grad_hh": expected one of ')
    assert message.endswith('did you mean "grad_h"?')


def test_unknown_problem_is_refused():
    message = only_error('[problem]\nname = "shock_tub"\n')
    expected = 'problem.name = "shock_tub" is not a problem; did you mean shock_tube?'
    assert message == f"x.toml, line 2: {expected}"


def test_problem_name_wrong_type_is_refused():
    message = only_error("[problem]\nname = 3\n")
    assert message == "x.toml, line 2: problem.name = 3: expected a string"


def test_missing_problem_is_one_error():
    valid = ", ".join(registry.names("sph.problems"))
    assert only_error("") == f"x.toml: problem.name is missing: expected one of {valid}"


def test_key_outside_tables_is_refused():
    assert only_error("eta = 1\n" + MINIMAL) == (
        "x.toml, line 1: eta is not a table: it belongs in [physics]"
    )
    assert only_error("zzz = 1\n" + MINIMAL).startswith("x.toml, line 1: zzz stands outside")


def test_required_key_missing_is_refused(monkeypatch):
    shock_tube = registry.load("sph.problems", "shock_tube").Problem
    monkeypatch.delitem(shock_tube.defaults, "time.end")
    message = "time.end is missing: expected a number greater than 0"
    assert only_error(MINIMAL) == f"x.toml: {message}"
    assert only_error(MINIMAL + "[output]\n[time]\n") == f"x.toml, line 4: {message}"


def test_problem_own_check_is_reported():
    message = only_error("# a gas\n" + MINIMAL + "discontinuity = 9.0")
    assert message.startswith("x.toml, line 2: problem: discontinuity = 9.0 ")


def test_override_of_run_refused_names_run():
    message = only_error(MINIMAL, ["physics.alpha=x"])
    assert message.startswith('--set physics.alpha=x: physics.alpha = "x": expected a number')


def test_all_errors_reported_at_once_in_line_order(tmp_path):
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


def test_unknown_problem_other_tables_still_checked():
    found = errors('[problem]\nname = "x"\n[physics]\neta = 0\n')
    assert [line.split(": ")[0] for line in found] == ["x.toml, line 2", "x.toml, line 4"]


def test_messages_hide_library_wording():
    text = MINIMAL + "\n".join(
        ["n = {}", "domain = 3", "left = 1", "[physics]", "alpha = []", "kernel = 1.5", "eos = 2"]
    )
    found = "\n".join(errors(text))
    assert len(found.splitlines()) == 6
    for word in ("Input", "valid", "pydantic", "dict", "int", "float", "None"):
        assert not re.search(rf"\b{word}\b", found)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[problem]\nname = \n", "line 2, column 8"),
        ("[problem]\nname = 'a", "line 2"),
        ("a = 1\na = 2\n", "line 2, column 6"),
    ],
)
def test_invalid_toml_is_refused_with_line(text, place):
    assert only_error(text).startswith(f"x.toml, {place}: not valid TOML: ")


# --- files ------------------------------------------------------------------------------------


def test_file_with_byte_order_mark_and_crlf_loads(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    assert config.load(path) == default()


def test_unreadable_file_is_refused(tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\x89HDF\xff\xfe")
    for path, reason in [
        (tmp_path / "none.toml", "there is no such file"),
        (tmp_path, "a directory"),
        (binary, "not a configuration file"),
    ]:
        with pytest.raises(FileError, match=reason) as caught:
            config.load(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert caught.value.exit_code == 4


def test_too_many_checkpoints_is_refused():
    text = '[problem]\nname = "shock_tube"\n[time]\nend = 0.2\n[output]\ninterval = {}\n'
    with pytest.raises(ConfigError, match=r"line 6: output.interval = .*: expected at least 2e-06"):
        config.from_text(text.format("1.9e-6"))
    assert config.from_text(text.format("2.1e-6")).output.interval == 2.1e-6
