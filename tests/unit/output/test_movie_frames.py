"""Frames: what they hold and how precisely, whole files only, and the directory they are in."""

import numpy as np
import pytest

from sph import config
from sph.errors import FileError
from sph.output import frames
from sph.output.files import Damaged
from sph.output.frames import Frames
from sph.scene import Scene
from sph.state import State

MADE = config.from_text('[problem]\nname = "sound_wave"\nn = 50\n')


def particles(scale=1.0):
    number = np.random.default_rng(3)
    arrays = {field.name: number.uniform(1.0, 2.0, field.shape(1, 50)) for field in
              Scene(MADE).fields if not field.integer}  # fmt: skip
    arrays["mass"] *= scale
    return State(Scene(MADE).fields, arrays)


def round_trip(tmp_path, state):
    frames.write(tmp_path / "a.h5", state, 3.0 * state.density, 0.25, 7)
    return frames.read(tmp_path / "a.h5", MADE)


def test_frame_reads_back_in_single_precision(tmp_path):
    state = particles()
    found = round_trip(tmp_path, state)
    assert (found.time, found.step) == (0.25, 7)
    for name in ("position", "velocity", "mass", "density", "internal_energy", "support"):
        # float32 rounds by at most 2^-24 of a number
        np.testing.assert_allclose(getattr(found.particles, name), getattr(state, name), 2.0**-24)
        assert getattr(found.particles, name).dtype == np.float64
    np.testing.assert_allclose(found.pressure, 3.0 * state.density, 2.0**-24)
    assert found.particles.get("acceleration") is None
    # 7 numbers of 4 bytes a particle and, at most, 5 kB of structure
    assert (tmp_path / "a.h5").stat().st_size < 7 * 4 * 50 + 5000


def test_small_wave_and_distant_box_keep_their_digits(tmp_path):
    state = particles()
    wave = np.sin(np.linspace(0.0, 6.0, 50))
    state.density[:] = 1.0 + 1e-6 * wave
    state.position[:] += 1e5
    found = round_trip(tmp_path, state)
    # of the range, not of the numbers: single precision would leave errors of 3e-2 and 4e-3
    assert np.abs(found.particles.density - state.density).max() < 1e-6 * 2.0**-24 + 2e-16
    assert np.abs(found.particles.position - state.position).max() < 2.0**-24 + 1e-11


def test_mass_beyond_single_precision_is_kept(tmp_path):
    state = particles(scale=1e42)
    assert (round_trip(tmp_path, state).particles.mass == state.mass).all()


@pytest.mark.parametrize("keep", [0, 100, -1])
def test_cut_frame_is_damaged(tmp_path, keep):
    round_trip(tmp_path, particles())
    content = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "a.h5").write_bytes(content[:keep])
    with pytest.raises(Damaged, match="is not a whole frame"):
        frames.read(tmp_path / "a.h5", MADE)


def test_missing_frame_is_named(tmp_path):
    with pytest.raises(FileError, match=r"b\.h5: frame not found"):
        frames.read(tmp_path / "b.h5", MADE)


def test_directory_lists_and_drops_by_step(tmp_path):
    there = Frames(tmp_path / "frames")
    assert there.paths() == []
    there.drop_after(3)  # nothing to do
    with there.held():
        for step in (12, 3, 100_000_000):
            there.path_of(step).touch()
        (there.path / ".frame_00000005.h5.ab.partial").touch()
    (there.path / "notes.txt").touch()
    assert [path.name for path in there.paths()] == [
        "frame_00000003.h5", "frame_00000012.h5", "frame_100000000.h5",
    ]  # fmt: skip
    assert there.up_to(12) == there.paths()[:2]
    there.drop_after(3)
    names = sorted(path.name for path in there.path.iterdir())
    assert names == ["frame_00000003.h5", "notes.txt"]


def test_link_in_place_of_directory_is_refused(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "frames").symlink_to("elsewhere")
    with pytest.raises(FileError, match="is a symbolic link"), Frames(tmp_path / "frames").held():
        pass
