"""Images of the box and the way back into it."""

import numpy as np
import pytest

from sph.domain import Domain
from sph.errors import NumericalError

BOX = np.array([[-1.0, 1.0], [0.0, 0.5], [2.0, 5.0]])


@pytest.mark.parametrize(
    ("boundary", "expected"),
    [
        ("open", {0.1}),
        ("periodic", {0.1, 2.1, -1.9}),
        ("mirror", {0.1, -2.1, 1.9}),
    ],
)
def test_images_of_a_point_along_one_axis(boundary, expected):
    sign, offset = Domain(BOX[:1], (boundary,)).images
    assert (sign[0, 0], offset[0, 0]) == (1, 0)  # the identity comes first
    found = sign[:, 0] * 0.1 + offset[:, 0]
    # one rounding of numbers of order one
    np.testing.assert_allclose(sorted(found), sorted(expected), atol=1e-15)


def test_images_of_several_axes_combine():
    sign, offset = Domain(BOX, ("periodic", "mirror", "open")).images
    point = np.array([0.1, 0.2, 3.0])
    found = {tuple(np.round(image, 12)) for image in sign * point + offset}
    assert found == {(x, y, 3.0) for x in (0.1, 2.1, -1.9) for y in (0.2, -0.2, 0.8)}
    assert len(Domain(BOX, ("mirror", "periodic", "mirror")).images.sign) == 27


def test_periodic_axis_wraps_however_far_and_leaves_velocity():
    position = np.array([[-1.0, 0.25, 1.0, 1.5, -1.5, 6.25, -7.25]])
    velocity = np.ones((1, 7))
    Domain(BOX[:1], ("periodic",)).bring_inside(position, [velocity])
    np.testing.assert_array_equal(position[0], [-1, 0.25, -1, -0.5, 0.5, 0.25, 0.75])  # exact
    assert np.all(velocity == 1)


def test_periodic_axis_has_no_point_on_its_upper_face():
    position = np.array([[-1e-20, 0.5]])  # the first plus the length rounds to the face
    Domain(BOX[1:2], ("periodic",)).bring_inside(position, [])
    np.testing.assert_array_equal(position, [[0, 0]])


def test_mirror_turns_particles_back():
    position = np.array([[-1.25, -1.0, 0.0, 1.0, 1.5], [0.1, 0.2, 0.3, 0.4, 0.5]])
    velocities = [np.full((2, 5), 2.0), np.full((2, 5), 3.0)]
    Domain(BOX[:2], ("mirror", "open")).bring_inside(position, velocities)
    np.testing.assert_array_equal(position[0], [-0.75, -1, 0, 1, 0.5])  # exact in binary
    np.testing.assert_array_equal(position[1], [0.1, 0.2, 0.3, 0.4, 0.5])
    for velocity, speed in zip(velocities, (2, 3), strict=True):
        np.testing.assert_array_equal(velocity[0], np.array([-1, 1, 1, 1, -1]) * speed)
        np.testing.assert_array_equal(velocity[1], speed)


def test_open_axis_lets_go():
    position = np.array([[-9.0, 9.0]])
    Domain(BOX[:1], ("open",)).bring_inside(position, [])
    np.testing.assert_array_equal(position, [[-9.0, 9.0]])


def test_support_wider_than_a_closed_box_is_refused_with_the_axis():
    domain = Domain(BOX, ("periodic", "mirror", "open"))
    domain.check_reach(0.5, 7)
    with pytest.raises(NumericalError, match=r"particle 7 .*mirror box along y \(0\.5\)"):
        domain.check_reach(0.51, 7)
    Domain(BOX, ("open",) * 3).check_reach(1e9, 7)


def test_mirrors_turn_a_fast_particle_as_often_as_it_meets_them():
    # from 0.25 by -1, then +/- 2 k: walls at -1 and 1, the path repeats after 4
    start, shifts = 0.25, np.array([1.0, 2.0, 3.0, 3.5, -1.5, -3.0, 401.0, -402.5])
    position, velocity = (start + shifts)[None], np.sign(shifts)[None].copy()
    Domain(BOX[:1], ("mirror",)).bring_inside(position, [velocity])
    np.testing.assert_array_equal(position[0], [0.75, -0.25, -0.75, -0.25, -0.75, 0.75, 0.75, 0.25])
    np.testing.assert_array_equal(velocity[0], [-1, -1, 1, 1, 1, 1, -1, 1])


def test_longest_reach_is_the_narrowest_closed_axis():
    assert Domain(BOX, ("periodic", "open", "mirror")).longest_reach == 2.0
    assert Domain(BOX, ("periodic", "mirror", "open")).longest_reach == 0.5
    assert Domain(BOX, ("open",) * 3).longest_reach == np.inf
