"""What outside readers find in checkpoints of solids, and of liquids, of the continuum scheme."""

import numpy as np
import pytest
from test_layout import FIELDS

from sph import config
from sph.output import checkpoint, layout
from sph.output.checkpoint import Checkpoint
from sph.scene import Scene
from sph.state import State
from sph.totals import Baseline, Budget

LINKS = {"Density", "InternalEnergy", "SmoothingLength", "Pressure"}
OF_SOLIDS = {"StressTensors", "PlasticStrains", "Bodies", "Materials", "Clamped"}
NUMBER = 50

METAL = '{ name = "mie_gruneisen", rho_0 = 9.0, c_0 = 2.0, slope = 1.5, gruneisen = 1.5 }'
WATER = '{ name = "tait", rho_0 = 0.5, c_0 = 3.0 }'
PLASTIC = '{ name = "elastic_plastic", shear_modulus = 3.0, yield_stress = 0.5 }'
ELASTIC = '{ name = "elastic", shear_modulus = 3.0 }'
TWO = {"metal": f"eos = {METAL}\nstrength = {PLASTIC}", "water": f"eos = {WATER}"}

COLUMNS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz

# H/h of the cubic spline (eq 110), to six digits
RATIO = {1: 1.732051, 2: 1.778002, 3: 1.825742}


def configured(dimension: int, materials: dict[str, str], clamped: bool) -> config.Config:
    """A box of each material; materials: the text of the table of each."""
    bodies = "".join(
        f"""
        [[problem.body]]
        shape = "box"
        low = {[float(number)] * dimension}
        high = {[number + 1.0] * dimension}
        clamped = {str(clamped and number == 0).lower()}
        material = "{name}"
        """
        for number, name in enumerate(materials)
    )
    tables = "".join(f"[physics.materials.{name}]\n{text}\n" for name, text in materials.items())
    return config.from_text(
        f"""
        [problem]
        name = "bodies"
        dimension = {dimension}
        domain = {[[0.0, 2.0]] * dimension}
        boundary = "open"
        {bodies}
        [physics]
        formulation = "continuum"
        {tables}
        """,
        "the test",
    )


def solid_state(dimension: int, materials=TWO, clamped=True) -> Checkpoint:
    """Random numbers. The first material has all fields; of two, each has every other particle."""
    random = np.random.default_rng(dimension)
    described = configured(dimension, materials, clamped)
    particles = State.at_start(
        Scene(described).fields,
        position=2.0 * random.random((dimension, NUMBER)),
        velocity=random.normal(size=(dimension, NUMBER)),
        mass=random.random(NUMBER),
        internal_energy=random.random(NUMBER),
    )
    particles.density[:] = 1.0 + random.random(NUMBER)
    particles.support[:] = 2.4 * (particles.mass / particles.density) ** (1.0 / dimension)
    metal = np.arange(NUMBER) % len(materials) == 0
    tensor = random.normal(size=(dimension, dimension, NUMBER))
    fields = {
        "deviatoric_stress": metal * (tensor + tensor.swapaxes(0, 1)),
        "body": metal,
        "material": ~metal,
        "clamped": metal,
        "plastic_strain": metal * random.random(NUMBER),
    }
    for name, values in fields.items():
        if particles.get(name) is not None:
            getattr(particles, name)[:] = values
    particles.id = random.permutation(particles.id)
    return Checkpoint(
        particles=particles,
        time=random.random(),
        step=17,
        next_step=random.random(),
        list_position=particles.position.copy(),
        list_support=particles.support.copy(),
        list_skin=0.1,
        config=described,
        lineage=(),
        budget=Budget(0.0, 0.0, Baseline(1.0, 1.0)),
    )


def pressure_of(particles: State) -> np.ndarray:
    """Of the two materials: eqs 420 and 423, with the metal below its rho_0."""
    metal = 2.0**2 * (particles.density - 9.0) + 1.5 * 9.0 * particles.internal_energy
    water = 3.0**2 * (particles.density - 0.5)
    return np.where(particles.material == 0.0, metal, water)


def stress_of(particles: State, i: int) -> np.ndarray:
    """(3, 3) of particle i: its deviator is traceless, and equal along unused axes."""
    S = particles.deviatoric_stress[..., i]
    full = np.zeros((3, 3))
    full[: len(S), : len(S)] = S
    if len(S) == 1:
        full[1, 1] = full[2, 2] = -S[0, 0] / 2
    elif len(S) == 2:
        full[2, 2] = -S[0, 0] - S[1, 1]
    return full - pressure_of(particles)[i] * np.eye(3)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_names_and_shapes(public, dimension):
    group = public(solid_state(dimension))["PartType0"]
    assert set(group) == FIELDS | OF_SOLIDS | LINKS
    for name in OF_SOLIDS:
        dataset = group[name]
        # pynbody loads nothing with more than two axes
        assert dataset.shape == ((NUMBER, 6) if name == "StressTensors" else (NUMBER,)), name
        assert dataset.dtype == np.float64
        assert dataset.fletcher32


@pytest.mark.parametrize(
    ("materials", "fields"),
    [
        ({"metal": TWO["metal"]}, {"StressTensors", "Bodies", "PlasticStrains"}),
        ({"rubber": f"eos = {WATER}\nstrength = {ELASTIC}"}, {"StressTensors", "Bodies"}),
        ({"water": TWO["water"]}, set()),
    ],
    ids=["elastic-plastic", "elastic", "liquid"],
)
def test_only_fields_of_scene(public, materials, fields):
    group = public(solid_state(2, materials, clamped=False))["PartType0"]
    assert set(group) == FIELDS | fields | LINKS


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_stress_has_all_three_directions(public, dimension):
    state = solid_state(dimension)
    particles = state.particles
    group = public(state)["PartType0"]
    # a few roundings of the largest terms of the pressure
    np.testing.assert_allclose(group["Pressures"], pressure_of(particles), rtol=0, atol=1e-13)
    for i, columns in enumerate(group["StressTensors"][()]):
        right = stress_of(particles, i)
        expected = [right[a, b] for a, b in COLUMNS]
        np.testing.assert_allclose(columns, expected, rtol=0, atol=1e-13)


def test_fields_match_state(public):
    state = solid_state(2)
    group = public(state)["PartType0"]
    particles = state.particles
    equal = {
        "PlasticStrains": particles.plastic_strain,
        "Bodies": particles.body,
        "Materials": particles.material,
        "Clamped": particles.clamped,
    }
    for name, array in equal.items():
        assert array.any()
        assert group[name][()].tobytes() == array.tobytes(), name


def test_units_are_stored(public):
    group = public(solid_state(2))["PartType0"]
    for name in OF_SOLIDS:
        attributes = dict(group[name].attrs)
        found = [attributes[f"{unit} exponent"].item() for unit in ("U_L", "U_M", "U_t")]
        assert found == ([-1, 1, -2] if name == "StressTensors" else [0, 0, 0]), name
        assert attributes["Description"]
    scale = "a-scale exponent"
    assert group["StressTensors"].attrs[scale] == group["Pressures"].attrs[scale]
    assert b"xx, yy, zz, xy, xz, yz" in group["StressTensors"].attrs["Description"]


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_kernel_eta_is_that_of_public_smoothing_length(public, dimension):
    state = solid_state(dimension)
    file = public(state)
    scheme = dict(file["HydroScheme"].attrs)
    assert scheme["Scheme"] == b"continuum"
    assert scheme["Kernel function"] == b"cubic_spline"
    assert scheme["Equation of state"] == b"mie_gruneisen"  # of the first material
    assert scheme["rho_0"].tolist() == [9.0]
    # the support radius is 2 d, d = 1.2 spacings; RATIO has six digits
    eta = scheme["Kernel eta"].item()
    assert eta == pytest.approx(2.0 * 1.2 / RATIO[dimension], rel=5e-7)
    spacing = (state.particles.mass / state.particles.density) ** (1.0 / dimension)
    # roundings of the power and of two quotients
    np.testing.assert_allclose(file["PartType0/SmoothingLengths"], eta * spacing, rtol=1e-14)


def test_tensor_in_chunks_equals_tensor_at_once(public, monkeypatch):
    state = solid_state(3)
    at_once = public(state)["PartType0/StressTensors"][()]
    monkeypatch.setattr(layout, "LARGEST_CHUNK", 7 * 6 * 8)
    in_chunks = public(state)["PartType0/StressTensors"]
    assert in_chunks.chunks == (7, 6)
    assert np.array_equal(in_chunks[()], at_once)


def test_private_group_keeps_deviator(public, tmp_path):
    state = solid_state(2)
    public(state)
    found = checkpoint.read(tmp_path / "a.h5").particles.deviatoric_stress
    assert found.tobytes() == state.particles.deviatoric_stress.tobytes()
