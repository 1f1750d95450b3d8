"""Lookups in HDF5 files with the layout of GADGET or SWIFT; refuses what does not fit."""

import h5py
import numpy as np

from sph.problems.files.contents import as_scalars, refusal

GAS = "PartType0"
NAMES = {
    "position": ("Coordinates", "Positions", "Position"),
    "velocity": ("Velocities", "Velocity"),
    "mass": ("Masses", "Mass"),
    "internal_energy": ("InternalEnergies", "InternalEnergy"),
    "density": ("Densities", "Density"),
    "id": ("ParticleIDs", "ParticleID"),
}
MOST = 100_000_000  # particles, as problem.n
DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError)


class Lookup:
    """An open file. Each method raises FileError for what is missing or of another kind."""

    def __init__(self, file: h5py.File, path: str):
        self.file, self.path = file, path

    def get(self, group, name: str):
        """Return a group or dataset, or None if it is missing."""
        try:
            return group.get(name)
        except DAMAGE:  # a link to another file that is not there
            return None

    def header(self, name: str, default) -> np.ndarray:
        """Return the numbers (M,) of an attribute of /Header, or the default, at least one."""
        header = self.file["Header"]
        if name not in header.attrs:
            return np.ravel(np.asarray(default, dtype=float))
        return self.numbers(header, name)

    def numbers(self, group, name: str) -> np.ndarray:
        """Return the numbers (M,) of an attribute, at least one."""
        try:
            found = np.ravel(np.asarray(group.attrs[name], dtype=float))
        except DAMAGE:
            found = np.empty(0)
        if found.size == 0:
            raise refusal(self.path, f"{group.name[1:]}/{name} holds no number", "numbers")
        return found

    def has(self, key: str) -> bool:
        """Return whether the gas has a dataset of that meaning, a key of NAMES."""
        return any(isinstance(self.get(self.file[GAS], one), h5py.Dataset) for one in NAMES[key])

    def name(self, key: str) -> str:
        """Return the name of a dataset in the file; the usual one if it is missing."""
        there = (
            one for one in NAMES[key] if isinstance(self.get(self.file[GAS], one), h5py.Dataset)
        )
        return f"{GAS}/{next(there, NAMES[key][0])}"

    def array(self, key: str) -> np.ndarray:
        """Return the dataset of that meaning, as it is stored."""
        name = self.name(key)
        if not self.has(key):
            listed = ", ".join(self.file[GAS]) or "nothing"
            raise refusal(
                self.path,
                f"{GAS} has no dataset {name.removeprefix(GAS + '/')}, but {listed}",
                " or ".join(NAMES[key]),
            )
        if self.file[name].size > 3 * MOST:
            raise refusal(
                self.path, f"{name} states {self.file[name].shape}", f"at most {MOST} particles"
            )
        try:
            return np.asarray(self.file[name][()])
        except DAMAGE as error:
            raise refusal(
                self.path, f"{name} cannot be read ({error})", "an intact file"
            ) from error

    def scalars(self, key: str, n: int) -> np.ndarray:
        """Return the dataset of that meaning as (n,) float64."""
        return as_scalars(self.path, self.name(key), self.array(key), n)
