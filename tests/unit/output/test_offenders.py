"""What a run that failed leaves: the particle and those within a support of it or it of theirs."""

import numpy as np
import pytest

from sph.output import checkpoint as checkpoints
from sph.output import offenders


@pytest.fixture
def failed(make_state):
    """failed(x, supports): a 1-D periodic box [-0.5, 0.5] with particles of IDs 1, 2, … there."""

    def state_of(places, supports):
        state = make_state(dimension=1, number=len(places))
        state.particles.position[0] = places
        state.particles.support[:] = supports
        state.particles.id[:] = np.arange(1, len(places) + 1)
        return state

    return state_of


def test_neighbours_in_either_support_nearest_first_across_faces(failed, tmp_path):
    state = failed([0.45, -0.2, 0.41, -0.48, 0.1], [0.08, 0.4, 0.01, 0.01, 0.2])
    path = tmp_path / "offenders.h5"
    words = offenders.leave(path, state, 1)
    left = checkpoints.read(path)
    # 0.04 away; 0.07 through the face; 0.35 through it, beyond its own support but within the other
    indices = [0, 2, 3, 1]
    assert left.particles.id.tolist() == [1, 3, 4, 2]
    for name, array in left.particles.arrays().items():
        np.testing.assert_array_equal(array, state.particles.arrays()[name][..., indices])
    np.testing.assert_array_equal(left.list_position, state.list_position[:, indices])
    np.testing.assert_array_equal(left.list_support, state.list_support[indices])
    _, *lines, last, where = words.splitlines()
    assert [line.split()[:2] for line in lines] == [
        ["1", "0"], ["3", "0.04"], ["4", "0.07"], ["2", "0.35"],
    ]  # fmt: skip
    assert last == "(no further neighbours)"
    assert str(path) in where


def test_many_neighbours_are_counted_not_listed(failed, tmp_path):
    state = failed(np.linspace(-0.1, 0.1, 12), 0.3)
    words = offenders.leave(tmp_path / "offenders.h5", state, 4).splitlines()
    assert len(words) == 1 + offenders.SHOWN + 2
    assert words[-2] == f"... and {12 - offenders.SHOWN} more neighbours."


def test_particle_with_nan_position_listed_first_and_alone(failed, tmp_path):
    state = failed([0.1, np.nan, 0.2], [0.3, np.nan, 0.3])
    offenders.leave(tmp_path / "offenders.h5", state, 2)
    assert checkpoints.read(tmp_path / "offenders.h5").particles.id.tolist() == [2]


def test_coincident_neighbour_listed_after_particle(failed, tmp_path):
    offenders.leave(tmp_path / "offenders.h5", failed([0.1, 0.1], 0.2), 2)
    assert checkpoints.read(tmp_path / "offenders.h5").particles.id.tolist() == [2, 1]


def test_fault_without_particle_writes_no_offenders(failed, tmp_path):
    assert offenders.leave(tmp_path / "offenders.h5", failed([0.1], 0.2), 0) == ""
    assert not (tmp_path / "offenders.h5").exists()


def test_unwritable_offenders_keep_original_error(failed, tmp_path):
    words = offenders.leave(tmp_path / "none" / "offenders.h5", failed([0.1], 0.2), 1)
    assert "could not be written: " in words
