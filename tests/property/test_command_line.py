"""Whatever text is given to --set and --vary: a message and an exit code, never a traceback."""

import os

import pytest
from click.testing import CliRunner
from hypothesis import example, given
from hypothesis import strategies as some

from sph import runner
from sph.cli import main
from sph.sweep import local

TUBE = '[problem]\nname = "shock_tube"\nn = 40\n[time]\nend = 0.01\n'
KEYS = ("problem.n", "problem.dimension", "problem.domain", "problem.lattice", "physics.alpha",
        "physics.C", "physics.kernel", "physics.eos", "physics.heating", "physics.max_support",
        "time.end", "output.interval", "report.reference", "run.threads", "problem", "physics.x",
        "physics . C", "", ".", "a.b.c", "physics.alpha.min")  # fmt: skip
WORDS = ("1", "-1", "0", "1e400", "-1e400", "1e-400", "nan", "inf", "0.1:0.3:+0.1", "1:1e6:+1",
         "1e400:1e400:x2", "1:1e12:x1.0000001", "3:1:x2", "1:2:+0", "1e-300:1e300:x1e10", "1:2:x",
         "9" * 400, "9" * 5000, "1:" + "9" * 400 + ":x1e9", "x" * 300, "[" * 2000, "{a = 1}",
         "[0, 1]", "[[0, 1]]", '"a\\u0000b"', "\udcff", "", ",", "0.50,0.5", "true", "'", '"',
         "wendland_c2", "{min = 0.1, max = 2.0}", "1979-05-27", "\n", "\x00", "../../x", "é",
         "\u0661:\u0663:+\u0661", "{name = 'constant'}")  # fmt: skip

texts = some.one_of(
    some.builds("{}={}".format, some.sampled_from(KEYS), some.sampled_from(WORDS)),
    some.builds("{}={}".format, some.sampled_from(KEYS), some.text(max_size=20)),
    some.builds("{}={},{}".format, some.sampled_from(KEYS), *[some.sampled_from(WORDS)] * 2),
    some.builds(
        "{}={}:{}:{}{}".format, some.sampled_from(KEYS), *[some.floats(width=32)] * 2,
        some.sampled_from("x+-"), some.floats(width=32),
    ),
    some.text(max_size=20),
)  # fmt: skip


@pytest.fixture(autouse=True)
def without_runs(monkeypatch, tmp_path_factory):
    """In a directory of its own, with points and runs left out."""
    directory = tmp_path_factory.mktemp("fuzzed")
    (directory / "tube.toml").write_text(TUBE)
    monkeypatch.chdir(directory)
    monkeypatch.setattr(local, "run", lambda tasks, jobs, tell: None)

    def stopped(*_):
        raise SystemExit(0)

    monkeypatch.setattr(runner, "run", stopped)


def checked(*arguments):
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code in (0, 2, 4), (arguments, result.output)
    assert result.exception is None or isinstance(result.exception, SystemExit), arguments


@given(some.lists(texts, min_size=1, max_size=3), some.lists(texts, max_size=2))
@example(["physics.C=1e400:1e400:x2"], [])
@example(["physics.C=1e-300:1e300:x1e10"], [])
@example(["physics.C=1:9000:+1", "physics.alpha=1:9000:+1"], [])
@example(["physics.kernel=\udcff,\x00"], [])
@example(["problem.dimension=1.0"], [])
def test_any_vary_text_accepted_or_clean_error(varied, given_texts):
    target = f"sweep-{len(os.listdir())}"
    options = [part for text in varied for part in ("--vary", text)]
    options += [part for text in given_texts for part in ("--set", text)]
    checked("sweep", "tube.toml", *options, "-o", target)


@given(some.lists(texts, min_size=1, max_size=3))
@example(['report.reference="a\\u0000b"'])
@example(["report.reference=\udcff"])
def test_any_set_text_accepted_or_clean_error(given_texts):
    options = [part for text in given_texts for part in ("--set", text)]
    checked("run", "tube.toml", *options, "--force")
