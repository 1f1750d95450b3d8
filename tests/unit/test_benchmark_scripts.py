"""scripts/benchmark*.py: figures, stored results and the check for slower figures."""

import argparse
import importlib
import json
import sys
from pathlib import Path

import pytest

from sph import config

SCRIPTS = Path(__file__).parents[2] / "scripts"
HOME = SCRIPTS.parent
NAMES = ("benchmark", "benchmark_calibration", "benchmark_results", "benchmark_runs",
         "benchmark_scenes")  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def scripts_in_reach():
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def scripts(scripts_in_reach):
    return argparse.Namespace(**{name: importlib.import_module(name) for name in NAMES})


CALIBRATION_SUM = 521613.64915271563
MACHINE = {"processor": "A", "instructions": "avx2", "cores": 2, "numba": "1", "llvm": "2"}
DENSITY, PROCESS, MEMORY = (
    "engine / 32³ / update", "start / help / process", "engine / 32³ to 64³ / memory per particle"
)  # fmt: skip
ONLY_SHOWN = "engine / 32³ / density"


def figure(median, ratio, checked=True):
    spread = None if ratio is None else {"min": ratio, "median": ratio, "max": ratio}
    return {"unit": "", "checked": checked, "repeats": 1, "min": median, "median": median,
            "max": median, "ratio": spread}  # fmt: skip


def stored(measured="2026-01-01T00:00:00+00:00", machine=MACHINE, factor=1.0, **changed):
    """A result; factor: of the ratio of one figure."""
    figures = {
        DENSITY: figure(3.0, 2000.0 * factor),
        PROCESS: figure(1.0, 6e8),
        MEMORY: figure(700.0, None),
        ONLY_SHOWN: figure(1.0, 700.0 * factor, checked=False),
    } | changed
    return {"format": 1, "commit": "0123456789", "measured": measured, "machine": machine,
            "figures": figures}  # fmt: skip


@pytest.fixture
def folder(scripts, tmp_path, monkeypatch):
    """A folder of stored results in place of docs/benchmarks, with one result."""
    path = tmp_path / "benchmarks"
    path.mkdir()
    (path / "first.json").write_text(json.dumps(stored()))
    monkeypatch.setattr(scripts.benchmark_results.last, "__defaults__", (path, None))
    return path


def checked(scripts, tmp_path, content) -> int:
    new = tmp_path / "new.json"
    new.write_text(json.dumps(content))
    return scripts.benchmark.main(["--check", "--from", str(new)])


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.04])
def test_check_passes_faster_equal_and_four_per_cent_slower(
    scripts, folder, tmp_path, capsys, factor
):
    assert checked(scripts, tmp_path, stored(factor=factor)) == 0
    assert "3 figures, 0 slower" in capsys.readouterr().out


def test_check_warns_of_six_per_cent_with_a_table(scripts, folder, tmp_path, capsys):
    assert checked(scripts, tmp_path, stored(factor=1.06)) == 1
    out = capsys.readouterr().out
    assert f"| {DENSITY} | 2000 | 2120 | 6.0 % |" in out
    assert ONLY_SHOWN not in out
    assert PROCESS not in out


def test_check_compares_memory_without_calibration(scripts, folder, tmp_path, capsys):
    assert checked(scripts, tmp_path, stored(**{MEMORY: figure(750.0, None)})) == 1
    assert f"| {MEMORY} | 700 | 750 |" in capsys.readouterr().out


@pytest.mark.parametrize("key", ["processor", "instructions", "cores", "numba", "llvm"])
def test_check_does_not_compare_other_machines(scripts, folder, tmp_path, capsys, key):
    other = stored(machine={**MACHINE, key: "other"}, factor=2.0)
    assert checked(scripts, tmp_path, other) == 0
    assert "nothing compared" in capsys.readouterr().out


def test_check_names_missing_figures_of_measured_parts(scripts, folder, tmp_path, capsys):
    new = stored()
    del new["figures"][MEMORY], new["figures"][PROCESS]  # one figure of engine, the part start
    assert checked(scripts, tmp_path, new) == 0
    out = capsys.readouterr().out
    assert f"Not measured now: {MEMORY}" in out
    assert PROCESS not in out
    assert "1 figures" in out


def test_check_compares_with_the_latest_result(scripts, folder, tmp_path):
    # 10 % slower than the first result, and equal to the latest one. Times in other zones: as text
    # the older of the two would be the later.
    (folder / "a.json").write_text(
        json.dumps(stored(measured="2026-02-01T00:30:00+02:00", factor=5.0))
    )
    (folder / "b.json").write_text(
        json.dumps(stored(measured="2026-01-31T23:30:00+00:00", factor=1.1))
    )
    assert checked(scripts, tmp_path, stored(factor=1.1)) == 0
    assert checked(scripts, tmp_path, stored(factor=1.2)) == 1


def test_a_stored_result_is_not_compared_with_itself(scripts, folder, monkeypatch):
    # slower than the first result, but equal to itself
    path = folder / "second.json"
    path.write_text(json.dumps(stored(measured="2026-02-01T00:00:00+00:00", factor=1.2)))
    monkeypatch.chdir(folder)
    assert scripts.benchmark.main(["--check", "--from", path.name]) == 1


NO_MACHINE = {"format": 1, "measured": "2026-01-01T00:00:00+00:00", "figures": {}}


@pytest.mark.parametrize(
    "text",
    [
        "",
        json.dumps(stored())[:200],
        "[]",
        json.dumps(stored() | {"format": 2}),
        json.dumps(stored(measured="yesterday")),
        json.dumps(NO_MACHINE),
        json.dumps(stored(**{DENSITY: figure(3.0, float("nan"))})),
        json.dumps(stored(**{DENSITY: figure(3.0, 0.0)})),
        json.dumps(stored(**{DENSITY: {"median": 3.0}})),
    ],
)
def test_a_damaged_stored_result_is_an_error(scripts, folder, tmp_path, capsys, text):
    (folder / "damaged.json").write_text(text)
    assert checked(scripts, tmp_path, stored()) == 2
    error = capsys.readouterr().err
    assert "damaged.json: expected a result of the benchmark" in error
    assert "Try:" in error


def test_stored_results_of_the_repository_can_be_read(scripts):
    paths = sorted((HOME / "docs" / "benchmarks").glob("*.json"))
    assert paths
    for path in paths:
        content = scripts.benchmark_results.read(path)
        assert not content["changed"]
        assert any(one["checked"] for one in content["figures"].values())


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["engines"], "'engines' is no part"),
        (["--repeats", "0"], "at least 1"),
        (["--from", "x.json"], "for --check"),
    ],
)
def test_wrong_arguments_are_refused(scripts, capsys, arguments, expected):
    with pytest.raises(SystemExit) as raised:
        scripts.benchmark.main(arguments)
    assert raised.value.code == 2
    assert expected in capsys.readouterr().err


def measurement(scripts, values, part="engine", scene="32³", quantity="update"):
    """A measurement whose repeats give these values, whatever the tree; names the trees."""
    left, trees = list(values), []

    def once(tree):
        trees.append(tree)
        return {quantity: left.pop(0)}

    return scripts.benchmark_runs.Measurement(part, scene, once), trees


def test_trees_alternate_and_ratios_are_to_the_calibration_around(scripts):
    one, trees = measurement(scripts, [4.0, 8.0, 6.0, 10.0])
    calibrations = iter([1.0, 3.0, 2.0, 2.0, 1.0, 1.0, 5.0, 5.0])
    first, second = scripts.benchmark_runs.measure(one, ["a", "b"], 2, lambda: next(calibrations))
    assert trees == ["a", "b", "b", "a"]
    assert first[DENSITY].values == [4.0, 10.0]
    assert second[DENSITY].values == [8.0, 6.0]
    # CPU µs over ns, means of 1 and 3, of 5 and 5
    assert first[DENSITY].ratios == pytest.approx([4000 / 2, 10000 / 5], rel=1e-15)
    assert second[DENSITY].ratios == pytest.approx([8000 / 2, 6000 / 1], rel=1e-15)


def test_a_slow_machine_is_no_slow_figure(scripts, folder, tmp_path):
    """Twice the time of figure and calibration: the ratio is that of the stored result."""
    one, _ = measurement(scripts, [6.0])
    series = scripts.benchmark_runs.measure(one, [None], 1, lambda: 3.0)[0]
    assert series[DENSITY].compared == pytest.approx([2000.0], rel=1e-15)


@pytest.mark.parametrize(("again", "left"), [(3.0, 0), (3.6, 1)])
def test_only_suspicious_figures_are_measured_again(scripts, folder, again, left):
    slow, slow_runs = measurement(scripts, [3.6, again, again])
    good, good_runs = measurement(scripts, [1.0], "start", "help", "process")
    calibrate = lambda: 1.5  # noqa: E731
    figures = {}
    for one in (slow, good):
        figures |= scripts.benchmark_runs.measure(one, [None], 1, calibrate)[0]
    figures[PROCESS].ratios[:] = [6e8]
    tree = scripts.benchmark_runs.Tree(HOME, ("double",))
    old = stored()
    names = scripts.benchmark.repeated(old, tree, figures, [slow, good], 2, calibrate)
    assert names == [DENSITY]
    assert (len(slow_runs), len(good_runs)) == (3, 1)
    assert figures[DENSITY].values == [3.6, again, again]
    content = scripts.benchmark_results.result(HOME, figures, [1.5])
    assert scripts.benchmark.report((folder / "first.json", old), content, names) == left


def test_result_has_what_a_comparison_needs(scripts, tmp_path):
    series = scripts.benchmark_runs.Series([3.0, 1.0, 2.0], [30.0, 10.0, 21.0])
    content = scripts.benchmark_results.result(HOME, {DENSITY: series}, [1.0, 2.0, 4.0])
    scripts.benchmark_results.write(tmp_path / "new.json", content)
    again = scripts.benchmark_results.read(tmp_path / "new.json")
    assert again == content
    assert again["calibration_ns_per_pair"] == {"min": 1.0, "median": 2.0, "max": 4.0}
    assert again["figures"][DENSITY] == {
        "unit": "CPU µs", "checked": True, "repeats": 3, "min": 1.0, "median": 2.0, "max": 3.0,
        "ratio": {"min": 10.0, "median": 21.0, "max": 30.0},
    }  # fmt: skip
    assert set(scripts.benchmark_results.KIND) <= set(again["machine"])
    assert again["version"]


def test_cost_of_a_further_step_leaves_out_the_start(scripts):
    phases = {"density": 1.0, "lists": 0.5, "initial state": 7.0, "output": 3.0}
    longer = {"density": 3.0, "lists": 1.0, "initial state": 9.0, "output": 4.0}
    found = scripts.benchmark_scenes.of_updates(
        {"updates": 3_000_000, "phases_cpu_seconds": longer},
        {"updates": 1_000_000, "phases_cpu_seconds": phases},
    )
    assert found == pytest.approx({"update": 1.25, "density": 1.0, "lists": 0.25}, rel=1e-15)


def tree_of(folder: Path, keys: dict) -> Path:
    (folder / "sph" / "config").mkdir(parents=True)
    (folder / "sph" / "__init__.py").touch()
    (folder / "sph" / "config" / "__init__.py").touch()
    (folder / "sph" / "config" / "sections.py").write_text(
        f"class Run:\n    model_fields = {keys}\nSECTIONS = {{'run': Run}}\n"
    )
    return folder


@pytest.mark.parametrize(
    ("keys", "precisions"),
    [({"threads": 1}, ("double",)), ({"threads": 1, "precision": 1}, ("double", "single"))],
)
def test_precisions_of_a_tree_are_those_of_its_configuration(scripts, tmp_path, keys, precisions):
    tree = scripts.benchmark_runs.Tree.at(tree_of(tmp_path, keys))
    assert tree == (tmp_path, precisions)


def test_folder_without_sph_is_refused(scripts, tmp_path):
    with pytest.raises(scripts.benchmark_runs.BenchmarkError, match=str(tmp_path)):
        scripts.benchmark_runs.Tree.at(tmp_path)


@pytest.mark.slow
def test_measuring_a_run_of_this_tree(scripts):
    tree = scripts.benchmark_runs.Tree.at(HOME)
    cost = scripts.benchmark_runs.run(tree, scripts.benchmark_scenes.tube(n=60, end=0.01))
    found = scripts.benchmark_scenes.of_updates(cost)
    assert cost["updates"] == cost["steps"] * cost["particles"] > 0
    assert {"density", "rates"} < set(found)
    # the phases of the steps are part of what the process has used
    assert 0.0 < 1e-6 * found["update"] * cost["updates"] < cost["process"].cpu
    with pytest.raises(scripts.benchmark_runs.BenchmarkError, match="problem"):
        scripts.benchmark_runs.run(tree, '[problem]\nname = "none"\n')


def test_calibration_is_the_work_that_stored_ratios_refer_to(scripts):
    module = scripts.benchmark_calibration
    calibration = module.Calibration(seconds=0.001)
    assert 0.0 < calibration() < 1e6
    # a sum of 163,840 terms, in any order: round-off of about 1e-13
    assert calibration.arrays[-1].sum() == pytest.approx(CALIBRATION_SUM, rel=1e-11)
    assert "sph" not in (SCRIPTS / "benchmark_calibration.py").read_text().split("import numpy")[1]


def test_blocks_are_valid_and_of_the_asked_size(scripts):
    found = config.from_text(scripts.benchmark_scenes.blocks(4096, 20, 1, 0.3))
    start = found.problem.initial(found.physics.eos_model())
    # whole lattices of cubes
    assert start.mass.size == 2 * 13**3
    assert found.physics.correction == 1
    # 20 steps of 0.3 d/(Q + (Q^2 + c^2)^(1/2)) with Q = c and d = 1.2 spacings
    c, spacing = (1 + 4 / 3 * 0.5) ** 0.5, (2 / 4096) ** (1 / 3)
    expected = 20 * 0.3 * 1.2 * spacing / (c * (1 + 2**0.5))
    assert found.time.end == pytest.approx(expected, rel=1e-3)
