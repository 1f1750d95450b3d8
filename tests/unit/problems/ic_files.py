"""Files with initial states of a few particles, in the layouts that the problem `file` reads."""

import h5py
import numpy as np

N = 12


def particles(dimension=2, n=N):
    """Return position, velocity (n, D), mass and internal energy (n,) in the box from 0 to 1."""
    random = np.random.default_rng(3)
    return {
        "position": random.uniform(0.0, 1.0, (n, dimension)),
        "velocity": random.uniform(-1.0, 1.0, (n, dimension)),
        "mass": random.uniform(1.0, 2.0, n),
        "internal_energy": random.uniform(1.0, 2.0, n),
    }


def padded(rows):
    """Return (n, 3) of (n, D): zero along unused axes."""
    return np.hstack([rows, np.zeros((len(rows), 3 - rows.shape[1]))])


def tables(state, **header):
    """Return the datasets and the header of a file in SWIFT's layout, for `write_hdf5`."""
    n, dimension = state["position"].shape
    datasets = {
        "Coordinates": padded(state["position"]),
        "Velocities": padded(state["velocity"]),
        "Masses": state["mass"],
        "InternalEnergy": state["internal_energy"],
        "ParticleIDs": np.arange(1, n + 1),
    }
    attributes = {
        "NumPart_ThisFile": [n, 0, 0, 0, 0, 0],
        "NumPart_Total": [n, 0, 0, 0, 0, 0],
        "NumFilesPerSnapshot": 1,
        "MassTable": np.zeros(6),
        "BoxSize": 1.0,
        "Dimension": dimension,
        "Flag_Entropy_ICs": 0,
    }
    return datasets, attributes | header


def write_hdf5(path, datasets, header, **groups):
    """Write a file. groups: attributes of further groups by name."""
    with h5py.File(path, "w") as file:
        file.create_group("Header").attrs.update(header)
        for name, array in datasets.items():
            file[f"PartType0/{name}"] = array
        for name, attributes in groups.items():
            file.create_group(name).attrs.update(attributes)
    return path
