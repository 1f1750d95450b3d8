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
def test_images_of_point_along_one_axis(boundary, expected):
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


def test_periodic_axis_wraps_any_distance_and_keeps_velocity():
    position = np.array([[-1.0, 0.25, 1.0, 1.5, -1.5, 6.25, -7.25]])
    velocity = np.ones((1, 7))
    Domain(BOX[:1], ("periodic",)).bring_inside(position, [velocity])
    np.testing.assert_array_equal(position[0], [-1, 0.25, -1, -0.5, 0.5, 0.25, 0.75])  # exact
    assert np.all(velocity == 1)


def test_periodic_axis_excludes_upper_face():
    position = np.array([[-1e-20, 0.5]])  # the first plus the length rounds to the face
    Domain(BOX[1:2], ("periodic",)).bring_inside(position, [])
    np.testing.assert_array_equal(position, [[0, 0]])


def test_mirror_reflects_particles():
    position = np.array([[-1.25, -1.0, 0.0, 1.0, 1.5], [0.1, 0.2, 0.3, 0.4, 0.5]])
    velocities = [np.full((2, 5), 2.0), np.full((2, 5), 3.0)]
    Domain(BOX[:2], ("mirror", "open")).bring_inside(position, velocities)
    np.testing.assert_array_equal(position[0], [-0.75, -1, 0, 1, 0.5])  # exact in binary
    np.testing.assert_array_equal(position[1], [0.1, 0.2, 0.3, 0.4, 0.5])
    for velocity, speed in zip(velocities, (2, 3), strict=True):
        np.testing.assert_array_equal(velocity[0], np.array([-1, 1, 1, 1, -1]) * speed)
        np.testing.assert_array_equal(velocity[1], speed)


def test_mirror_negates_mixed_components_of_tensor():
    """A tensor is turned on both sides: T'_ab = s_a s_b T_ab, with s = -1 along the walls met."""
    random = np.random.default_rng(4)
    position = np.array([[0.5, 1.5, 0.5, -1.5], [0.2, 0.2, 0.6, -0.1], [3.0, 3.0, 3.0, 6.0]])
    signs = np.array([[1, -1, 1, -1], [1, 1, -1, -1], [1, 1, 1, 1]])
    vector, tensor = random.normal(size=(3, 4)), random.normal(size=(3, 3, 4))
    expected = signs * vector, signs[:, None] * signs * tensor
    Domain(BOX, ("mirror", "mirror", "open")).bring_inside(position, [vector, tensor])
    np.testing.assert_array_equal(vector, expected[0])
    np.testing.assert_array_equal(tensor, expected[1])
    # of a particle past a wall along x, T_xx and T_yy stay, T_xy and T_yx turn
    line = np.array([[2.5]])
    alone = np.array([[[7.0]]])
    Domain(BOX[:1], ("mirror",)).bring_inside(line, [alone])
    assert alone[0, 0, 0] == 7.0
    # periodic axes leave it
    position, before = np.array([[1.5], [0.2]]), random.normal(size=(2, 2, 1))
    wrapped = before.copy()
    Domain(BOX[:2], ("periodic", "mirror")).bring_inside(position, [wrapped])
    assert position[0, 0] == -0.5
    np.testing.assert_array_equal(wrapped, before)


def test_open_axis_keeps_particles_outside():
    position = np.array([[-9.0, 9.0]])
    Domain(BOX[:1], ("open",)).bring_inside(position, [])
    np.testing.assert_array_equal(position, [[-9.0, 9.0]])


def test_supports_up_to_a_thousand_images_are_accepted():
    domain = Domain(BOX, ("periodic", "mirror", "open"))  # 2, 0.5 and 3 wide
    domain.check_reach(14.0, 10, 7)  # 15 x 57 images
    words = r"particle 7 needs a support radius of 16, 32 times the shortest side"
    with pytest.raises(NumericalError, match=words):
        domain.check_reach(16.0, 10, 7)  # 17 x 65
    Domain(BOX, ("open",) * 3).check_reach(1e9, 10, 7)


def test_supports_wider_than_box_limited_by_neighbour_count():
    domain = Domain(BOX[:1], ("periodic",))  # 2 wide
    domain.check_reach(2.0, 1_000_000, 7)  # no wider: as many as there are
    domain.check_reach(2.5, 40_000, 7)  # 2.5 copies of the box in reach
    with pytest.raises(NumericalError, match="or 100000 neighbours"):
        domain.check_reach(2.5, 40_001, 7)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("reach", [0.3, 2.0, 2.1, 5.9, 6.1])
def test_images_are_all_within_reach_of_box(boundary, reach):
    """Against copies made one after another, by moving or by reflecting at the next wall."""
    domain = Domain(BOX[:1], (boundary,))
    (low, high), x = BOX[0], np.array([-0.9, 0.2, 0.7])
    sign, offset = domain.images_within(reach)
    found = {(s, o) for s, o in zip(sign[:, 0], offset[:, 0], strict=True)}
    assert len(found) == len(sign)
    expected, right, left = {(1.0, 0.0)}, (1.0, 0.0), (1.0, 0.0)
    for k in range(max(1, int(np.ceil(reach / (high - low))))):
        if boundary == "periodic":
            right, left = (1.0, right[1] + 2.0), (1.0, left[1] - 2.0)
        else:  # x -> 2 wall - x, after what was done before
            right = (-right[0], 2.0 * (high + 2.0 * k) - right[1])
            left = (-left[0], 2.0 * (low - 2.0 * k) - left[1])
        expected |= {right, left}
    assert found == expected
    places = np.sort((sign * x + offset).ravel())
    assert np.all(np.diff(places) > 0.0)  # no copy twice


def test_mirrors_reflect_fast_particle_repeatedly():
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
