"""Composed scenes: which gas is where, how particles are placed, and what is refused."""

import numpy as np
import pytest
from click.testing import CliRunner

from sph import config, kernels
from sph.cli import main
from sph.domain import Domain
from sph.errors import ConfigError
from sph.problems._region import Region
from sph.problems._shapes import DIMENSION
from sph.problems.support import areas, bodies, glass

KERNEL = kernels.make("wendland_c2")
H_OVER_SPACING = kernels.support_ratio(KERNEL, 2)
EVERYWHERE = 'shape = "everywhere"\ndensity = 1.0\npressure = 2.0'
DISC = 'shape = "disc"\ncentre = [0.5, 0.5]\nradius = 0.25\ndensity = 4.0\nvelocity = [1.0, "x"]'


def scene(*tables, keys="", physics=""):
    """Return a configuration with one table for each region, of 400 particles in 2-D."""
    head = f'[problem]\nname = "regions"\n{"" if "n =" in keys else "n = 400"}\n{keys}\n'
    return head + "".join(f"[[problem.region]]\n{one}\n" for one in tables) + physics


def state(*tables, **keys):
    found = config.from_text(scene(*tables, **keys))
    assert config.from_text(found.to_toml()) == found
    return found.problem.initial(found.physics.eos_model())


# --- the gas ----------------------------------------------------------------------------------


def test_later_region_covers_earlier_and_keeps_what_it_does_not_give():
    found = state(EVERYWHERE, DISC, 'shape = "half_plane"\npoint = [0.6, 0]\nnormal = [2, 0]\n'
                  "pressure = 3.0")  # fmt: skip
    x, y = found.position
    inside = np.hypot(x - 0.5, y - 0.5) < 0.25
    right = x >= 0.6
    density = np.where(inside, 4.0, 1.0)
    np.testing.assert_array_equal(found.others["density"], density)
    np.testing.assert_array_equal(found.velocity, [np.where(inside, 1.0, 0.0), inside * x])
    # u = P / ((gamma - 1) rho), gamma = 5/3: round-off of three operations
    np.testing.assert_allclose(
        found.internal_energy, np.where(right, 3.0, 2.0) * 1.5 / density, rtol=1e-15
    )
    np.testing.assert_allclose(found.mass, density / 400, rtol=1e-15)


def test_expressions_use_coordinates_and_distance_from_centre():
    bump = 'shape = "disc"\ncentre = [0.0, 0.5]\nradius = 0.2\ndensity = "2 - r"\npressure = "y"'
    found = state(EVERYWHERE, bump)
    x, y = found.position
    # the disc is cut by the periodic boundary at x = 0
    r = np.hypot(x - np.round(x), y - 0.5)
    assert (x[r < 0.2] > 0.8).any()
    np.testing.assert_allclose(found.others["density"], np.where(r < 0.2, 2.0 - r, 1.0), rtol=1e-15)
    np.testing.assert_allclose(
        found.internal_energy * found.others["density"], np.where(r < 0.2, y, 2.0) * 1.5, rtol=1e-14
    )


SHAPES = {
    "box": ("low = [0.2, 0.5]\nhigh = [0.4, 1.0]", lambda x, y: (x > 0.2) & (x < 0.4) & (y > 0.5)),
    "ring": (
        "centre = [0.5, 0.5]\ninner = 0.1\nouter = 0.3",
        lambda x, y: abs(np.hypot(x - 0.5, y - 0.5) - 0.2) < 0.1,
    ),
    "slab": ('axis = "y"\nrange = [0.8, 1.3]', lambda x, y: (y > 0.8) | (y < 0.3)),
    "half_plane": ("point = [0.5, 0.5]\nnormal = [1.0, 2.0]", lambda x, y: x + 2.0 * y > 1.5),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shape_holds_particles_inside(shape):
    sizes, inside = SHAPES[shape]
    found = state(EVERYWHERE, f'shape = "{shape}"\n{sizes}\ndensity = 3.0')
    expected = inside(*found.position)
    assert 10 < expected.sum() < 390
    np.testing.assert_array_equal(found.others["density"] == 3.0, expected)


@pytest.mark.parametrize("dimension", [1, 3])
def test_scene_in_other_dimensions(dimension):
    slab = 'shape = "slab"\naxis = "x"\nrange = [0.25, 0.5]\ndensity = 2.0'
    found = state(EVERYWHERE, slab, keys=f"dimension = {dimension}\nn = 512")
    assert found.position.shape == (dimension, 512)
    assert found.mass.sum() == pytest.approx(1.25, rel=1e-12)


def test_adjacent_boxes_share_no_particle_and_leave_none_out():
    left = 'shape = "box"\nlow = [0.0, 0.0]\nhigh = [0.5, 1.0]\ndensity = 1.0\npressure = 1.0'
    right = left.replace("[0.0, 0.0]", "[0.5, 0.0]").replace("[0.5, 1.0]", "[1.0, 1.0]")
    # with 21 layers the middle one is on the common face
    found = state(left, right.replace("density = 1.0", "density = 2.0"), keys="n = 441")
    assert found.mass.size == 441
    assert (found.others["density"][found.position[0] == 0.5] == 2.0).all()
    assert (found.position[0] == 0.5).sum() == 21


def test_lower_faces_belong_to_a_solid():
    points = np.array([[0.0, 0.5, 1.0], [0.5, 0.5, 0.5]])
    box = areas.Solid(bodies.box([0.0, 0.0], [1.0, 1.0]))
    np.testing.assert_array_equal(box.contains(points), [True, True, False])


# --- particles --------------------------------------------------------------------------------


def test_vacuum_has_no_particles_and_clouds_have_n():
    clouds = [
        f'shape = "disc"\ncentre = [{x}, 0.5]\nradius = 0.15\ndensity = 1.0\npressure = 1.0'
        for x in (0.25, 0.75)
    ]
    found = state(*clouds, keys='boundary = "open"\nn = 600')
    assert found.mass.size == pytest.approx(600, rel=0.03)  # whole cells of one lattice
    assert found.mass.sum() == pytest.approx(2.0 * np.pi * 0.15**2, rel=0.02)


def test_equal_masses_have_lattices_of_their_own():
    found = state(EVERYWHERE, DISC, keys='masses = "equal"')
    inside = found.others["density"] == 4.0
    expected = 4.0 * np.pi * 0.25**2
    assert np.ptp(found.mass) < 0.06 * found.mass.mean()
    # a lattice is cut at the edge of the disc: about the root of the 50 sites at its edge
    assert found.mass[inside].sum() == pytest.approx(expected, rel=0.05)
    assert found.mass.sum() == pytest.approx(expected + 1.0 - expected / 4.0, rel=0.03)
    assert found.mass.size == pytest.approx(400, rel=0.05)


def test_small_dense_region_needs_no_lattice_of_whole_box():
    low, high = np.array([[0.30, 0.40], [0.61, 0.69]])[:, 0], np.array([0.4, 0.69])
    box = np.array([[0.0, 1.0], [0.0, 1.0]])
    extent = np.stack([low, high], axis=1)
    part, cell = areas.within(box, extent, 1e6, "hexagonal")
    whole, whole_cell = areas.within(box, box, 1e4, "hexagonal")
    assert part.shape[1] < 0.05 * 1e6
    assert cell == pytest.approx(1e-6, rel=0.01)
    part, cell = areas.within(box, extent, 1e4, "hexagonal")
    near = ((whole >= extent[:, :1]) & (whole <= extent[:, 1:])).all(axis=0)
    found = ((part >= extent[:, :1]) & (part <= extent[:, 1:])).all(axis=0)
    assert cell == pytest.approx(whole_cell, rel=1e-12)
    order = [np.lexsort(np.round(one, 9)) for one in (part[:, found], whole[:, near])]
    # the same sites, from another corner: round-off of positions of order one
    np.testing.assert_allclose(
        part[:, found][:, order[0]], whole[:, near][:, order[1]], rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("masses", ["equal", "equal_spacing"])
def test_relaxed_scene_keeps_masses_of_regions(masses):
    keys = f'masses = "{masses}"\nrelax = {{ residual = 5e-3 }}'
    found = state(EVERYWHERE, DISC, keys=keys)
    inside = found.others["density"] == 4.0
    assert found.mass.size == 400
    # equal masses: the number of particles is rounded. Equal spacing: particles at the edge may be
    # in or out, about the root of 40.
    margin = 0.02 if masses == "equal" else 0.1
    assert found.mass[inside].sum() == pytest.approx(4.0 * np.pi * 0.25**2, rel=margin)
    if masses == "equal":
        assert np.ptp(found.mass) == 0.0
        stray = np.hypot(*(found.position[:, inside] - 0.5)).max()
        assert stray < 0.25 + 0.05  # a spacing outside
        domain, ratio = Domain(np.array([[0.0, 1.0]] * 2), ("periodic",) * 2), 1.6 * H_OVER_SPACING
        reached = glass.measured(
            found.position,
            domain,
            found.mass / found.others["density"],
            glass.Smoothing(KERNEL, ratio),
        )
        assert reached.scatter <= 5e-3  # also at the edge of the disc
        assert reached.mean == pytest.approx(1.005, abs=5e-3)
    again = state(EVERYWHERE, DISC, keys=keys)
    np.testing.assert_array_equal(again.position, found.position)


def test_equal_masses_follow_expression_after_relaxation():
    wave = 'shape = "everywhere"\ndensity = "1 + 0.5*sin(2*pi*x)"\npressure = 1.0'
    found = state(wave, keys='masses = "equal"\nrelax = { residual = 2e-3 }')
    assert np.ptp(found.mass) == 0.0
    counts = np.histogram(found.position[0], 4, (0.0, 1.0))[0]
    # integral over a quarter: 1/4 +- 1/(4 pi); one layer of 20 particles may be on either side
    expected = 400 * (0.25 + np.array([1, 1, -1, -1]) / (4.0 * np.pi))
    np.testing.assert_allclose(counts, expected, atol=15)


# --- errors -----------------------------------------------------------------------------------

WRONG = {
    "unknown function": (DISC.replace("4.0", '"1 + sni(x)"'), "region[1].density"),
    "unknown coordinate": (DISC.replace('"x"', '"z"'), "region[1].velocity[1]"),
    "attack": (DISC.replace("4.0", "\"__import__('os').getcwd()\""), "region[1].density"),
    "negative density": (DISC.replace("4.0", '"0.05 - r"'), "region[1].density"),
    "density zero": (DISC.replace("4.0", "0"), "region[1].density"),
    "infinite pressure": (DISC + '\npressure = "1/(x - x)"', "region[1].pressure"),
    "outside": (DISC.replace("0.25", "1e-4"), "region[1]"),
    "size of another shape": (DISC + "\nlow = [0.0, 0.0]", "region[1].low"),
    "missing size": ('shape = "slab"\naxis = "x"', "region[1].range"),
    "shape of another dimension": (DISC.replace("disc", "sphere"), "region[1].shape"),
    "unknown shape": (DISC.replace("disc", "disk"), "region[1].shape"),
    "components": (DISC.replace('[1.0, "x"]', "[1.0]"), "region[1].velocity"),
    "slab along z": (
        'shape = "slab"\naxis = "z"\nrange = [0.0, 1.0]\ndensity = 1.0', "region[1].axis",
    ),
    "range in wrong order": (
        'shape = "slab"\naxis = "x"\nrange = [1.0, 0.0]\ndensity = 1.0', "region[1].range",
    ),
    "normal zero": (
        'shape = "half_plane"\npoint = [0.0, 0.0]\nnormal = [0.0, 0.0]', "region[1].normal",
    ),
    "unknown key": (DISC + "\nrho = 1.0", "region[1].rho"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_region_is_refused_with_its_line(messages, case):
    table, key = WRONG[case]
    with messages.raised(ConfigError, f"problem.{key}", ", line "):
        config.from_text(scene(EVERYWHERE, table))


def test_regions_that_do_not_go_together_are_refused(messages):
    with messages.raised(ConfigError, "problem.region[0].pressure is missing"):
        config.from_text(scene('shape = "everywhere"\ndensity = 1.0'))
    with messages.raised(ConfigError, 'masses = "equal"', "problem.region[1].density"):
        config.from_text(scene(EVERYWHERE, DISC.replace("4.0", '"4 - r"'), keys='masses = "equal"'))
    with messages.raised(ConfigError, "problem.relax needs gas everywhere"):
        config.from_text(scene(DISC + "\npressure = 1.0", keys="relax = {}"))
    with messages.raised(ConfigError, "problem.region holds no particle"):
        config.from_text(scene('shape = "everywhere"\npressure = 1.0'))
    with messages.raised(ConfigError, "problem.lattice"):
        config.from_text(scene(EVERYWHERE, keys='lattice = "bcc"'))


AXES = "expected a list of numbers, one per axis, such as"


@pytest.mark.parametrize(
    ("region", "words"),
    [
        ('shape = "box"\nlow = 0.0\nhigh = [0.5, 1.0]', f"low = 0.0: {AXES} low = [0.0, 0.0]"),
        ('shape = "box"\nlow = "0"\nhigh = [0.5, 1.0]', f'low = "0": {AXES} low = [0.0, 0.0]'),
        ('shape = "box"\nlow = ["a", 0.0]\nhigh = [0.5, 1.0]', 'low[0] = "a": expected a number, '),
        ('shape = "box"\nlow = [0.1]\nhigh = [0.5, 1.0]', "in 2-D, one per axis, such as "
         "low = [0.1, 0.1]"),
        ('shape = "box"\nrange = [0.0, 0.5]', 'such as { shape = "box", low = [0.0, 0.0], hi'),
        ('shape = "slab"\naxis = "x"\nlow = 0.0\nhigh = 0.5', 'low is not a key of shape "slab": '),
        ('shape = "slab"\naxis = "x"\nlow = 0.0\nhigh = 0.5', "range is missing: expected axis, "),
        ('shape = "slab"\naxis = "x"\nrange = 0.5', "a list of 2 numbers, such as range = "),
        ('shape = "slab"\naxis = 0\nrange = [0.0, 0.5]', 'axis = 0: expected "x", "y" or "z", '),
        ('shape = "disc"\ncentre = 0.5\nradius = 0.1', f"{AXES} centre = [0.5, 0.5]"),
        ('shape = "disc"\ncentre = [0.5, 0.5]\nradius = [0.1]', "than 0, such as radius = 0.2"),
        ('shape = "disc"\ncenter = [0.5, 0.5]\nradius = 0.1', "did you mean centre?"),
        ('shape = "ring"\ncentre = [0.5, 0.5]\ninner = "1"\nouter = 2', "such as inner = 0.1"),
        ('shape = "half_plane"\npoint = 0.5\nnormal = [1.0, 0.0]', f"{AXES} point = [0.5, 0.5]"),
        ('shape = "half_plane"\npoint = [0.5, 0.5]\nnormal = "x"', f"{AXES} normal = [1.0, 0.0]"),
        (f"{EVERYWHERE}\nvelocity = 1.0", 'one per axis, such as velocity = ["-y", 0.5]'),
        ('shape = "everywhere"\ndensity = [1.0]', 'such as density = "1 + 0.1*sin(2*pi*x)"'),
    ],
)  # fmt: skip
def test_key_of_wrong_kind_is_refused_with_example(region, words):
    with pytest.raises(ConfigError) as caught:
        config.from_text(scene(EVERYWHERE, region))
    assert "problem.region[1]." in str(caught.value)
    assert words in str(caught.value)


def test_examples_of_shapes_are_valid():
    for shape, keys in Region.shapes.items():
        example = Region._example(shape)
        dimension = DIMENSION.get(shape, 2)
        text = (
            f'[problem]\nname = "regions"\ndimension = {dimension}\ndomain = [-1.0, 1.0]\nregion = '
        )
        first = '{ shape = "everywhere", density = 1.0, pressure = 1.0 }'
        found = config.from_text(f"{text}[{first}, {example}]\n").problem.region[1]
        assert all(getattr(found, key) is not None for key in keys)


def test_one_table_in_place_of_list_is_refused_with_remedy(messages):
    with messages.raised(ConfigError, "Try: [[problem.region]]"):
        config.from_text(f'[problem]\nname = "regions"\n[problem.region]\n{EVERYWHERE}\n')


def test_number_of_particles_written_as_real_is_refused_with_remedy():
    with pytest.raises(ConfigError, match=r"n = 1000\.0: expected .*, such as n = 1000$"):
        config.from_text('[problem]\nname = "regions"\nn = 1e3\n')


def test_run_whose_relaxation_fails_leaves_no_directory(tmp_path):
    (tmp_path / "a.toml").write_text(scene(EVERYWHERE))
    arguments = ["run", tmp_path / "a.toml", "-o", tmp_path / "run", "--set",
                 "problem.relax={ residual = 1e-9, iterations = 2 }"]  # fmt: skip
    done = CliRunner().invoke(main, [str(one) for one in arguments])
    assert (done.exit_code, "after 2 iterations" in done.stderr) == (2, True), done.output
    assert [one.name for one in tmp_path.iterdir()] == ["a.toml"]
