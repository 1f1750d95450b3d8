"""Bodies: lattices that fit shapes, overlaps, and the problem that composes bodies."""

from pathlib import Path

import numpy as np
import pytest

from sph import config
from sph.errors import ConfigError
from sph.problems.support import bodies

SHAPES = {
    "box 1-D": (bodies.box([-1.0], [2.0]), "cubic"),
    "box 2-D": (bodies.box([0.0, 1.0], [1.0, 1.57]), "cubic"),
    "box 2-D hexagonal": (bodies.box([0.0, 1.0], [1.0, 1.57]), "hexagonal"),
    "box 3-D fcc": (bodies.box([0.0, 1.0, 2.0], [1.0, 1.5, 2.5]), "fcc"),
    "disc": (bodies.ball([0.3, -0.2], 0.7), "cubic"),
    "disc hexagonal": (bodies.ball([0.3, -0.2], 0.7), "hexagonal"),
    "ring": (bodies.ball([0.3, -0.2], 0.7, 0.5), "cubic"),
    "sphere": (bodies.ball([0.3, -0.2, 1.0], 0.5), "cubic"),
    "sphere bcc": (bodies.ball([0.3, -0.2, 1.0], 0.5), "bcc"),
    "sphere fcc": (bodies.ball([0.3, -0.2, 1.0], 0.5), "fcc"),
    "cylinder": (bodies.cylinder([0.3, -0.2, 1.0], 0.3, 1.3, axis=1), "cubic"),
    "tube fcc": (bodies.cylinder([0.3, -0.2, 1.0], 0.4, 0.9, axis=2, inner=0.2), "fcc"),
}
VOLUMES = {
    "box 1-D": 3.0, "box 2-D": 0.57, "box 3-D fcc": 0.25, "disc": 0.49 * np.pi,
    "ring": 0.24 * np.pi, "sphere": 0.5 * np.pi / 3.0, "cylinder": 0.117 * np.pi,
    "tube fcc": 0.108 * np.pi,
}  # fmt: skip
# Distance of nearest neighbours in spacings V^(1/D), exact for the undistorted lattice
NEAREST = {
    "cubic": 1.0,
    "hexagonal": (4.0 / 3.0) ** 0.25,
    "bcc": 3.0**0.5 / 2.0 ** (2.0 / 3.0),
    "fcc": 2.0 ** (1.0 / 6.0),
}
SPACING = 0.05
every_shape = pytest.mark.parametrize("name", SHAPES)


def placed(name, spacing=SPACING):
    shape, kind = SHAPES[name]
    return bodies.place(shape, kind, spacing)


# --- shapes and lattices ----------------------------------------------------------------------


@pytest.mark.parametrize("name", VOLUMES)
def test_volume_of_shape_is_that_of_textbook(name):
    assert SHAPES[name][0].volume == pytest.approx(VOLUMES[name], rel=1e-13)


@every_shape
def test_particles_have_volume_of_shape_and_lie_inside(name):
    found = placed(name)
    n = found.position.shape[1]
    assert n * found.cell == pytest.approx(found.shape.volume, rel=1e-12)
    assert found.shape.contains(found.position).all()
    assert found.spacing == pytest.approx(SPACING, rel=0.05)  # whole cells in 10 to 30 spacings


@every_shape
def test_lattice_is_regular_and_centred(name):
    from scipy.spatial import cKDTree

    found, kind = placed(name), SHAPES[name][1]
    nearest = cKDTree(found.position.T).query(found.position.T, k=2)[0][:, 1] / found.spacing
    assert np.ptp(nearest) < 1e-9
    # whole cells are stretched to fit the length of a box, but not around the centre of a ball
    stretched = 0.06 if found.shape.flat else 1e-9
    assert nearest[0] == pytest.approx(NEAREST[kind], rel=stretched)
    assert found.position.mean(axis=1) == pytest.approx(found.shape.centre, abs=1e-12)


@pytest.mark.parametrize("name", ["box 1-D", "box 2-D", "box 3-D fcc", "box 2-D hexagonal"])
def test_outer_layers_of_box_are_half_a_layer_from_faces(name):
    found = placed(name)
    for x, (low, high) in zip(found.position, found.shape.extent, strict=True):
        layers = np.unique(np.round(x, 9))
        assert np.ptp(np.diff(layers)) < 1e-8
        half = 0.5 * np.diff(layers)[0]
        assert (layers[0] - low, high - layers[-1]) == pytest.approx((half, half), abs=1e-8)


@pytest.mark.parametrize("name", ["disc", "ring", "sphere", "cylinder"])
def test_cubic_lattice_of_round_shape_has_its_symmetries(name):
    found = placed(name)
    offset = np.round(found.position - found.shape.centre[:, None], 9)

    def sites(where):
        return set(map(tuple, (where + 0.0).T))  # + 0.0: no negative zero

    for axis in range(len(offset)):
        mirrored = offset.copy()
        mirrored[axis] *= -1.0
        assert sites(mirrored) == sites(offset)
    first, last = found.shape.radial[0], found.shape.radial[-1]
    swapped = offset.copy()
    swapped[[first, last]] = offset[[last, first]]
    assert sites(swapped) == sites(offset)


@pytest.mark.parametrize("spacing", [0.5, 0.9])
def test_few_particles_still_have_volume_of_disc(spacing):
    found = bodies.place(bodies.ball([0.0, 0.0], 1.0), "cubic", spacing)
    assert found.position.shape[1] * found.cell == pytest.approx(np.pi, rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "why"),
    [
        (bodies.box([0.0, 0.0], [1.0, 0.02]), "along y, less than half a cell"),
        (bodies.ball([0.0, 0.0], 0.4, 0.399), "too thin"),
    ],
)
def test_shape_without_particles_is_refused(shape, why):
    with pytest.raises(ValueError, match=why):
        bodies.place(shape, "cubic", 0.05)


# --- domain and overlap -----------------------------------------------------------------------

BOX = np.array([[0.0, 4.0], [0.0, 2.0]])


@pytest.mark.parametrize(
    ("centre", "boundaries", "axis"),
    [
        ([1.0, 1.0], ("open", "open"), None),
        ([0.9, 1.0], ("open", "open"), "x"),
        ([1.0, 1.1], ("periodic", "mirror"), "y"),
        ([0.0, 1.0], ("mirror", "open"), None),
        ([0.0, 1.0], ("open", "mirror"), "x"),
        ([4.0, 1.0], ("mirror", "open"), None),
        ([0.1, 1.0], ("mirror", "open"), "x"),
    ],
)
def test_disc_must_be_inside_domain_or_centred_on_mirror(centre, boundaries, axis):
    assert bodies.outside(bodies.ball(centre, 1.0), BOX, boundaries) == axis


def test_disc_on_mirrors_keeps_its_inner_quarter():
    shape, walls = bodies.ball([0.0, 0.0], 1.0), ("mirror", "mirror")
    assert bodies.volume_within(shape, BOX, walls) == pytest.approx(np.pi / 4.0)
    whole = bodies.place(shape, "cubic", 0.1)
    quarter = bodies.within(whole, BOX)
    assert 4 * quarter.position.shape[1] == whole.position.shape[1]
    assert quarter.position.min() == pytest.approx(0.5 * whole.spacing)


def pair(first, second, spacings=(0.05, 0.05)):
    return (
        bodies.place(shape, "cubic", spacing)
        for shape, spacing in zip((first, second), spacings, strict=True)
    )


@pytest.mark.parametrize("spacings", [(0.05, 0.05), (0.05, 0.02), (0.02, 0.1)])
@pytest.mark.parametrize("shift", np.linspace(0.0, 0.1, 9))
def test_lattices_inside_each_other_overlap_wherever_their_sites_are(shift, spacings):
    first, second = pair(
        bodies.ball([0.0, 0.0], 0.5), bodies.box([0.2 + shift, shift], [0.8, 0.6]), spacings
    )
    assert bodies.overlap(first, second)
    assert bodies.overlap(second, first)


def test_lattices_between_each_others_sites_overlap():
    # the distance of their sites is 0.71 spacings, as far as two square lattices can be apart
    first, second = pair(
        bodies.box([0.0, 0.0], [1.0, 1.0]), bodies.box([0.55, 0.55], [1.55, 1.55]), (0.1, 0.1)
    )
    assert bodies.overlap(first, second)


@pytest.mark.parametrize("spacings", [(0.05, 0.05), (0.05, 0.02), (0.02, 0.1)])
@pytest.mark.parametrize(
    ("first", "second"),
    [
        (bodies.box([0.0, 0.0], [0.5, 1.0]), bodies.box([0.5, 0.0], [1.0, 1.0])),
        (bodies.ball([0.0, 0.0], 0.5), bodies.box([0.5, -0.5], [1.0, 0.5])),
        (bodies.ball([0.0, 0.0], 0.5), bodies.ball([0.0, 0.0], 0.8, 0.55)),
        (bodies.ball([0.0, 0.0], 0.5), bodies.ball([5.0, 0.0], 0.5)),
    ],
    ids=["boxes that touch", "disc at a face", "disc in a ring", "far apart"],
)
def test_bodies_that_touch_do_not_overlap(first, second, spacings):
    assert not bodies.overlap(*pair(first, second, spacings))


@pytest.mark.parametrize(("x", "is_near"), [(0.52, True), (0.56, False)])
def test_particles_nearer_than_half_a_spacing_overlap(x, is_near):
    # the surfaces are 0.01 apart, the outermost particles near them
    first = bodies.Placed(bodies.ball([0.0, 0.0], 0.5), np.array([[0.49], [0.0]]), 0.01)
    second = bodies.Placed(bodies.ball([1.01, 0.0], 0.5), np.array([[x], [0.0]]), 0.01)
    assert bodies.overlap(first, second) == is_near


# --- the configuration ------------------------------------------------------------------------

STEEL = 'eos = { name = "tait", rho_0 = 8.0, c_0 = 1.0 }'
ROOT = Path(__file__).parents[2]
METAL = STEEL + '\nstrength = { name = "elastic", shear_modulus = 1.0 }'
DISC = 'shape = "disc"\ncentre = [0.0, 0.0]\nradius = 1.0'
PLATE = 'shape = "box"\nlow = [1.2, -1.0]\nhigh = [1.6, 1.0]'


def scene(*tables, physics="[physics]\n" + METAL, keys=""):
    """Return a configuration whose bodies begin at lines 7, 11, ... of three or four lines each."""
    head = '[problem]\nname = "bodies"\ndimension = 2\nn = 200\ndomain = [-2.0, 2.0]\n'
    return head + keys + "".join(f"[[problem.body]]\n{one}\n" for one in tables) + physics + "\n"


def loaded(tmp_path, text):
    path = tmp_path / "x.toml"
    path.write_text(text)
    return config.load(path)


WRONG = {
    "missing size": (scene(DISC, 'shape = "disc"\nradius = 1.0'), "body[1].centre"),
    "size of another shape": (scene(DISC + "\naxis = 'x'"), "body[0].axis"),
    "shape of another dimension": (
        scene('shape = "sphere"\ncentre = [0.0, 0.0]\nradius = 1.0'), "body[0].shape",
    ),
    "unknown shape": (scene(DISC, PLATE.replace("box", "bock")), "body[1].shape"),
    "unknown key": (scene(DISC, PLATE + "\nclamp = true"), "body[1].clamp"),
    "number of components": (scene(DISC, PLATE + "\nvelocity = [1.0]"), "body[1].velocity"),
    "lattice of another dimension": (scene(DISC + '\nlattice = "fcc"'), "body[0].lattice"),
    "corners in wrong order": (scene(PLATE.replace("1.6", "1.0")), "body[0].low"),
    "ring without a hole": (
        scene('shape = "ring"\ncentre = [0.0, 0.0]\ninner = 1.0\nouter = 0.5'), "body[0].inner",
    ),
    "negative radius": (scene(DISC.replace("1.0", "-1.0")), "body[0].radius"),
    "overlap": (scene(DISC, PLATE.replace("1.2", "0.9")), "body[1]"),
    "outside the domain": (scene(DISC, PLATE.replace("1.6", "2.1")), "body[1]"),
    "no particle": (scene(DISC, PLATE + "\nspacing = 1.5"), "body[1]"),
    "material without materials": (scene(DISC + '\nmaterial = "steel"'), "body[0].material"),
    "hexagonal lattice on a mirror": (
        scene(
            DISC.replace("0.0, 0.0", "2.0, 0.0") + '\nlattice = "hexagonal"',
            keys='boundary = "mirror"\n',
        ),
        "body[0].lattice",
    ),
    "pressure of a law without energy": (scene(DISC + "\npressure = 1.0"), "body[0].pressure"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_error_names_line_and_key_of_body(messages, tmp_path, case):
    text, key = WRONG[case]
    with messages.raised(ConfigError, f"problem.{key}") as caught:
        loaded(tmp_path, text)
    lines = text.splitlines()
    begins = [i for i, line in enumerate(lines, start=1) if line == "[[problem.body]]"]
    body, _, name = key.removeprefix("body[").partition("]")
    line = begins[int(body)]
    if name and "is missing" not in str(caught.value):
        line += 1 + next(i for i, one in enumerate(lines[line:]) if one.startswith(name[1:]))
    assert f"x.toml, line {line}: problem.{key}" in str(caught.value)


MATERIALS = f"[physics.materials.steel]\n{METAL}\n[physics.materials.water]\n{STEEL}"


@pytest.mark.parametrize(
    ("first", "physics", "key"),
    [
        ('material = "steal"', MATERIALS, "problem.body[0].material"),
        ("", MATERIALS, "problem.body[0].material"),
        (
            'material = "steel"',
            MATERIALS.replace("modulus = 1.0", "modulus = -1.0"),
            "physics.materials.steel.strength.shear_modulus",
        ),
        (
            "pressure = 1.0",
            '[physics]\nformulation = "gas"\neos = { name = "ideal_gas", gamma = 1.4 }',
            "problem.body[0].density",
        ),
        (
            "density = 1.0",
            '[physics]\nformulation = "gas"\neos = { name = "ideal_gas", gamma = 1.4 }',
            "problem.body[0].pressure",
        ),
    ],
    ids=["unknown material", "no material", "negative modulus", "gas, no density", "no pressure"],
)
def test_material_that_does_not_fit_is_refused(messages, tmp_path, first, physics, key):
    with messages.raised(ConfigError, key):
        loaded(tmp_path, scene(f"{DISC}\n{first}", physics=physics))


@pytest.mark.parametrize(
    ("name", "key"),
    [("uniform", 'formulation = "gas"'), ("uniform", ""), ("shock_tube", "C = 0.1")],
    ids=["given", "default", "default beside another key"],
)
def test_materials_of_a_gas_are_refused(messages, tmp_path, name, key):
    text = f'[problem]\nname = "{name}"\n[physics]\n{key}\n{MATERIALS}'
    with messages.raised(ConfigError, "physics.formulation"):
        loaded(tmp_path, text)


def test_materials_of_bodies_of_gas_are_refused():
    with pytest.raises(ConfigError, match='formulation = "gas": expected "continuum"'):
        config.load(ROOT / "configs" / "bodies.toml", ["physics.formulation=gas"])


def test_materials_of_a_problem_of_ideal_gas_are_refused(tmp_path):
    text = '[problem]\nname = "noh"\n[physics]\nformulation = "continuum"\n' + MATERIALS
    with pytest.raises(ConfigError, match=r"physics\.materials = .*expected an ideal gas for noh"):
        loaded(tmp_path, text)


def test_gamma_of_a_problem_of_solids_is_refused(messages, tmp_path):
    text = '[problem]\nname = "elastic_bar"\n[physics]\ngamma = 1.4\n'
    with messages.raised(ConfigError, "physics.gamma = 1.4"):
        loaded(tmp_path, text)


def test_initial_state_has_each_bodys_matter(tmp_path):
    plate = PLATE + '\nmaterial = "water"\nvelocity = [0.0, -2.0]\ndensity = 9.0\nspacing = 0.1'
    text = scene(DISC + '\nmaterial = "steel"\nclamped = true', plate, physics=MATERIALS)
    found = loaded(tmp_path, text)
    assert config.from_text(found.to_toml()) == found
    state = found.problem.initial(found.physics.eos_model())
    disc = state.others["body"] == 1.0
    assert set(state.others) == {"body", "density", "material", "clamped"}
    assert state.mass[disc].sum() == pytest.approx(8.0 * np.pi)
    assert state.mass[~disc].sum() == pytest.approx(9.0 * 0.8)
    assert disc.sum() == pytest.approx(200, abs=12)  # n, of the bodies without spacing
    assert (~disc).sum() == 80
    for name, values in {
        "density": (8.0, 9.0), "material": (0.0, 1.0), "clamped": (1.0, 0.0),
    }.items():  # fmt: skip
        assert state.others[name] == pytest.approx(np.where(disc, *values))
    assert state.velocity[1] == pytest.approx(np.where(disc, 0.0, -2.0))
    assert (state.internal_energy == 0.0).all()


def test_bodies_of_gas_have_energy_of_their_pressure(tmp_path):
    gas = '[physics]\nformulation = "gas"\neos = { name = "ideal_gas", gamma = 1.5 }'
    text = scene(DISC + "\ndensity = 2.0\npressure = 3.0", physics=gas)
    found = loaded(tmp_path, text)
    state = found.problem.initial(found.physics.eos_model())
    assert state.internal_energy == pytest.approx(np.full(state.mass.size, 3.0))  # P/(0.5 rho)


def test_inline_tables_are_the_same_configuration(tmp_path):
    def inline(table):
        return "{ " + table.replace("\n", ", ") + " }"

    keys = f"body = [\n  {inline(DISC)},\n  {inline(PLATE)},\n]\n"
    assert loaded(tmp_path, scene(keys=keys)) == loaded(tmp_path, scene(DISC, PLATE))
    wrong = keys.replace("high", "hight")
    with pytest.raises(ConfigError, match=r"x.toml, line 8: problem.body\[1\].hight is not a key"):
        loaded(tmp_path, scene(keys=wrong))


# --- rings and bar ----------------------------------------------------------------------------


def of(name, *overrides):
    return config.from_text(f'[problem]\nname = "{name}"\n').override(overrides)


def test_rings_have_speed_mass_and_gap():
    found = of("rubber_rings", "problem.n=1000")
    state = found.problem.initial(found.physics.eos_model())
    left = state.velocity[0] > 0.0
    assert state.mass.sum() == pytest.approx(2.0 * np.pi * (0.04**2 - 0.03**2))
    # 0.059 of the bulk speed of sound: K = 1e7/(3 x 0.205)
    assert np.abs(state.velocity[0]) == pytest.approx(0.059 * np.sqrt(1e7 / 0.615))
    assert state.position[0, left].mean() == pytest.approx(-0.041)
    assert state.position[0, ~left].mean() == pytest.approx(0.041)
    assert (state.others["body"] == np.where(left, 1.0, 2.0)).all()


def test_rings_modulus_is_that_of_rubber():
    found = of("rubber_rings")
    K, G = 1e7 / 0.615, found.physics.strength_model().shear_modulus
    young = 9.0 * K * G / (3.0 * K + G)
    assert young == pytest.approx(1e7)
    assert young / (2.0 * G) - 1.0 == pytest.approx(0.3975)  # Poisson's ratio


@pytest.mark.parametrize(
    ("overrides", "volume"),
    [
        (("problem.dimension=3",), 0.25 * np.pi * 0.0038**2 * 0.0254),
        (("problem.dimension=2",), 0.0038 * 0.0254),
        (("problem.dimension=2", "problem.lattice=hexagonal"), 0.0038 * 0.0254),
    ],
)
def test_bar_is_quarter_or_half_of_whole(overrides, volume):
    found = of("taylor_bar", "problem.n=600", *overrides)
    state = found.problem.initial(found.physics.eos_model())
    assert state.mass.sum() == pytest.approx(7850.0 * volume, rel=1e-12)
    assert state.position.min() > 0.0
    assert (state.velocity[0] == -200.0).all()
    assert (state.velocity[1:] == 0.0).all()


def test_fit_of_bar_length_is_that_of_wilkins_and_guinan():
    from sph.problems.taylor_bar import fitted_length

    assert fitted_length(7850.0, 200.0, 6e8) == pytest.approx(0.797, abs=5e-4)


@pytest.mark.parametrize("name", ["rubber_rings", "taylor_bar"])
@pytest.mark.parametrize("override", ["physics.formulation=gas", "physics.strength"])
def test_problem_of_solid_needs_a_solid(messages, tmp_path, name, override):
    text = f'[problem]\nname = "{name}"\n[physics]\n'
    text += 'formulation = "gas"\ngamma = 1.4\n' if override.endswith("gas") else ""
    if override == "physics.strength":
        text += f"[physics.materials.steel]\n{METAL}\n"
    key = "physics.formulation" if override.endswith("gas") else "physics.materials"
    with messages.raised(ConfigError, key):
        loaded(tmp_path, text)


def test_rebound_is_measured_from_last_contact():
    problem = of("rubber_rings", "problem.n=1000").problem
    spacing = np.sqrt(2.0 * np.pi * 0.0007 / 1000)
    history = {
        "t": np.linspace(0.0, 4.0, 5),
        "ring_gap": spacing * np.array([2.0, 0.1, 0.2, 1.0, 3.0]),
        "approach": np.array([1.0, 0.5, -0.2, -0.6, -0.5]),
        "angular_momentum": np.array([0.1, 0.1, 0.0, -0.1, 0.1]),
    }
    found = problem.over_time(None, history)
    assert found["restitution"] == 0.5
    assert found["rebound_time"] == 3.0
    assert found["angular_momentum_change"] == pytest.approx(0.2)
    early = {name: values[:4] for name, values in history.items()}
    assert set(problem.over_time(None, early)) == {"angular_momentum_change"}
