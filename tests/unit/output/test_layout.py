"""What yt, pynbody and swiftsimio need, item by item (scripts/check_readers.py asks them)."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

UNITS = {
    f"Unit {what} in cgs ({symbol})"
    for what, symbol in [
        ("mass", "U_M"),
        ("length", "U_L"),
        ("time", "U_t"),
        ("current", "U_I"),
        ("temperature", "U_T"),
    ]
}
FIELDS = {
    "Coordinates",
    "Velocities",
    "Masses",
    "Densities",
    "InternalEnergies",
    "SmoothingLengths",
    "Pressures",
    "ParticleIDs",
}


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_header_describes_particles_and_box(public, make_state, dimension):
    state = make_state(dimension)
    file = public(state)
    header = dict(file["Header"].attrs)
    for name in ("NumPart_ThisFile", "NumPart_Total"):
        assert header[name].tolist() == [50, 0, 0, 0, 0, 0]
    assert header["NumPart_Total_HighWord"].tolist() == [0] * 6
    assert header["MassTable"].tolist() == [0.0] * 6
    assert header["BoxSize"].dtype == np.float64
    assert header["BoxSize"].shape == (3,)
    expected = {
        "NumFilesPerSnapshot": 1,
        "ThisFile": 0,
        "Time": state.time,
        "Redshift": 0,
        "Scale-factor": 1,
        "Dimension": 3,
        "Flag_Entropy_ICs": 0,
    }
    assert {name: header[name].item() for name in expected} == expected
    assert "Code" not in header


def test_group_attributes(public, make_state):
    state = make_state(2)
    file = public(state)
    for name in ("Units", "InternalCodeUnits"):
        assert set(file[name].attrs) == UNITS
        assert all(value.tolist() == [1.0] for value in file[name].attrs.values())
    assert file["Cosmology"].attrs["Cosmological run"] == 0
    assert file["Policy"].attrs["cosmological integration"] == 0
    parameters = dict(file["Parameters"].attrs)
    assert parameters == {"BoxSize": 1.0, "Omega0": 0.0, "OmegaLambda": 0.0, "HubbleParam": 1.0}
    assert all(np.ndim(value) == 0 for value in parameters.values())
    scheme = dict(file["HydroScheme"].attrs)
    assert scheme["Adiabatic index"].tolist() == [1.4]
    assert scheme["Equation of state"] == b"ideal_gas"
    assert scheme["Dimension"].tolist() == [2]
    assert scheme["Scheme"] == b"grad_h"
    assert scheme["Kernel function"] == b"wendland_c2"
    assert scheme["Kernel eta"].tolist() == [1.5]
    assert scheme["CFL parameter"].tolist() == [state.config.physics.C]


def test_equation_of_state_stored_with_parameters(public, make_state):
    state = make_state(1)
    gas = {"name": "stiffened_gas", "gamma": 4.4, "p_inf": 6e8}
    physics = state.config.physics.model_copy(update={"eos": gas, "gamma": None})
    changed = replace(state, config=replace(state.config, physics=physics))
    scheme = dict(public(changed)["HydroScheme"].attrs)
    assert scheme["Equation of state"] == b"stiffened_gas"
    assert scheme["Adiabatic index"].tolist() == [4.4]
    assert scheme["p_inf"].tolist() == [6e8]


@pytest.mark.parametrize("alpha", [None, 0.1])
def test_particle_datasets_match_state(public, make_state, alpha):
    state = make_state(2, alpha=alpha)
    group = public(state)["PartType0"]
    particles = state.particles
    further = set() if alpha is None else {"ViscosityParameters"}
    links = {"Density", "InternalEnergy", "SmoothingLength", "Pressure"}
    assert set(group) == FIELDS | further | links
    for link in links:
        assert isinstance(group.get(link, getlink=True), h5py.SoftLink)
    for link, name in [("Density", "Densities"), ("InternalEnergy", "InternalEnergies")]:
        assert group[link] == group[name]
    for name in FIELDS | further:
        dataset = group[name]
        assert dataset.dtype == (np.int64 if name == "ParticleIDs" else np.float64)
        assert dataset.shape == ((50, 3) if name in ("Coordinates", "Velocities") else (50,))
        assert dataset.fletcher32
    equal = {
        "Masses": particles.mass,
        "Densities": particles.density,
        "InternalEnergies": particles.internal_energy,
        "Pressures": state.pressure,
        "ParticleIDs": particles.id,
    }
    for name, array in equal.items():
        assert group[name][()].tobytes() == array.tobytes(), name
    assert np.array_equal(group["Velocities"][:, :2], particles.velocity.T)
    assert not group["Velocities"][:, 2].any()
    # H/h of Wendland C2 in 2-D (eq 110), to six digits
    h = particles.support / 1.897367
    np.testing.assert_allclose(group["SmoothingLengths"], h, rtol=5e-7)


def test_field_units_are_stored(public, make_state):
    group = public(make_state(3, alpha=0.1))["PartType0"]
    length_mass_time = {
        "Coordinates": (1, 0, 0),
        "Velocities": (1, 0, -1),
        "Masses": (0, 1, 0),
        "Densities": (-3, 1, 0),
        "InternalEnergies": (2, 0, -2),
        "SmoothingLengths": (1, 0, 0),
        "Pressures": (-1, 1, -2),
        "ParticleIDs": (0, 0, 0),
        "ViscosityParameters": (0, 0, 0),
    }
    for name, exponents in length_mass_time.items():
        attributes = dict(group[name].attrs)
        found = [attributes[f"{unit} exponent"].item() for unit in ("U_L", "U_M", "U_t")]
        assert found == list(exponents), name
        for other in ("U_I exponent", "U_T exponent", "h-scale exponent"):
            assert attributes[other].tolist() == [0.0]
        assert attributes["a-scale exponent"].shape == (1,)
        factor = "Conversion factor to CGS (not including cosmological corrections)"
        assert attributes[factor].tolist() == [1.0]
        assert attributes["Description"]


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_coordinates_shifted_and_unused_axes_centred(public, make_state, dimension):
    state = make_state(dimension)
    file = public(state)
    position = state.particles.position
    size = file["Header"].attrs["BoxSize"]
    origin = file["Header"].attrs["Origin"]
    coordinates = file["PartType0/Coordinates"][()]
    assert origin.tolist() == [-0.5, 0.0, -2.0][:dimension] + [0.0] * (3 - dimension)
    assert size.tolist() == {1: [1, 1, 1], 2: [1, 0.25, 1], 3: [1, 0.25, 4]}[dimension]
    assert file["Parameters"].attrs["BoxSize"] == size.max()
    assert np.array_equal(coordinates[:, :dimension].T, position - origin[:dimension, None])
    assert np.all(coordinates[:, dimension:] == size[dimension:] / 2)


def test_particles_outside_periodic_box_wrapped_in_public_group_only(public, make_state):
    state = make_state(2)
    y = state.particles.position[1]
    y[:4] = -1e-3, -1e-20, 0.25, np.nextafter(0.25, 0)
    file = public(state)
    coordinates = file["PartType0/Coordinates"][:, 1]
    # one rounding of a number below 1
    np.testing.assert_allclose(coordinates[:3], [0.249, 0.0, 0.0], rtol=0, atol=1e-16)
    assert coordinates.min() >= 0.0
    assert coordinates.max() < 0.25
    assert np.array_equal(file["Checkpoint/position"][1], y)


@pytest.mark.parametrize("boundary", ["open", "mirror"])
def test_box_widened_to_particles_outside_open_axis(public, make_state, boundary):
    state = make_state(2, boundary=boundary)
    state.particles.position[0, :2] = -3.0, 1.5
    file = public(state)
    assert file["Header"].attrs["Origin"].tolist() == [-3.0, 0.0, 0.0]
    assert file["Header"].attrs["BoxSize"].tolist() == [4.5, 0.25, 4.5]
    coordinates = file["PartType0/Coordinates"][()]
    assert coordinates[:2, 0].tolist() == [0.0, 4.5]
    assert np.all((coordinates >= 0) & (coordinates <= file["Header"].attrs["BoxSize"]))
