"""Errors against a finer run: its fields carried by its kernels, and what does not fit."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from states import gas_state

from sph import config as configuration
from sph import runner
from sph.analysis.reference import Reference, at_points, check, errors_of
from sph.cli import main
from sph.errors import ConfigError, FileError
from sph.output.checkpoint import Checkpoint
from sph.output.run_directory import RunDirectory
from sph.progress import Lines

# Sums of some hundred terms, in any order.
ROUND_OFF = 1e-12


def state(dimension, boundary, n=120, seed=0) -> Checkpoint:
    """A checkpoint of random particles in the unit box, as `at_points` asks for it."""
    random = np.random.default_rng(seed)
    particles = gas_state(
        random.random((dimension, n)),
        random.normal(size=(dimension, n)),
        1.0 + random.random(n),
        1.0 + random.random(n),
    )
    particles.density[:] = 1.0 + random.random(n)
    particles.support[:] = 0.2 + 0.2 * random.random(n)
    text = (
        f'[problem]\nname = "uniform"\ndimension = {dimension}\ndomain = [0.0, 1.0]\n'
        f'boundary = "{boundary}"\n'
    )
    config = configuration.from_text(text)
    nothing = np.zeros(0)
    return Checkpoint(particles, 0.0, 0, 1.0, nothing, nothing, 0.0, config, ())


def written_out(one: Checkpoint, points, images) -> dict:
    """The formula point by point; images(x) gives (sign, position) of a particle's images."""
    particles = one.particles
    kernel, dim = one.config.physics.kernel_model(), (0,) * particles.dimension
    scalars = {
        "density": particles.density,
        "pressure": one.pressure,
        "internal_energy": particles.internal_energy,
    }
    found = {name: np.zeros(points.shape[1]) for name in scalars}
    found["velocity"] = np.zeros_like(points)
    for i, point in enumerate(points.T):
        total = 0.0
        for j in range(particles.number):
            H = particles.support[j]
            volume = particles.mass[j] / particles.density[j]
            for sign, position in images(particles.position[:, j]):
                q = np.linalg.norm(point - position) / H
                share = volume * H**-particles.dimension * kernel.w(dim, q)
                total += share
                for name, values in scalars.items():
                    found[name][i] += share * values[j]
                found["velocity"][:, i] += share * sign * particles.velocity[:, j]
        for values in found.values():
            values[..., i] /= total
    return found


def periodic(x):
    steps = np.array(np.meshgrid(*[(-1, 0, 1)] * x.size)).reshape(x.size, -1).T
    return [(np.ones(x.size), x + step) for step in steps]


def walls(x):
    """Reflections of a particle in the unit box, on every axis alone and together."""
    choices = np.array(np.meshgrid(*[(0, 1, 2)] * x.size)).reshape(x.size, -1).T
    signs = np.array([1.0, -1.0, -1.0])
    return [(signs[one], signs[one] * x + np.array([0.0, 0.0, 2.0])[one]) for one in choices]


@pytest.mark.parametrize(("boundary", "images"), [("periodic", periodic), ("mirror", walls)])
@pytest.mark.parametrize("dimension", [1, 2])
def test_reference_fields_are_interpolated_by_kernel(dimension, boundary, images):
    one = state(dimension, boundary)
    points = np.random.default_rng(5).random((dimension, 12))
    found, expected = at_points(one, points), written_out(one, points, images)
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert found[name] == pytest.approx(values, rel=ROUND_OFF, abs=ROUND_OFF)


def test_reference_fields_in_chunks_equal(monkeypatch):
    one, points = state(2, "periodic"), np.random.default_rng(5).random((2, 30))
    whole = at_points(one, points)
    monkeypatch.setattr("sph.analysis.interpolate.CHUNK", 7)
    for name, values in at_points(one, points).items():
        assert values == pytest.approx(whole[name], rel=ROUND_OFF, abs=ROUND_OFF)


def test_reference_constant_field_exact_and_missing_outside_gas():
    one = state(3, "open")
    one.particles.density[:] = 2.5
    found = at_points(one, np.array([[0.5, 9.0], [0.5, 9.0], [0.5, 9.0]]))["density"]
    assert found[0] == pytest.approx(2.5, rel=ROUND_OFF)
    assert np.isnan(found[1])


@pytest.fixture(scope="module")
def tubes(tmp_path_factory):
    """Three runs of a short tube, the last one finer."""
    directory = tmp_path_factory.mktemp("tubes")
    for n in (50, 100, 800):
        text = (
            f'[problem]\nname = "shock_tube"\nn = {n}\n[time]\nend = 0.05\n'
            "[output]\ninterval = 0.05\n[run]\nthreads = 1\n"
        )
        run = RunDirectory.create(directory / f"n={n}")
        runner.run(configuration.from_text(text), run, Lines())
    return directory


def test_errors_against_finer_run_near_errors_against_exact(tubes):
    fine = Reference(tubes / "n=800")
    for n in (50, 100):
        found = errors_of(tubes / f"n={n}", fine)
        exact = json.loads((tubes / f"n={n}" / "summary.json").read_text())["errors"]
        assert found["particles"] == exact["particles"]
        for name in ("density", "velocity", "pressure", "internal_energy"):
            # the reference's own error, an eighth of that of n = 100 at first order, and as much
            # again for the smoothing by its kernels
            assert found["fields"][name]["L1"] == pytest.approx(
                exact["fields"][name]["L1"], rel=0.25
            )


def test_errors_against_itself_are_smoothing_only(tubes):
    itself = errors_of(tubes / "n=100", Reference(tubes / "n=100"))
    finer = errors_of(tubes / "n=100", Reference(tubes / "n=800"))
    assert 0.0 < itself["fields"]["density"]["L1"] < finer["fields"]["density"]["L1"]


def test_errors_command_accepts_reference(tubes, tmp_path):
    arguments = ["report", str(tubes), "--reference", str(tubes / "n=800"), "-o", str(tmp_path)]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    numbers = [line.split()[0] for line in result.stdout.splitlines()[:3]]
    assert numbers == ["N", "51", "99"]  # without the reference itself
    assert "Compared: L1 error of density against the run n=800" in result.stdout


def test_reference_without_matching_checkpoint_is_refused(messages, tubes, tmp_path):
    text = (tubes / "n=50" / "config.toml").read_text()
    other = RunDirectory.create(tmp_path / "other")
    config = configuration.from_text(text).override(["time.end=0.02"])
    runner.run(config, other, Lines())
    with messages.raised(ConfigError):
        errors_of(tubes / "n=50", Reference(other.path))
    with messages.raised(FileError):
        Reference(tubes)
    (other.path / "checkpoints" / "checkpoint_000000.h5").write_text("damaged")
    with messages.raised(FileError):
        Reference(other.path).at(0.0)


# --- a reference that the configuration names -------------------------------------------------


def sph_(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.fixture
def config_with_reference(tubes, tmp_path, monkeypatch):
    """A configuration that names the finest tube, relative to the current directory."""
    monkeypatch.chdir(tubes)
    path = tmp_path / "tube.toml"
    text = (tubes / "n=50" / "config.toml").read_text()
    path.write_text(text.replace('reference = ""', 'reference = "n=800"'))
    return path


def test_run_with_reference_ends_with_errors_against_it(
    config_with_reference, tubes, tmp_path, monkeypatch
):
    result = sph_("run", config_with_reference, "-o", tmp_path / "run")
    assert result.exit_code == 0, result.output
    assert f"Error (L1 against the run {tubes / 'n=800'}" in result.stdout
    found = json.loads((tmp_path / "run" / "summary.json").read_text())["errors"]
    assert found == errors_of(tubes / "n=50", Reference(tubes / "n=800"))  # the same particles
    monkeypatch.chdir(tmp_path)  # the report needs no reference, nor does a restart lose it
    said = sph_("report", "run", "-o", tmp_path / "report").stdout
    assert "Compared: L1 error of density against the run n=800" in said
    restarted = sph_("restart", "run/checkpoints/checkpoint_000000.h5", "-o", "again")
    assert restarted.exit_code == 0, restarted.output
    assert json.loads((tmp_path / "again" / "summary.json").read_text())["errors"] == found


def test_errors_against_reference_and_exact_are_distinguished(
    config_with_reference, tubes, tmp_path
):
    sph_("run", config_with_reference, "-o", tmp_path / "run", "--set", "problem.n=60")
    said = sph_("report", tubes / "n=50", tmp_path / "run", "-o", tmp_path / "report").stdout
    assert "Errors differ in what they are against" in said
    assert "Compared: L1 error of density, plotted" in said


@pytest.mark.parametrize("dry", [[], ["--dry-run"]])
@pytest.mark.parametrize(
    ("setting", "code", "words"),
    [
        ("report.reference=n=12345", 4, "does not exist"),
        ("time.end=0.01", 2, "has no checkpoint at t = 0.01"),
        ("problem.n=60", 2, "the directory that the run itself is to go to"),
    ],
)
def test_run_with_unusable_reference_is_refused_at_start(
    config_with_reference, tubes, tmp_path, setting, code, words, dry
):
    target = tubes / "n=800" if "itself" in words else tmp_path / "run"
    before = sorted((tubes / "n=800" / "checkpoints").iterdir())
    result = sph_("run", config_with_reference, "-o", target, "--force", "--set", setting, *dry)
    assert result.exit_code == code
    assert words in result.stderr
    assert "Try: " in result.stderr
    assert not (tmp_path / "run").exists()
    assert sorted((tubes / "n=800" / "checkpoints").iterdir()) == before


def test_restart_without_reference_is_refused_unless_dropped(
    config_with_reference, tubes, tmp_path
):
    sph_("run", config_with_reference, "-o", tmp_path / "run", "--set", "time.end=0.05")
    begin = tmp_path / "run" / "checkpoints" / "checkpoint_000000.h5"
    history = (tmp_path / "run" / "history.csv").read_bytes()
    refused = sph_("restart", begin, "--set", "time.end=0.06")
    assert refused.exit_code == 2
    assert (tmp_path / "run" / "history.csv").read_bytes() == history  # nothing was done
    taken_back = sph_("restart", begin, "--set", "report.reference=", "--set", "time.end=0.02")
    assert taken_back.exit_code == 0, taken_back.output
    assert "L1 against the exact solution" in taken_back.stdout


def test_reference_of_other_problem_is_refused(messages, config_with_reference):
    other = configuration.from_text('[problem]\nname = "uniform"\n[time]\nend = 0.05\n')
    config = other.override(["report.reference=n=800"])
    with messages.raised(ConfigError, "problem.name"):
        check(config, None)


def test_run_with_reference_deleted_meanwhile_keeps_summary(
    messages, config_with_reference, tubes, tmp_path
):
    config = configuration.load(config_with_reference).override(
        [f"report.reference={tmp_path / 'gone'}"]
    )
    run = RunDirectory.create(tmp_path / "run")
    with messages.raised(FileError):
        runner.run(config, run, Lines())
    found = json.loads(run.summary.read_text())
    assert (found["status"], found["errors"]) == ("done", None)
