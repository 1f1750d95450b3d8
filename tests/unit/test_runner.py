"""Runs as a user has them: outputs, stops, failures, and restarts that continue bit for bit."""

import csv
import dataclasses
import itertools
import json
import re
import shutil
import signal
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from marks import slow_except

from sph import config as configuration
from sph import restarting, runner
from sph.analysis.summary import in_words
from sph.clock import STARTING
from sph.errors import ConfigError, FileError, NumericalError, Stopped
from sph.output import checkpoint as checkpoints
from sph.output.history import History
from sph.output.run_directory import RunDirectory, find
from sph.output.times import output_times
from sph.summary import Conservation, Cost, Nearest, Norms, Session, Summary, of_json
from sph.totals import Baseline

TUBE = """
[problem]
name = "shock_tube"
n = 60
boundary = "mirror"
[time]
end = 0.2
[output]
interval = 0.05
[run]
threads = 1
"""
# 525 blocks: enough for a pass to be shared by two threads
SHEAR = """
[problem]
name = "kelvin_helmholtz"
n = 4400
boundary = "periodic"
[physics]
alpha = { min = 0.1, max = 2.0 }
[time]
end = 0.024
[output]
interval = 0.006
[run]
threads = 1
"""
CLOUD = """
[problem]
name = "uniform"
dimension = 3
n = 343
noise = 0.2
boundary = "open"
[physics]
C = 0.02
balsara = false
density_passes = 3
[time]
end = 0.1
[output]
interval = 0.025
[run]
threads = 1
"""
# acceleration is state here: it goes through new orders, and walls turn it round
SHOCKS = """
[problem]
name = "uniform"
dimension = 2
n = 1600
noise = 0.3
velocity = 1.0
boundary = "mirror"
[physics]
C = 0.03
alpha = { min = 0.05, max = 2.0, switch = "cullen_dehnen" }
conductivity = { name = "pressure_jump", switched = true }
[time]
end = 0.032
[output]
interval = 0.008
[run]
threads = 1
"""
# particles of two steps and of one share blocks; the switch takes the step of each particle
EACH = SHOCKS.replace("[time]\n", '[time]\nstepping = "individual"\n')
COLLAPSE = CLOUD.replace("[physics]\n", "[physics]\ngravity = { G = 5.0 }\n").replace(
    "[time]\n", '[time]\nstepping = "individual"\n'
)
SCENES = {
    "1-D mirror": TUBE,
    "2-D periodic, switched alpha": SHEAR,
    "2-D mirror, alpha by shocks, switched conductivity": SHOCKS,
    "3-D open": CLOUD,
    "2-D mirror, individual steps": EACH,
}


class Watch:
    """Progress that keeps the notes and calls back, e.g. `at_step(simulation)` after each step."""

    each_step = False

    def __init__(self, at_step=None, at_note=None, at_start=None, at_checkpoint=None):
        self.at_step, self.at_note = at_step, at_note
        self.at_start, self.at_checkpoint = at_start, at_checkpoint
        self.notes = []

    def note(self, text):
        self.notes.append(text)
        if self.at_note:
            self.at_note()

    def start(self, begin, end):
        if self.at_start:
            self.at_start()

    def step(self, simulation):
        if self.at_step:
            self.at_step(simulation)

    def wrote(self, path, simulation):
        if self.at_checkpoint:
            self.at_checkpoint(path)

    def close(self): ...


def interrupt(*_):
    signal.raise_signal(signal.SIGINT)


def start(text, directory, progress=None):
    """A new run in `directory`: the run directory."""
    target = RunDirectory.create(directory)
    runner.run(configuration.from_text(text), target, progress or Watch())
    return target


def go_on(source, *overrides, into=None, progress=None):
    return restarting.restart(source, overrides, into, progress or Watch())[1]


def copy(run, directory):
    return RunDirectory(shutil.copytree(run.path, directory))


def state(path):
    """Every dataset of /Checkpoint."""
    with h5py.File(path) as file:
        return {name: dataset[()] for name, dataset in file["Checkpoint"].items()}


def differences(one, other):
    """Names of the datasets of two checkpoints that are not equal bit for bit."""
    one, other = state(one), state(other)
    # the 10 arrays every scene has, 3 of the lists, time, step, next_step, 4 of the energy budget
    assert len(one) >= 20
    hashes = checkpoints.state_hash
    return [
        name
        for name in sorted(set(one) | set(other))
        if name not in one
        or name not in other
        or hashes({name: one[name]}) != hashes({name: other[name]})
    ]


def by_step(run):
    return {int(state(path)["step"]): path for path in run.checkpoints()}


def rows(run):
    """The history without its seconds, as text: floats there keep every bit."""
    with run.history.open(newline="") as file:
        return [
            {name: value for name, value in row.items() if not name.endswith("_seconds")}
            for row in csv.DictReader(file)
        ]


def assert_same_from(step, run, reference):
    """All checkpoints after `step` and the whole history are those of the uninterrupted run."""
    found, expected = by_step(run), by_step(reference)
    later = [one for one in expected if one > step]
    assert later
    assert {one: differences(found[one], expected[one]) for one in later} == {
        one: [] for one in later
    }
    assert rows(run) == rows(reference)


def numbers(run):
    return [path.name for path in run.checkpoints()]


def steps_after(run, time):
    return sum(float(row["t"]) > time for row in rows(run))


def files(directory):
    return {path: path.read_bytes() for path in sorted(directory.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module", params=slow_except({0}, SCENES))
def uninterrupted(request, tmp_path_factory):
    """A scene's text and its run to the end on one thread."""
    text = SCENES[request.param]
    return SimpleNamespace(text=text, run=start(text, tmp_path_factory.mktemp("scene") / "run"))


@pytest.fixture(scope="module")
def tube(tmp_path_factory):
    """The run of TUBE, for tests that only look or copy it."""
    return start(TUBE, tmp_path_factory.mktemp("tube") / "run")


# --- outputs ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("end", "interval", "times"),
    [
        (0.2, 0.05, [0.05, 0.1, 0.15, 0.2]),
        (0.3, 0.1, [0.1, 0.2, 0.3]),  # 3 x 0.1 is not 0.3 in binary
        (0.7, 0.1, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),
        (0.25, 0.1, [0.1, 0.2, 0.25]),
        (0.2, 1.0, [0.2]),
        (0.2, 1e12, [0.2]),
        (0.2, 0.2, [0.2]),
        (1 / 3, 1 / 9, [0.111111111111111, 0.222222222222222, 1 / 3]),
        (3e-9, 1e-9, [1e-9, 2e-9, 3e-9]),
    ],
)
def test_output_times_from_interval_and_end(end, interval, times):
    assert list(output_times(end, interval)) == times


@pytest.mark.parametrize(
    ("after", "times"),
    [
        (0.0, [0.1, 0.2, 0.25]),
        (0.1, [0.2, 0.25]),
        (0.1 + 1e-15, [0.2, 0.25]),
        (0.1 - 1e-15, [0.2, 0.25]),
        (0.17, [0.2, 0.25]),
        (0.25, []),
    ],
)
def test_output_times_remaining_after_restart(after, times):
    assert list(output_times(0.25, 0.1, after)) == times


def test_output_times_of_earlier_end_are_prefix():
    assert list(output_times(0.3, 0.1)) == list(output_times(0.6, 0.1))[:3]


def test_checkpoints_at_output_times_and_history_every_step(uninterrupted):
    run, config = uninterrupted.run, configuration.from_text(uninterrupted.text)
    times = [0.0, *output_times(config.time.end, config.output.interval)]
    assert [float(state(path)["time"]) for path in run.checkpoints()] == times
    assert numbers(run) == [f"checkpoint_{k:06d}.h5" for k in range(5)]
    history = rows(run)
    assert [int(row["step"]) for row in history] == list(range(max(by_step(run)) + 1))
    assert float(history[0]["t"]) == 0.0
    assert float(history[-1]["t"]) == config.time.end
    assert {row["limiter"] for row in history} <= {"signal_speed", "energy"}
    assert 1 <= int(history[0]["limiter_particle"]) <= state(run.checkpoint_path(0))["id"].size
    # the allowed step is taken, but where it is cut to land on an output
    taken = np.diff([float(row["t"]) for row in history])
    allowed = np.array([float(row["dt"]) for row in history[:-1]])
    # a step may be stretched by a billionth to land; t itself is rounded to 2e-16
    assert np.all(taken <= allowed * (1 + 2e-9))
    assert np.sum(taken < allowed * (1 - 1e-9)) <= 4


def test_history_matches_checkpoint(tube):
    last, row = state(tube.checkpoint_path(4)), rows(tube)[-1]
    kinetic = 0.5 * np.sum(last["mass"] * last["velocity"] ** 2)
    # sums of 60 numbers in another order
    assert float(row["kinetic_energy"]) == pytest.approx(kinetic, rel=1e-13)
    internal = np.sum(last["mass"] * last["internal_energy"])
    assert float(row["internal_energy"]) == pytest.approx(internal, rel=1e-13)
    assert float(row["momentum_x"]) == pytest.approx(np.sum(last["mass"] * last["velocity"]))
    assert float(row["max_density"]) == last["density"].max()
    assert float(row["dt"]) == last["next_step"]


# --- restarts that equal the uninterrupted run ------------------------------------------------


@pytest.mark.parametrize("number", [0, 1, 3])
def test_restart_on_two_threads_is_bit_for_bit(uninterrupted, number, tmp_path):
    run = copy(uninterrupted.run, tmp_path / "run")
    path = run.checkpoint_path(number)
    go_on(path, "run.threads=2")
    assert numbers(run) == numbers(uninterrupted.run)
    assert_same_from(int(state(path)["step"]), run, uninterrupted.run)


def test_restart_to_later_end_is_bit_for_bit(uninterrupted, tmp_path):
    config = configuration.from_text(uninterrupted.text)
    half = f"time.end={config.time.end / 2}"
    run = RunDirectory.create(tmp_path / "run")
    runner.run(config.override([half, "run.threads=2"]), run, Watch())
    assert numbers(run) == [f"checkpoint_{k:06d}.h5" for k in range(3)]
    go_on(run.path, f"time.end={config.time.end}", "run.threads=1")
    assert numbers(run) == numbers(uninterrupted.run)
    assert_same_from(0, run, uninterrupted.run)


@pytest.mark.slow
@pytest.mark.parametrize("stepping", ["global", "individual"])
def test_restart_with_self_gravity_is_bit_for_bit(tmp_path, stepping):
    text = COLLAPSE.replace("individual", stepping)
    whole = start(text, tmp_path / "whole")
    half = configuration.from_text(text).override(["time.end=0.05", "run.threads=2"])
    run = RunDirectory.create(tmp_path / "run")
    runner.run(half, run, Watch())
    go_on(run.path, "time.end=0.1", "run.threads=1")
    assert_same_from(0, run, whole)
    assert state(run.latest())["potential"].max() < 0.0


def test_restart_after_stop_between_outputs_is_bit_for_bit(uninterrupted, tmp_path):
    run = RunDirectory.create(tmp_path / "run")

    def in_the_life_of_lists(simulation):
        origin = simulation.search.origin.position
        used = not np.array_equal(origin, simulation.particles.position)
        between = simulation.time not in output_times(
            simulation.scene.config.time.end, simulation.scene.config.output.interval
        )
        if used and between and simulation.step >= 3 and not stopped:
            stopped.append(simulation.step)
            interrupt()

    stopped = []
    with pytest.raises(Stopped) as caught:
        runner.run(configuration.from_text(uninterrupted.text), run, Watch(in_the_life_of_lists))
    assert caught.value.exit_code == 75
    assert f"sph restart {run.path}" in str(caught.value)
    assert json.loads(run.summary.read_text())["status"] == "stopped"
    last = state(run.checkpoints()[-1])
    assert [int(last["step"])] == stopped
    assert not np.array_equal(last["list_position"], last["position"])
    go_on(run.path, "run.threads=2")
    assert_same_from(stopped[0], run, uninterrupted.run)
    assert len(run.checkpoints()) == len(uninterrupted.run.checkpoints()) + 1


def test_restart_test_runs_change_every_step(uninterrupted):
    """What makes the comparisons above mean something."""
    paths = uninterrupted.run.checkpoints()
    same = {"id", "mass", "alpha", "alpha_rate", "list_skin", "energy_injected", "energy_added",
            "baseline_energy", "baseline_scale"}  # fmt: skip
    same |= {"list_position", "list_support"}  # lists may last from one checkpoint to the next
    for one, other in itertools.pairwise(paths):
        assert set(state(one)) - same - set(differences(one, other)) == set()


def test_summary_matches_its_type(tube):
    """Names and types of the figures: the type is what every reader goes by."""
    text = tube.summary.read_text()
    found = of_json(text)
    assert found == json.loads(text)  # nothing here is non-finite
    # others are those of some scenes; summaries of earlier versions have no momentum_along
    expected = Summary.__required_keys__ | {"momentum_along"}
    assert list(found) == [name for name in Summary.__annotations__ if name in expected]
    for table, kind in (("conservation", Conservation), ("nearest", Nearest), ("cost", Cost)):
        assert list(found[table]) == list(kind.__annotations__)
    assert list(found["cost"]["session"]) == list(Session.__annotations__)
    for norms in found["errors"]["fields"].values():
        assert list(norms) == list(Norms.__annotations__)


def test_cost_adds_up_over_sessions(tube, tmp_path):
    run = copy(tube, tmp_path / "run")
    go_on(run.checkpoint_path(2))
    with run.history.open(newline="") as file:
        found = [(float(r["wall_seconds"]), float(r["cpu_seconds"])) for r in csv.DictReader(file)]
    assert np.all(np.diff(found, axis=0) >= 0)
    cost = json.loads(run.summary.read_text())["cost"]
    assert (cost["wall_seconds"], cost["cpu_seconds"]) == found[-1]
    step = int(state(run.checkpoint_path(2))["step"])
    assert cost["session"]["steps"] == len(found) - 1 - step
    assert cost["wall_seconds"] > found[step][0] > 0.0


# --- where a restart goes on ------------------------------------------------------------------


def test_restart_from_earlier_checkpoint_replaces_later_ones(tube, tmp_path):
    run = copy(tube, tmp_path / "run")
    go_on(run.checkpoint_path(1), "time.end=0.12", "physics.alpha=2.0")
    assert numbers(run) == [f"checkpoint_{k:06d}.h5" for k in range(4)]
    assert [float(state(path)["time"]) for path in run.checkpoints()] == [0.0, 0.05, 0.1, 0.12]
    assert differences(run.checkpoint_path(1), tube.checkpoint_path(1)) == []
    assert "velocity" in differences(run.checkpoint_path(2), tube.checkpoint_path(2))
    resolved = configuration.load(run.config)
    assert (resolved.time.end, resolved.physics.alpha) == (0.12, 2.0)
    assert checkpoints.read(run.checkpoint_path(3)).config.physics.alpha == 2.0
    assert "restarted at step" in checkpoints.read(run.checkpoint_path(3)).lineage[-1]


def test_restart_into_new_directory_keeps_original(tube, tmp_path):
    before = files(tube.path)
    run = go_on(tube.checkpoint_path(2), into=tmp_path / "new" / "run")
    assert run.path == tmp_path / "new" / "run"
    assert files(tube.path) == before
    assert numbers(run) == numbers(tube)
    assert [differences(a, b) for a, b in zip(run.checkpoints(), tube.checkpoints(), strict=True)]
    assert_same_from(-1, run, tube)
    assert json.loads(run.summary.read_text())["status"] == "done"
    go_on(run.path, "time.end=0.21")  # and that is a run directory like any other


def test_restart_checkpoint_without_run_needs_output_directory(tube, tmp_path):
    lone = shutil.copy(tube.checkpoint_path(2), tmp_path / "lone.h5")
    with pytest.raises(FileError, match=r"not in a run directory.*\n.*-o DIR"):
        go_on(tmp_path / "lone.h5")
    run = go_on(tmp_path / "lone.h5", into=tmp_path / "run")
    assert numbers(run) == [f"checkpoint_{k:06d}.h5" for k in range(3)]
    assert differences(run.checkpoint_path(0), lone) == []
    for number in (1, 2):
        assert differences(run.checkpoint_path(number), tube.checkpoint_path(number + 2)) == []
    step = int(state(lone)["step"])
    first, *others = rows(run)
    assert others == rows(tube)[step + 1 :]
    # the first step's limiter is not in a checkpoint
    assert (first["limiter"], first["limiter_particle"]) == ("checkpoint", "0")
    unknown = {"limiter": None, "limiter_particle": None}
    assert first | unknown == rows(tube)[step] | unknown


def without_budget(path):
    """Make it a checkpoint of format 1, which leaves the energy budget to the history."""
    checkpoints.write(path, dataclasses.replace(checkpoints.read(path), budget=None))
    with h5py.File(path) as file:
        assert file["Checkpoint"].attrs["format_version"] == 1


def test_restart_without_budget_and_history_measures_drift_anew(tube, tmp_path):
    lone = shutil.copy(tube.checkpoint_path(2), tmp_path / "lone.h5")
    without_budget(tmp_path / "lone.h5")
    run = go_on(tmp_path / "lone.h5", into=tmp_path / "run")
    step = int(state(lone)["step"])
    first, *others = rows(run)
    unknown = {"energy_drift": None}
    assert [row | unknown for row in others] == [row | unknown for row in rows(tube)[step + 1 :]]
    assert (first["energy_drift"], rows(tube)[step]["energy_drift"]) != ("0.0", "0.0")
    assert first["energy_drift"] == "0.0"


def test_failed_run_restarts_from_before_energy_drift(tube, tmp_path):
    """What goes wrong is found some steps later: a checkpoint in between holds it already."""
    run = copy(tube, tmp_path / "run")
    for number, drift in ((2, 4e-4), (3, -6e-4), (4, 4e-3)):  # a tenth of 0.5 % is good enough
        step = int(state(run.checkpoint_path(number))["step"])
        rewritten(run, step, "energy_drift", lambda _, drift=drift: drift)
    assert find(run.path)[1] == run.checkpoint_path(4)  # a run that is done, or was stopped
    run.write_summary({"status": "failed"})
    assert find(run.path)[1] == run.checkpoint_path(2)
    run.checkpoint_path(2).write_bytes(b"damaged")
    assert find(run.path)[1] == run.checkpoint_path(1)


def test_restart_skips_damaged_last_checkpoint_and_names_it(tube, tmp_path):
    run = copy(tube, tmp_path / "run")
    whole = run.checkpoint_path(4).read_bytes()
    run.checkpoint_path(4).write_bytes(whole[: len(whole) // 2])
    progress = Watch()
    go_on(run.path, progress=progress)
    assert [
        note
        for note in progress.notes
        if "checkpoint_000004.h5 is skipped (it cannot be read)" in note
    ]
    assert [note for note in progress.notes if "continuing from checkpoint_000003.h5" in note]
    assert_same_from(-1, run, tube)


def test_restart_without_damage_reports_none(tube, tmp_path):
    progress = Watch()
    run = copy(tube, tmp_path / "run")
    go_on(run.checkpoint_path(2), progress=progress)
    go_on(run.path, "time.end=0.21", progress=progress)
    assert not [note for note in progress.notes if "cannot be read" in note]


def test_restart_removes_old_summary(tube, tmp_path):
    run = copy(tube, tmp_path / "run")
    seen = []
    watch = Watch(at_step=lambda simulation: seen.append(run.summary.exists()))
    go_on(run.path, "time.end=0.21", progress=watch)
    assert seen
    assert not any(seen)
    assert json.loads(run.summary.read_text())["time"] == 0.21


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["problem.n=61"], "problem.n cannot be changed"),
        (["problem.dimension=2"], "problem.dimension cannot"),
        (["problem.left={density=2.0,pressure=1.0}"], "problem.left cannot"),
        (["physics.alpha={min=0.1,max=2.0}"], "physics.alpha = .*: expected one number"),
        (["physics.gamma=1.6"], r"physics\.gamma cannot be changed"),
        (["time.end=0.1"], "time.end = 0.1: expected a later time than the checkpoint's, 0.2"),
        (["physics.aplha=2"], "alpha"),
        (["problem.n=61", "time.end=0.1"], r"(?s)problem\.n.*time\.end"),
    ],
)
def test_restart_refused_change_leaves_run_unchanged(tube, tmp_path, overrides, message):
    before = files(tube.path)
    for into in (None, tmp_path / "new"):
        with pytest.raises(ConfigError, match=message):
            go_on(tube.path, *overrides, into=into)
    assert files(tube.path) == before
    assert not (tmp_path / "new").exists()


# a particle far from the others, whose support is held, and a liquid
ALONE = """
[problem]
name = "particles"
boundary = "open"
domain = [0.0, 1.0]
positions = [[0.1], [0.2], [0.3], [0.4], [0.5], [0.6], [0.7], [9.0]]
masses = 0.125
[physics]
eta = 1.2
[time]
end = 0.1
[output]
interval = 0.025
[run]
threads = 1
"""
LIQUID = """
[problem]
name = "shock_tube"
n = 60
boundary = "mirror"
left = { density = 1000.0, velocity = 0.0, pressure = 1e9 }
right = { density = 1000.0, velocity = 0.0, pressure = 1e5 }
[physics]
eos = { name = "stiffened_gas", gamma = 4.4, p_inf = 1e9 }
kernel = "wendland_c6"
eta = 2.4
[time]
end = 1.2e-4
[output]
interval = 3e-5
[run]
threads = 1
"""


def test_limited_supports_reported_at_start_and_counted_each_step(tmp_path, tube):
    watch = Watch()
    run = start(ALONE, tmp_path / "run", watch)
    said = (
        "1 particle(s) have too few neighbours: their support radius is limited to 1 "
        "(physics.max_support)"
    )
    assert said in watch.notes
    assert {row["held_supports"] for row in rows(run)} == {"1"}
    assert "held_supports" not in rows(tube)[0]  # walls are near: nothing can be alone


PULL = 'external = { name = "point_mass", mass = 0.2, softening = 0.3 }'
PULLED = TUBE + f"[physics]\n{PULL}\n"
HEATED = TUBE + "[physics]\nheating = { name = 'relaxation', energy = 20.0, time = 0.1 }\n"


@pytest.mark.parametrize(
    "text",
    slow_except({2}, [ALONE, LIQUID, HEATED, PULLED]),
    ids=["held support", "stiffened gas", "heating", "external field"],
)
def test_restart_of_rare_options_is_bit_for_bit(tmp_path, text):
    whole = start(text, tmp_path / "whole")
    part = copy(whole, tmp_path / "part")
    go_on(part.checkpoint_path(1))
    assert_same_from(int(state(whole.checkpoint_path(1))["step"]), part, whole)


def rewritten(run, row, column, change):
    """Change a value of the history by hand."""
    with run.history.open(newline="") as file:
        names, *lines = csv.reader(file)
    place = names.index(column)
    lines[row][place] = repr(change(float(lines[row][place])))
    with run.history.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([names, *lines])


@pytest.mark.parametrize("text", [TUBE, HEATED, PULLED], ids=["plain", "heating", "field"])
def test_restart_without_budget_continues_by_history(tmp_path, text):
    whole = start(text, tmp_path / "whole")
    part = copy(whole, tmp_path / "part")
    without_budget(part.checkpoint_path(1))
    go_on(part.checkpoint_path(1))
    later = ["checkpoint_000002.h5", "checkpoint_000003.h5", "checkpoint_000004.h5"]
    assert numbers(part)[2:] == later
    assert rows(part) == rows(whole)
    # of the sums that the history holds, the baseline is the same to the last bit
    for number in (2, 3, 4):
        assert differences(part.checkpoint_path(number), whole.checkpoint_path(number)) == []


def budgeted(run, number, **changed):
    """Change the energy budget of a checkpoint by hand."""
    path = run.checkpoint_path(number)
    read = checkpoints.read(path)
    checkpoints.write(path, dataclasses.replace(read, budget=read.budget._replace(**changed)))


def test_restart_measures_energy_drift_from_start_of_run(tube, tmp_path):
    """What the run began with, and what was injected until then: both are in the checkpoint."""
    run = copy(tube, tmp_path / "injected")
    budgeted(run, 2, injected=0.25)
    go_on(run.checkpoint_path(2))
    assert rows(run)[-1]["energy_injected"] == "0.25"  # this tube injects none
    assert checkpoints.read(run.latest()).budget.injected == 0.25
    run = copy(tube, tmp_path / "more")
    # half as much again of the kinetic energy, which is 0 at the start, and the internal energy
    energy = checkpoints.read(run.checkpoint_path(2)).budget.baseline.energy
    budgeted(run, 2, baseline=Baseline(1.5 * energy, 1.5 * energy))
    with pytest.raises(NumericalError, match=r"total energy has drifted by -33\.3 %"):
        go_on(run.checkpoint_path(2))


def test_restart_without_budget_measures_energy_drift_by_history(tube, tmp_path):
    run = copy(tube, tmp_path / "injected")
    without_budget(run.checkpoint_path(2))
    step = int(state(run.checkpoint_path(2))["step"])
    rewritten(run, step, "energy_injected", lambda _: 0.25)
    go_on(run.checkpoint_path(2))
    assert rows(run)[-1]["energy_injected"] == "0.25"
    run = copy(tube, tmp_path / "more")
    without_budget(run.checkpoint_path(2))
    rewritten(run, 0, "internal_energy", lambda energy: 1.5 * energy)
    with pytest.raises(NumericalError, match=r"total energy has drifted by -33\.3 %"):
        go_on(run.checkpoint_path(2))


@pytest.mark.parametrize(
    ("before", "after", "evolves"),
    [
        ("cullen_dehnen", "morris_monaghan", True),
        pytest.param("morris_monaghan", "cullen_dehnen", False, marks=pytest.mark.slow),
    ],
)
def test_restart_with_other_viscosity_switch_is_accepted(tmp_path, before, after, evolves):
    def alpha(switch):
        return f'physics.alpha={{ min = 0.1, max = 2.0, switch = "{switch}" }}'

    run = RunDirectory.create(tmp_path / "run")
    config = configuration.from_text(TUBE).override([alpha(before)])
    runner.run(config, run, Watch())
    assert ("alpha_rate" in state(run.checkpoint_path(4))) != evolves
    go_on(run.checkpoint_path(2), alpha(after))
    assert json.loads(run.summary.read_text())["status"] == "done"
    last = state(run.checkpoint_path(4))
    assert ("alpha_rate" in last) == evolves
    assert 0.1 <= last["alpha"].min() < 0.3 < last["alpha"].max() <= 2.0  # off, and on in the shock


# --- stops ------------------------------------------------------------------------------------


def test_stop_at_output_writes_no_second_checkpoint(tmp_path):
    watch = Watch(at_checkpoint=lambda path: interrupt() if "000001" in path.name else None)
    with pytest.raises(Stopped, match="checkpoint_000001"):
        start(TUBE, tmp_path / "run", watch)
    assert numbers(RunDirectory(tmp_path / "run"))[-1] == "checkpoint_000001.h5"


def test_run_restores_signal_handlers(tmp_path):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    start(TUBE.replace("end = 0.2", "end = 0.002"), tmp_path / "run")
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_stop_before_first_step_keeps_initial_state(tmp_path, tube):
    with pytest.raises(Stopped, match="checkpoint_000000"):
        start(TUBE, tmp_path / "run", Watch(at_note=interrupt))
    run = RunDirectory(tmp_path / "run")
    assert numbers(run) == ["checkpoint_000000.h5"]
    go_on(run.path)
    assert_same_from(-1, run, tube)


def test_stop_before_first_step_of_restart_keeps_checkpoint(tube, tmp_path):
    run = copy(tube, tmp_path / "run")
    run.checkpoint_path(4).write_bytes(b"")
    with pytest.raises(Stopped, match="checkpoint_000003"):
        go_on(run.path, progress=Watch(at_start=interrupt))
    assert numbers(run) == numbers(tube)[:-1]
    go_on(run.path)
    assert_same_from(-1, run, tube)


def test_second_signal_ends_at_once_and_restores_handlers(tmp_path):
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)

    def twice(simulation):
        interrupt()
        interrupt()

    try:
        with pytest.raises(KeyboardInterrupt):
            start(TUBE, tmp_path / "run", Watch(at_step=twice))
        assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    finally:
        signal.signal(signal.SIGINT, handler)
    assert len(rows(RunDirectory(tmp_path / "run"))) == 2  # what was reached is on disk


# --- failures ---------------------------------------------------------------------------------

STRONG = """
[problem]
name = "shock_tube"
n = 100
domain = [-1.0, 1.0]
boundary = "periodic"
left = { density = 1.0, velocity = 0.0, pressure = 1000.0 }
right = { density = 1.0, velocity = 0.0, pressure = 0.01 }
[physics]
alpha = 2.0
C = 0.15
max_energy_drift = 1e-15
[time]
end = 0.012
[output]
interval = 0.006
"""


def test_numerical_failure_names_particle_and_restart_command(tmp_path, recwarn):
    run = RunDirectory.create(tmp_path / "run")
    with pytest.raises(NumericalError) as caught:
        runner.run(configuration.from_text(STRONG), run, Watch())
    text = str(caught.value)
    assert caught.value.exit_code == 3
    for words in ("energy has drifted by", "Try: a smaller physics.C", str(run.checkpoint_path(0))):
        assert words in text
    offender = re.search(r"particle (\d+) has most energy", text)[1]
    assert checkpoints.read(run.offenders).particles.id[0] == int(offender)
    assert f"{run.offenders}" in text
    assert len(text.splitlines()) <= 24  # one screen
    assert f"sph restart {run.checkpoint_path(0)} --set" in text
    summary = json.loads(run.summary.read_text())
    assert (summary["status"], summary["errors"]) == ("failed", None)
    assert f"particle {offender}" in summary["reason"]
    assert len(rows(run)) == 1
    assert [str(warning.message) for warning in recwarn] == []
    with pytest.raises(FileError, match=r"it cannot be restarted\.\nTry: the last valid"):
        go_on(run.offenders, into=tmp_path / "part")
    go_on(run.checkpoint_path(0), "physics.max_energy_drift=0.02")
    assert json.loads(run.summary.read_text())["status"] == "done"
    assert not run.offenders.exists()
    assert numbers(run) == [f"checkpoint_{k:06d}.h5" for k in range(3)]


def test_numerical_failure_on_full_disk_is_reported(tmp_path, monkeypatch):
    """Exit code 3 and what broke, although neither history nor summary can be written any more."""
    run = RunDirectory.create(tmp_path / "run")
    flush, checkpoints_written = History.flush, []

    def full_after_the_first_checkpoint(history):
        if checkpoints_written:
            raise FileError("cannot write history.csv: No space left on device.\nTry: elsewhere.")
        checkpoints_written.append(1)
        flush(history)

    monkeypatch.setattr(History, "flush", full_after_the_first_checkpoint)
    with pytest.raises(NumericalError, match="total energy has drifted") as caught:
        runner.run(configuration.from_text(STRONG), run, Watch())
    assert caught.value.exit_code == 3
    assert checkpoints.read(run.offenders).particles.id[0] == caught.value.particle
    assert f"sph restart {run.checkpoint_path(0)} --set" in str(caught.value)
    last = str(caught.value).splitlines()[-1]
    assert last.endswith(
        "could not be recorded: cannot write history.csv: No space left on device."
    )


def test_first_step_of_restart_follows_changed_settings(tube, tmp_path):
    step = float(rows(tube)[-1]["dt"])
    held = 1 / (16 + np.sqrt(4 + 16**2))  # by alpha = 16, of 0.15
    for changed, expected in [
        ("physics.C=0.075", step / 2), ("physics.alpha=2.0", step),
        ("physics.alpha=16.0", step * held / 0.15),
    ]:  # fmt: skip
        run = copy(tube, tmp_path / changed)
        go_on(run.path, "time.end=0.3", changed)
        first, then = rows(run)[-1 - steps_after(run, 0.2) :][:2]
        assert float(first["t"]) == 0.2
        # the difference of two times near 0.2 is good to 3e-17
        assert float(then["t"]) - 0.2 == pytest.approx(expected, abs=1e-16)


def test_energy_limit_applies_from_first_step_of_restart(tmp_path):
    free = STRONG.replace("max_energy_drift = 1e-15", "energy_limit = false")
    run = start(free.replace("end = 0.012", "end = 0.0005"), tmp_path / "run")
    last = state(run.checkpoints()[-1])
    allowed = 0.15 * np.min(last["internal_energy"] / np.abs(last["energy_rate"]))
    assert allowed < 0.9 * last["next_step"]  # else this shows nothing
    go_on(run.path, "time.end=0.012", "physics.energy_limit=true")
    first, then = (float(row["t"]) for row in rows(run)[-1 - steps_after(run, 0.0005) :][:2])
    assert then - first == pytest.approx(allowed, rel=1e-9)


def test_changed_limits_apply_to_individual_steps_of_restart(tmp_path):
    free = EACH.replace("[physics]\n", "[physics]\nenergy_limit = false\n")
    run = start(free.replace("end = 0.032", "end = 0.008"), tmp_path / "run")
    last = checkpoints.read(run.latest())
    before, p = last.particles.time_step.copy(), last.particles
    p.energy_rate *= 10.0
    allowed = 0.015 * p.internal_energy / np.abs(p.energy_rate)
    assert (allowed < 0.5 * before).any()  # else this shows nothing
    changed = last.config.override(["physics.C=0.015", "physics.energy_limit=true"])
    assert restarting._coming_step(changed, last) == pytest.approx(0.5 * last.next_step)
    np.testing.assert_allclose(p.time_step, np.minimum(0.5 * before, allowed))


def test_energy_limit_of_restart_ignores_gas_without_energy(tmp_path):
    """Cooling may take u to 0 by rounding. Such a particle sets no step, here as in any step."""
    run = start(TUBE.replace("end = 0.2", "end = 0.05") + "[physics]\nenergy_limit = false\n",
                tmp_path / "run")  # fmt: skip
    last = checkpoints.read(run.latest())
    last.particles.internal_energy[30] = 0.0
    checkpoints.write(run.latest(), last)
    limited = last.config.override(["physics.energy_limit=true"])
    p, warm = last.particles, last.particles.internal_energy > 0.0
    allowed = 0.15 * np.min(p.internal_energy[warm] / np.abs(p.energy_rate[warm]))
    assert restarting._coming_step(limited, last) == pytest.approx(min(last.next_step, allowed))


@pytest.mark.slow
def test_failure_of_first_evaluation_writes_offender_and_needs_no_force(tmp_path):
    few = TUBE.replace("mirror", "periodic").replace("n = 60", "n = 18")
    few += "[physics]\neta = 5e4\n"
    run = RunDirectory.create(tmp_path / "run")
    with pytest.raises(NumericalError, match=r"particle .*support.*\nTry: ") as caught:
        runner.run(configuration.from_text(few), run, Watch())
    assert "last valid checkpoint" not in str(caught.value)
    left = checkpoints.read(run.offenders)
    assert left.particles.id[0] == caught.value.particle
    assert left.config.problem == configuration.from_text(few).problem
    with pytest.raises(FileError, match="has no checkpoint"):
        go_on(run.path)
    # there was no run: nothing that would have to be replaced by force
    start(TUBE + "\n[physics]\nC = 0.3\n", tmp_path / "run")
    assert not run.offenders.exists()


def test_failure_at_start_writes_offending_particle(tmp_path):
    run = RunDirectory.create(tmp_path / "run")
    huge = TUBE.replace("n = 60", "n = 60\nright = { density = 0.125, pressure = 1e150 }")
    with pytest.raises(NumericalError, match="are not known yet") as caught:
        runner.run(configuration.from_text(huge), run, Watch())
    assert checkpoints.read(run.offenders).particles.id.tolist() == [caught.value.particle]


@pytest.mark.slow
def test_directory_of_active_run_is_refused(tmp_path, tube):
    run, said = RunDirectory(tmp_path / "run"), []

    def others(_):
        before = files(run.path)
        for again in (
            lambda: start(TUBE, run.path),
            lambda: RunDirectory.create(run.path, force=True),
            lambda: runner.run(configuration.from_text(TUBE), run, Watch()),
            lambda: go_on(run.path, "physics.C=0.01"),
        ):
            with pytest.raises(FileError, match=r"in use by another run of sph\.\nTry: ") as caught:
                again()
            said.append(str(caught.value))
        assert files(run.path) == before

    start(TUBE, run.path, Watch(at_step=others))
    assert len(said) >= 4 * 10  # after each of the calls that take one or more steps
    assert differences(run.latest(), tube.latest()) == []
    go_on(run.path, "time.end=0.21")  # free again


# --- the summary ------------------------------------------------------------------------------


def test_summary_matches_run(uninterrupted):
    run, config = uninterrupted.run, configuration.from_text(uninterrupted.text)
    summary = json.loads(run.summary.read_text())
    assert summary["status"] == "done"
    assert summary["problem"] == config.problem.name
    assert summary["dimension"] == config.problem.dimension
    assert summary["time"] == config.time.end
    assert summary["steps"] == len(rows(run)) - 1
    kept, cost = summary["conservation"], summary["cost"]
    names = ("kinetic_energy_without_bulk", "internal_energy")
    energy = np.array([sum(float(row[name]) for name in names) for row in rows(run)])
    drift = energy / energy[0] - 1.0  # rounds at 1e-16, (E - E_0)/E_0 does not
    assert kept["energy_drift"] == pytest.approx(drift[-1], abs=3e-16)
    assert kept["energy_drift_max"] == pytest.approx(np.abs(drift).max(), abs=3e-16)
    session = cost["session"]
    assert session["steps"] == summary["steps"]
    updates = [float(row["updates"]) for row in rows(run) if "updates" in row]
    expected = sum(updates) if updates else summary["steps"] * summary["particles"]
    assert session["updates"] == summary["cost"]["updates"] == expected
    assert session["peak_memory_bytes"] > 50e6  # Python with NumPy alone takes more
    assert any(config.physics.scheme in part for part in summary["compiled_in"])
    switched = not isinstance(config.physics.alpha, float)
    assert any("alpha" in part for part in summary["compiled_in"]) == switched
    assert any("alpha" in part.split(":")[0] for part in summary["left_out"]) != switched


def test_phase_seconds_add_up(uninterrupted):
    session = json.loads(uninterrupted.run.summary.read_text())["cost"]["session"]
    phases = session["phases_cpu_seconds"]
    assert {"order", "lists", "density", "rates", "output", "predict, correct"} <= set(phases)
    assert phases.pop(STARTING) >= 0  # which CPU seconds leave out
    computing = session["cpu_seconds"]
    # outside of phases: the rows of the history, loading of compiled code; a rounding for each
    assert sum(phases.values()) <= computing + 0.01
    assert sum(phases.values()) >= 0.7 * computing - 0.1
    assert all(seconds >= 0 for seconds in phases.values())


def test_summary_with_exact_solution_has_errors(tube):
    errors = json.loads(tube.summary.read_text())["errors"]
    assert errors["region"] == "the whole domain"
    assert set(errors["fields"]) == {"density", "velocity", "pressure", "internal_energy"}
    for norms in errors["fields"].values():
        assert 0 < norms["L1"] <= norms["L2"] <= norms["Linf"]
    last = checkpoints.read(tube.checkpoint_path(4))
    exact = last.config.problem.exact(
        last.config.physics.eos_model(), last.time, last.particles.position
    )
    difference = np.abs(last.particles.density - exact["density"])
    volume = last.particles.mass / last.particles.density
    found = errors["fields"]["density"]
    # sums of 60 numbers in another order
    assert found["L1"] == pytest.approx(np.average(difference, weights=volume), rel=1e-12)
    assert found["Linf"] == difference.max()


def test_summary_without_exact_solution_says_so(uninterrupted):
    found = json.loads(uninterrupted.run.summary.read_text())
    none = found["problem"] == "kelvin_helmholtz"
    assert (found["errors"] is None) == none
    assert found["errors_left_out"] == ("this problem has no exact solution" if none else None)
    words = "Error: left out, because this problem has no exact solution."
    assert (words in in_words(found)) == none


def test_summary_after_waves_meet_walls_has_no_errors(tube, tmp_path):
    longer = start(TUBE.replace("end = 0.2", "end = 0.3"), tmp_path / "longer")
    again = go_on(copy(tube, tmp_path / "again").path, "time.end=0.3")
    for run in (longer, again):
        found = json.loads(run.summary.read_text())
        # Sod's shock, at 1.75216, reaches x = 0.5
        assert found["errors_left_out"] == (
            "the exact solution ends at t = 0.2854, when the wave from the diaphragm reaches the "
            "end at x = 0.5"
        )
        assert found["errors"] is None
        assert not any(name.endswith("error") for name in found["report"])
        assert f"Error: left out, because {found['errors_left_out']}." in in_words(found)
    before = json.loads(tube.summary.read_text())
    assert before["errors_left_out"] is None
    assert "plateau_left_density_error" in before["report"]


def test_summary_has_errors_and_field_norms(tube):
    found = json.loads(tube.summary.read_text())
    density = found["errors"]["fields"]["density"]
    share = density["L1"] / density["relative_L1"]  # the mean density by volume
    assert 0.5 < share < 0.6  # 0.5625 of all
    assert f"density {density['L1']:.3g} ({100 * density['relative_L1']:.2g} %)" in in_words(found)


def test_summary_has_nearest_distance(tube):
    found = json.loads(tube.summary.read_text())["nearest"]
    last = checkpoints.read(tube.checkpoint_path(4))
    assert last.config.problem.boundaries == ("mirror",)
    (low, high), p = last.config.problem.box[0], last.particles
    order = np.argsort(p.position[0])
    x = p.position[0, order]
    gaps = np.diff([2 * low - x[0], *x, 2 * high - x[-1]])
    nearest = np.minimum(gaps[1:], gaps[:-1]) * (p.density / p.mass)[order]
    assert found["median"] == pytest.approx(np.median(nearest), rel=1e-10)
    assert found["smallest"] == pytest.approx(nearest.min(), rel=1e-10)


def test_summary_momentum_only_without_walls(uninterrupted):
    found = json.loads(uninterrupted.run.summary.read_text())
    change = found["conservation"]["momentum_change"]
    walls = configuration.from_text(uninterrupted.text).problem.boundaries
    assert (change is None) == ("mirror" in walls)
    # pair forces cancel exactly but for rounding: 1e-16 of the sum of m (|v| + c) a step, with room
    assert change is None or change < 1e-12
    assert ("momentum is not conserved" in in_words(found)) == (change is None)
