"""scripts/check_readers*.py: what other programs see of checkpoints and exports, and pictures."""

import sys
from pathlib import Path
from types import SimpleNamespace

import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest

from sph.output import checkpoint as checkpoints

SCRIPTS = Path(__file__).parents[2] / "scripts"
PROGRAMS = ("yt", "pynbody", "swiftsimio", "ParaView", "sarracen")


@pytest.fixture
def scripts(monkeypatch):
    """The modules of the scripts, and `own`: a reader of checkpoints by h5py, in cgs."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import check_readers
    import check_readers_open
    import check_readers_states

    own = check_readers_open.Reader("own", "h5py", by_h5py, True)
    yield SimpleNamespace(
        check=check_readers, open=check_readers_open, states=check_readers_states, own=own
    )
    for name in [name for name in sys.modules if name.startswith("check_readers")]:
        del sys.modules[name]


def by_h5py(files) -> dict:
    """What h5py sees, with the conversion factors to cgs of the file."""
    import check_readers_open

    with h5py.File(files.checkpoint) as file:
        gas = file["PartType0"]
        names = check_readers_open.public_fields(files.state)
        factor = "Conversion factor to CGS (not including cosmological corrections)"
        seen = {
            name: gas[one.name][()] * gas[one.name].attrs[factor] for name, one in names.items()
        }
        place, units = gas["Coordinates"], file["Units"].attrs
        return seen | {
            "position": place[()] * place.attrs[factor],
            "box": file["Header"].attrs["BoxSize"] * place.attrs[factor],
            "time": file["Header"].attrs["Time"][0] * units["Unit time in cgs (U_t)"][0],
        }


def written(scripts, directory, state):
    return scripts.open.written([scripts.states.earlier(state), state], directory)


@pytest.mark.parametrize("name", ["1-D", "2-D", "units", "solid"])
def test_file_and_comparison_agree_for_made_up_state(scripts, tmp_path, name):
    state = scripts.states.made_up()[name]
    files = written(scripts, tmp_path, state)
    right = scripts.states.expected(state)
    assert scripts.check.differences(scripts.own, files, right) == []
    # what is expected of a run is what is expected of a made-up state
    of_run = scripts.check.expected(state)
    assert of_run.keys() == right.keys()
    for field, values in right.items():
        np.testing.assert_allclose(of_run[field], values, rtol=1e-14, atol=1e-14, err_msg=field)


CHANGES = {
    "density": lambda seen: seen["density"].__setitem__(3, seen["density"][3] * (1 + 1e-12)),
    "velocity": lambda seen: seen["velocity"].__setitem__((3, 1), 0.0),
    "position": lambda seen: seen["position"].__setitem__((3, 1), seen["position"][3, 1] + 1e-13),
    "time": lambda seen: seen.update(time=0.5),
    "box": lambda seen: seen.update(box=0.5 * seen["box"]),
    "adiabatic index": lambda seen: seen.update({"adiabatic index": 1.5}),
    "slice": lambda seen: seen.update(slice=np.zeros((64, 64))),
}


@pytest.mark.parametrize("name", CHANGES)
def test_comparison_names_what_is_seen_wrongly(scripts, tmp_path, name):
    state = scripts.states.made_up_gas(2)
    files = written(scripts, tmp_path, state)

    def see(files):
        seen = by_h5py(files)
        CHANGES[name](seen)
        return seen

    found = scripts.check.differences(
        scripts.own._replace(see=see), files, scripts.states.expected(state), True
    )
    assert found == [name]


@pytest.fixture
def line(scripts, tmp_path):
    """A checkpoint in 1-D."""
    path = tmp_path / "line.h5"
    checkpoints.write(path, scripts.states.made_up_gas(1))
    return path


def test_exit_codes_say_what_is_skipped_and_wrong(scripts, line, monkeypatch, capsys):
    missing = scripts.own._replace(name="other", package="no_such_package")

    def exits(*readers, arguments=()):
        monkeypatch.setattr(scripts.check, "READERS", readers)
        return scripts.check.main([str(line), *arguments])

    assert exits(scripts.own) == 0
    assert exits(scripts.own, missing) == scripts.check.SKIPPED
    assert "other       skipped: no_such_package is not installed" in capsys.readouterr().out
    assert exits(scripts.own, missing, arguments=["--require"]) == 1
    assert "required, but not installed: other" in capsys.readouterr().err
    assert exits(scripts.own, missing, arguments=["--require", "own"]) == scripts.check.SKIPPED
    assert exits(scripts.own, arguments=["--require"]) == 0
    blind = scripts.own._replace(see=lambda files: by_h5py(files) | {"time": 0.0})
    assert exits(scripts.own, blind, missing) == 1
    assert "WRONG: time" in capsys.readouterr().out
    broken = scripts.own._replace(see=lambda files: {}["id"])
    assert exits(broken) == 1
    assert "cannot open it" in capsys.readouterr().out


def test_pictures_of_line_show_particles_of_each_program(scripts, line, tmp_path, monkeypatch):
    monkeypatch.setattr(scripts.check, "READERS", (scripts.own,))
    target = tmp_path / "pictures"
    assert scripts.check.main([str(line), "--pictures", str(target)]) == 0
    assert {path.name for path in target.iterdir()} == {"own.png", "readers.png"}
    for path in target.iterdir():
        image = plt.imread(path)[..., :3]
        assert 0.001 < (image < 0.5).any(axis=2).mean() < 0.5, path.name  # ink on white


def test_pictures_in_two_dimensions_include_that_of_sph(scripts, tmp_path):
    import check_readers_pictures

    files = written(scripts, tmp_path, scripts.states.made_up_gas(2))
    found = [*check_readers_pictures.draw(files, [], tmp_path / "pictures")]
    assert [path.name for path in found] == ["sph.png", "readers.png"]
    image = plt.imread(found[1])[..., :3]
    assert np.unique(image.reshape(-1, 3), axis=0).shape[0] > 50  # colours of a map


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_installed_program_sees_made_up_states_and_draws(scripts, tmp_path, name):
    (reader,) = (one for one in scripts.check.READERS if one.name == name)
    if not scripts.check.is_installed(reader):
        pytest.skip(f"{reader.package} is not installed")
    cases = scripts.check.made_up_cases(tmp_path)
    assert scripts.check.check(cases, [reader]) == {name: "as written"}
    import check_readers_pictures

    for case in ("2-D", "3-D"):
        own, together = tmp_path / case / f"{name.lower()}.png", tmp_path / case / "readers.png"
        drawn = [*check_readers_pictures.draw(cases[case][0], [reader], tmp_path / case)]
        assert {own, together} <= {*drawn}
        image = plt.imread(own)[..., :3]
        assert np.unique(image.reshape(-1, 3), axis=0).shape[0] > 50  # colours of a map
