"""`--vary` read, ranges written out, their product and its names."""

import re

import pytest

from sph.errors import ConfigError
from sph.sweep.plan import LONGEST_NAME, Plan, expand, split

TUBE = '[problem]\nname = "shock_tube"\n'


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("1,2, 3", ["1", "2", "3"]),
        ("0.5", ["0.5"]),
        ("{min = 0.1, max = 2.0},1.0", ["{min = 0.1, max = 2.0}", "1.0"]),
        ("[[0, 1], [2, 3]],[0, 1]", ["[[0, 1], [2, 3]]", "[0, 1]"]),
        ("\"a,b\",'c,d'", ['"a,b"', "'c,d'"]),
        ('"a[","b"', ['"a["', '"b"']),
        ("wendland_c2,{name = 'cubic_spline', flattened = true}",
         ["wendland_c2", "{name = 'cubic_spline', flattened = true}"]),
    ],
)  # fmt: skip
def test_values_split_at_commas_outside_brackets_and_quotes(text, parts):
    assert split(text) == parts


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("100:1600:x2", ["100", "200", "400", "800", "1600"]),
        ("100:1599:x2", ["100", "200", "400", "800"]),
        ("800:100:x0.5", ["800", "400", "200", "100"]),
        ("0.5:4:x2", ["0.5", "1.0", "2.0", "4.0"]),
        ("0.05:0.3:+0.05", ["0.05", "0.1", "0.15", "0.2", "0.25", "0.3"]),
        ("0.1:0.7:+0.2", ["0.1", "0.3", "0.5", "0.7"]),  # 0.6 / 0.2 is below 3 in binary numbers
        ("1:1000:x10", ["1", "10", "100", "1000"]),  # and so is log 1000 / log 10
        ("0.3:0.05:-0.05", ["0.3", "0.25", "0.2", "0.15", "0.1", "0.05"]),
        ("1:2:+0.5", ["1.0", "1.5", "2.0"]),
        ("-1:1:+1", ["-1", "0", "1"]),
        ("5:5:+1", ["5"]),
        ("1e-6:1e-2:x100", ["1e-06", "0.0001", "0.01"]),
        ("wendland_c2", ["wendland_c2"]),
        ("a:b:c", ["a:b:c"]),
        ("1e-300:1e300:x1e200", ["1e-300", "1e-100", "1e+100", "1e+300"]),  # the ratio overflows
        (
            "123456789012345:123456789012347:+1",
            ["123456789012345", "123456789012346", "123456789012347"],
        ),  # all digits are kept
        ("1:2:xnan", ["1:2:xnan"]),
        ("\u0661:\u0663:+\u0661", ["\u0661:\u0663:+\u0661"]),  # digits, but not TOML's
    ],
)
def test_range_includes_last_value_within_rounding(text, values):
    assert expand(text) == values


@pytest.mark.parametrize(
    "text",
    ["100:1600:x1", "0:10:x2", "100:1600:x0.5", "1:2:+0", "1:2:-0.5", "0:1:+1e-9", "1:2:x2a",
     "1e400:1e400:x2", "1:1e400:+1", "1:2:+1e400", "1e-400:1:x10", "1:1e12:+1", "1:2:x1.0000001",
     "1:2:x1.00000000000000000001", "1:" + "9" * 400 + ":x10", "1:10001:+1"],
)  # fmt: skip
def test_endless_or_empty_range_is_refused(messages, text):
    with messages.raised(ConfigError, text):
        expand(text)


def test_product_varies_last_key_fastest_with_readable_names():
    plan = Plan.of(["problem.n=100,200", "physics.alpha=1.0,2.0"], ["physics.C=0.3"])
    assert [point.name for point in plan.points] == [
        "problem.n=100,physics.alpha=1.0",
        "problem.n=100,physics.alpha=2.0",
        "problem.n=200,physics.alpha=1.0",
        "problem.n=200,physics.alpha=2.0",
    ]
    assert plan.points[1].settings == ("problem.n=100", "physics.alpha=2.0")
    assert plan.overrides == ("physics.C=0.3",)


def test_point_names_are_safe_short_and_unique():
    plan = Plan.of(["physics.alpha={min = 0.1, max = 2.0},1.0", "a.b=x/y,x_y,x y,X/Y"])
    names = [point.name for point in plan.points]
    assert names[0].startswith("physics.alpha=min=0.1,max=2.0,a.b=x_y-")
    assert all(re.fullmatch(r"[\w.,=+-]+", name, re.ASCII) for name in names)
    # also where a file system does not tell capitals apart
    assert len({name.casefold() for name in names}) == len(names) == 8
    plan = Plan.of([f"a.b={'x' * 200}1,{'x' * 200}2"])
    names = [point.name for point in plan.points]
    assert len(set(names)) == 2
    assert max(map(len, names)) <= LONGEST_NAME


@pytest.mark.parametrize(
    "varies",
    [
        ["problem.n"],
        ["n=1,2"],
        ["problem.n="],
        ["problem.n=1,,2"],
        ["problem.n=1,2,1"],
        ["problem.n=100:400:x2,200"],
        ["problem.n=1", "problem.n=2"],
        ["problem.n=1", "problem . n=2"],
        ["problem.n=1:9000:+1", "physics.C=1:9000:+1"],
        ["problem. =1"],
    ],
    ids=" ".join,
)
def test_vary_unsuitable_key_is_refused(messages, varies):
    with messages.raised(ConfigError, "--vary"):
        Plan.of(varies)


def test_every_point_is_resolved(tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    plan = Plan.of(["physics.kernel=cubic_spline,wendland_c2"], ["problem.n=50"])
    found = plan.resolved(tmp_path / "tube.toml")
    assert [config.problem.n for config in found.values()] == [50, 50]
    assert found["physics.kernel=wendland_c2"].physics.kernel == "wendland_c2"


def test_each_error_reported_once_in_user_terms(tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    plan = Plan.of(["problem.n=100,x,200", "physics.alpha=1.0,-1.0"], ["physics.C=-2"])
    with pytest.raises(ConfigError) as told:
        plan.resolved(tmp_path / "tube.toml")
    lines = str(told.value).splitlines()
    assert len(lines) == 3
    starts = {line.partition(": ")[0] for line in lines}
    assert starts == {"--set physics.C=-2", "--vary problem.n=x", "--vary physics.alpha=-1.0"}


def test_error_of_combination_names_point(messages, tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    plan = Plan.of(["problem.dimension=1,2", "problem.lattice=cubic,hexagonal"])
    with messages.raised(ConfigError, "problem.lattice"):
        plan.resolved(tmp_path / "tube.toml")


@pytest.mark.parametrize("override", ["physics.alpha=1.0", "physics . alpha.min=0.1"])
def test_vary_key_also_set_is_refused(messages, override):
    with messages.raised(ConfigError, "physics.alpha"):
        Plan.of(["physics.alpha=0.5,1.0"], [override])


def test_two_points_with_equal_configuration_are_refused(messages, tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    with messages.raised(ConfigError, "physics.alpha"):
        Plan.of(["physics.alpha=0.5,0.50"]).resolved(tmp_path / "tube.toml")


def test_vary_text_not_utf8_is_refused(messages, tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE)
    with messages.raised(ConfigError):
        Plan.of(["physics.kernel=wendland_c2,\udcff"]).resolved(tmp_path / "tube.toml")
