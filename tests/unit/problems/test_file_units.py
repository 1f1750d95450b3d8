"""Units of files with initial states: which are read, and what becomes of the numbers."""

import ic_files
import numpy as np
import pytest

from sph import config, preview, runner
from sph.errors import ConfigError, FileError
from sph.output import checkpoint as checkpoints
from sph.output.run_directory import RunDirectory
from sph.problems import files
from sph.progress import Lines

# Ratios to the units of RUN that are powers of 2, so that products with them are exact.
SWIFT = {
    "Unit length in cgs (U_L)": [6.0e18],
    "Unit mass in cgs (U_M)": [32.0e33],
    "Unit time in cgs (U_t)": [12.0e13],
}
RATIOS = (2.0, 16.0, 4.0)
RUN = "[units]\nlength = 3.0e18\nmass = 2.0e33\ntime = 3.0e13\n"
# (position, velocity, mass, internal energy, density) of the run over those of the file, by
# dimension: the run's layer is twice as deep along unused axes if its unit of length is
FACTORS = {
    1: (2.0, 0.5, 16.0 / 4.0, 0.25, 2.0),
    2: (2.0, 0.5, 16.0 / 2.0, 0.25, 2.0),
    3: (2.0, 0.5, 16.0, 0.25, 2.0),
}
ORDER = ("position", "velocity", "mass", "internal_energy")


def made(path, units="", keys=""):
    return config.from_text(f'[problem]\nname = "file"\npath = "{path}"\n{keys}{units}')


def initial(found):
    return found.problem.initial(found.physics.eos_model())


def written(path, state, *drop, header=None, **groups):
    datasets, attributes = ic_files.tables(state, **(header or {}))
    datasets["Density"] = state["mass"]
    return ic_files.write_hdf5(path, datasets, attributes, **groups)


def check(found, state, factors):
    """Check a configuration's initial state: the file's, times the factors, without rounding."""
    start = initial(found)
    got = [getattr(start, name) for name in ORDER] + [start.others["density"]]
    expected = [state[name].T for name in ORDER] + [state["mass"]]
    for one, other, factor in zip(got, expected, factors, strict=True):
        np.testing.assert_array_equal(one, factor * other)
    box = [[0.0, factors[0]]] * len(start.position)
    assert found.problem.domain == box


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_stated_units_are_converted_to_those_of_the_run(tmp_path, dimension):
    state = ic_files.particles(dimension)
    found = made(written(tmp_path / "ic.hdf5", state, Units=SWIFT), RUN)
    check(found, state, FACTORS[dimension])
    assert found.problem.file_units == [6.0e18, 32.0e33, 12.0e13]
    files._last.clear()  # as in another process
    again = config.from_text(found.to_toml())
    check(again, state, FACTORS[dimension])
    assert again.problem.remarks() == found.problem.remarks()


def test_position_outside_the_box_is_told_in_both_units(messages, tmp_path):
    state = ic_files.particles()
    state["position"][3, 1] = 1.5  # of a box of 1 in the file, 2 in the run
    path = written(tmp_path / "ic.hdf5", state, Units=SWIFT)
    with messages.raised(FileError, " 3 (1.5 in the file)", "0 to 2 in the unit", "3e+18 cm"):
        made(path, RUN)


@pytest.mark.parametrize("group", ["Header", "Parameters"])
@pytest.mark.parametrize(
    "names",
    [
        ("UnitLength_in_cm", "UnitMass_in_g", "UnitVelocity_in_cm_per_s"),
        ("UnitLength_In_CGS", "UnitMass_In_CGS", "UnitVelocity_In_CGS"),
    ],
)
def test_units_in_names_of_gadget_are_read(tmp_path, group, names):
    state = ic_files.particles()
    stated = dict(zip(names, (6.0e18, 32.0e33, 5.0e4), strict=True)) | {"HubbleParam": 1.0}
    path = tmp_path / "ic.hdf5"
    if group == "Header":
        found = made(written(path, state, header=stated), RUN)
    else:
        found = made(written(path, state, Parameters=stated), RUN)
    check(found, state, FACTORS[2])  # 6e18 cm / 5e4 cm/s = 12e13 s


def test_units_given_in_the_configuration_replace_those_of_the_file(tmp_path):
    state = ic_files.particles()
    keys = "file_units = [6.0e18, 32.0e33, 12.0e13]\n"
    for groups in ({}, {"Units": {name: [1.0] for name in SWIFT}}):
        check(made(written(tmp_path / "ic.hdf5", state, **groups), RUN, keys), state, FACTORS[2])
    np.savez(tmp_path / "ic.npz", **state, density=state["mass"], domain=[0.0, 1.0])
    check(made(tmp_path / "ic.npz", RUN, keys), state, FACTORS[2])


def test_without_units_on_one_side_numbers_are_as_they_are(messages, tmp_path):
    state, same = ic_files.particles(), (1.0,) * 5
    stating = written(tmp_path / "stating.hdf5", state, Units=SWIFT)
    silent = written(tmp_path / "silent.hdf5", state)
    in_units_of_file = RUN.replace("3.0e18", "6.0e18").replace("2.0e33", "3.2e34")
    in_units_of_file = in_units_of_file.replace("3.0e13", "1.2e14")
    for path, units, words in (
        (stating, "", "no [units]"), (silent, RUN, "states no units"), (silent, "", ""),
        (stating, in_units_of_file, "is in the units of [units]"),
    ):  # fmt: skip
        found = made(path, units)
        check(found, state, same)
        if not words:
            assert found.problem.remarks() == []
            continue
        (text,) = found.problem.remarks()
        assert words in text
        messages.check(text)


def test_configuration_of_an_earlier_version_is_complete_without_the_file(tmp_path):
    """As in its checkpoints, from which a restart begins."""
    path = written(tmp_path / "ic.hdf5", ic_files.particles())
    text = made(path).to_toml()
    assert "file_units = []\n" in text
    path.unlink()
    found = config.from_text(text.replace("file_units = []\n", "") + RUN)
    assert (found.problem.file_units, found.problem.remarks()) == (None, [])


def test_contents_in_units_of_another_configuration_are_not_reused(tmp_path):
    state = ic_files.particles()
    path = written(tmp_path / "ic.hdf5", state, Units=SWIFT)
    first = made(path, RUN)
    second = made(path)
    check(first, state, FACTORS[2])
    check(second, state, (1.0,) * 5)


REFUSED = {
    "incomplete": ({"Units": {"Unit mass in cgs (U_M)": [1.0]}}, "no Unit length in cgs (U_L)"),
    "zero": ({"Units": SWIFT | {"Unit time in cgs (U_t)": [0.0]}}, "Unit time in cgs (U_t)"),
    "per h": ({"Units": SWIFT, "Parameters": {"HubbleParam": 0.7}}, "factors of h"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_units_that_cannot_be_used_are_refused_only_if_needed(messages, tmp_path, case):
    groups, named = REFUSED[case]
    state = ic_files.particles()
    path = written(tmp_path / "ic.hdf5", state, **groups)
    check(made(path), state, (1.0,) * 5)
    with messages.raised(FileError, named, "Try: problem.file_units"):
        made(path, RUN)
    keys = "file_units = [6.0e18, 32.0e33, 12.0e13]\n"
    check(made(path, RUN, keys), state, FACTORS[2])


def test_array_without_rule_of_conversion_is_refused(messages, tmp_path):
    state = ic_files.particles()
    np.savez(tmp_path / "ic.npz", **state, entropy=state["mass"])
    made(tmp_path / "ic.npz", RUN)  # nothing is converted
    with messages.raised(FileError, "it has entropy"):
        made(tmp_path / "ic.npz", RUN, "file_units = [1.0, 1.0, 1.0]\n")


@pytest.mark.parametrize("given", ["[1.0, 2.0]", "[1.0, -2.0, 1.0]", '["pc", "g", "s"]'])
def test_wrong_units_of_file_are_refused(messages, tmp_path, given):
    path = written(tmp_path / "ic.hdf5", ic_files.particles())
    with messages.raised(ConfigError, "line 4: problem.file_units"):
        made(path, RUN, f"file_units = {given}\n")


# --- runs -------------------------------------------------------------------------------------


class Heard(Lines):
    """Progress that keeps what it is told."""

    def __init__(self):
        super().__init__()
        self.notes = []

    def note(self, text):
        self.notes.append(text)


def run(found, directory):
    """Run a configuration; return its last checkpoint, its path, and the notes."""
    target, heard = RunDirectory.create(directory), Heard()
    runner.run(found, target, heard)
    path = target.checkpoints()[-1]
    return checkpoints.read(path), path, heard.notes


def in_cgs(checkpoint):
    """Return fields in cgs, in the order of the IDs."""
    units, particles = checkpoint.config.units, checkpoint.particles
    powers = {
        "position": (1, 0, 0), "velocity": (1, 0, -1), "internal_energy": (2, 0, -2),
        "density": (-3, 1, 0),
    }  # fmt: skip
    found = {
        name: checkpoint.by_id(getattr(particles, name)) * units.factor(*one)
        for name, one in powers.items()
    }
    return found | {"time": checkpoint.time * units.factor(0, 0, 1)}


# The supports of the start are solved to 1e-10 from guesses that differ by rounding, so those of
# two runs agree to 2e-10, and with them everything after a few steps. Measured: 6e-12 of the
# largest value. Ratios of units that are powers of 2 change no digit.
SOLVED = 2e-10
GALACTIC = ('[units]\nlength = "pc"\nmass = "M_sun"\ntime = "Myr"\n', 3.15576e13, SOLVED)
POWERS_OF_2 = (RUN, 3.0e13, 0.0)


def check_two_systems(path, directory, other, unit_of_time, tolerance):
    """Run a file in its own units and in others; return the last checkpoint of its own units.

    Checks that both runs have the same physical result, and the same number of steps.
    """
    end, states = 0.02 * 12.0e13, []
    own = "[units]\nlength = 6.0e18\nmass = 32.0e33\ntime = 12.0e13\n"
    for name, units, one in (("own", own, 12.0e13), ("other", other, unit_of_time)):
        times = f"[time]\nend = {end / one!r}\n[output]\ninterval = {end / one!r}\n"
        last, checkpoint, notes = run(made(path, units + times), directory / name)
        said = "is in the units of [units]" if name == "own" else "are converted from its units"
        assert any(str(path) in note and said in note for note in notes)
        states.append((last, checkpoint))
    (first, checkpoint), (second, _) = states
    assert second.step == first.step >= 3
    fields = in_cgs(second)
    for name, value in in_cgs(first).items():
        size = np.abs(value).max()
        # rtol: the factors to cgs are rounded
        np.testing.assert_allclose(fields[name], value, rtol=1e-15, atol=tolerance * size)
    return checkpoint


@pytest.mark.parametrize(
    ("other", "unit_of_time", "tolerance"),
    [GALACTIC, POWERS_OF_2],
    ids=["galactic", "powers of 2"],
)
def test_runs_in_two_systems_of_units_give_the_same_physical_result(
    tmp_path, other, unit_of_time, tolerance
):
    """From a file in SWIFT's names; then from our own checkpoint, which states its units."""
    state = ic_files.particles(2, 200)
    state["position"] = np.indices((20, 10)).reshape(2, 200).T / [20.0, 10.0] + 0.01
    path = written(tmp_path / "ic.hdf5", state, Units=SWIFT)
    system = other, unit_of_time, tolerance
    checkpoint = check_two_systems(path, tmp_path / "first", *system)
    check_two_systems(checkpoint, tmp_path / "second", *system)


def test_checkpoint_of_run_without_units_states_none(tmp_path):
    keys = "[time]\nend = 0.001\n[output]\ninterval = 0.001\n"
    last, path, _ = run(config.from_text(f'[problem]\nname = "regions"\nn = 256\n{keys}'),
                        tmp_path / "run")  # fmt: skip
    found = made(path, RUN)
    assert found.problem.file_units == []
    np.testing.assert_array_equal(initial(found).mass, last.by_id(last.particles.mass))
    assert found.problem.remarks()[0] in preview.describe(found)
