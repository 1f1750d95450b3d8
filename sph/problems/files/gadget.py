"""Initial states in HDF5 files with the layout of GADGET and SWIFT, as in checkpoints.

Gas is /PartType0; its datasets have singular or plural names. Coordinates run from 0 to the
attribute BoxSize of /Header, to which the attribute Origin of our own files is added.
"""

import io
import tomllib
from typing import Any

import h5py
import numpy as np

from sph.problems.files.contents import (
    Contents,
    along_axes,
    as_rows,
    check,
    refusal,
    rounding,
)
from sph.problems.files.lookup import DAMAGE, GAS, NAMES, Lookup
from sph.problems.files.units import stated

TYPES = ("gas", "dark matter", "disk", "bulge", "stars", "black holes or boundary", "neutrinos")

# What states that space expands: group, attribute and its value without expansion.
STATIC = (
    ("Cosmology", "Cosmological run", 0),
    ("Parameters", "ComovingIntegrationOn", 0),
    ("Header", "Redshift", 0),
    ("Header", "Scale-factor", 1),
)


def read(file: io.IOBase, path: str, dimension: int | None, digest: str) -> Contents:
    """Return the contents of an open HDF5 file. Raises FileError.

    dimension: number of space dimensions; None: that of /HydroScheme, else of /Header, else 3.
    """
    try:
        opened = h5py.File(file, "r")
    except DAMAGE:
        raise refusal(
            path,
            "it is neither an HDF5 file nor an .npz file, or it is cut short",
            "HDF5 in the layout of GADGET or SWIFT, or an .npz file",
        ) from None
    try:
        with opened:
            return _File(opened, path).contents(dimension, digest)
    except DAMAGE as error:
        raise refusal(path, f"it cannot be read ({error})", "an intact HDF5 file") from error


class _File(Lookup):
    """An open file with an initial state."""

    def contents(self, dimension: int | None, digest: str) -> Contents:
        self._check_header()
        stored = self.array("position")
        rows = as_rows(self.path, self.name("position"), stored, None, 3)
        n = len(rows)
        self._check_number(n)
        dim = dimension or self._dimension(rows)
        names = {"mass": "Header/MassTable"}
        names |= {key: self.name(key) for key in NAMES if self.has(key)}
        position = along_axes(self.path, names["position"], rows, dim)
        precision = rounding(stored)
        del rows, stored  # before the next array is read
        velocity = as_rows(self.path, self.name("velocity"), self.array("velocity"), n, 3)
        found = Contents(
            self.path,
            digest,
            position,
            along_axes(self.path, names["velocity"], velocity, dim),
            self._masses(n),
            self.scalars("internal_energy", n),
            names=names,
            rounding=precision,
        )
        if self.has("density") and (density := self.scalars("density", n)).any():
            found.others = {"density": density}  # all zero: not known
        check(found)
        self._place(found, dim)
        found.units, found.unit_fault = stated(self)
        self._sort(found)
        return found

    # --- what the file holds

    def _check_header(self) -> None:
        """Raise FileError for what the file is not: of one part, of gas only, without entropies."""
        for group in ("Header", GAS):
            if not isinstance(self.get(self.file, group), h5py.Group):
                groups = ", ".join(f"/{one}" for one in self.file) or "nothing"
                raise refusal(
                    self.path,
                    f"it has no group /{group}, but {groups}",
                    "the layout of GADGET or SWIFT, with /Header and /PartType0",
                )
        if (files := self.header("NumFilesPerSnapshot", 1)[0]) > 1:
            raise refusal(
                self.path,
                f"Header/NumFilesPerSnapshot is {files:g}: it is one part of several",
                "a single file",
                "one file with the particles of all parts",
            )
        self._check_types()
        for name in ("Flag_Entropy_ICs", "flag_entropy_instead_u"):
            if np.any(self.header(name, 0)):
                raise refusal(
                    self.path,
                    f"Header/{name} is set: the file states entropies",
                    "internal energies per unit mass",
                )
        self._check_expansion()

    def _check_expansion(self) -> None:
        """Raise FileError if lengths are comoving, as velocities then are too."""
        for group, name, static in STATIC:
            there = self.get(self.file, group)
            if there is not None and name in there.attrs:
                found = self.numbers(there, name)[0]
                if found != static:
                    raise refusal(
                        self.path,
                        f"{group}/{name} is {found:g}: lengths are comoving",
                        f"a file without expansion of space, where {name} is {static}",
                    )

    def _check_types(self) -> None:
        totals = self.header("NumPart_Total", self.header("NumPart_ThisFile", 0))
        for kind in range(1, len(TYPES)):
            group = self.get(self.file, f"PartType{kind}")
            stored = isinstance(group, h5py.Group) and any(
                getattr(one, "size", 0) for one in group.values()
            )
            if stored or (kind < totals.size and totals[kind] > 0):
                raise refusal(
                    self.path,
                    f"it has particles of type {kind} ({TYPES[kind]}), /PartType{kind}",
                    "gas only, /PartType0",
                    "a copy without the other particles",
                )

    def _check_number(self, n: int) -> None:
        if n == 0:
            raise refusal(self.path, f"{self.name('position')} holds no particle", "at least one")
        stated = self.header("NumPart_ThisFile", n)[0]
        if stated != n:
            raise refusal(
                self.path,
                f"Header/NumPart_ThisFile states {stated:g} gas particles and "
                f"{self.name('position')} holds {n}",
                "equal numbers",
            )

    def _dimension(self, rows: np.ndarray) -> int:
        for group in ("HydroScheme", "Header"):
            there = self.get(self.file, group)
            if there is not None and "Dimension" in there.attrs:
                found = self.numbers(there, "Dimension")[0]
                if found not in (1, 2, 3):
                    raise refusal(self.path, f"{group}/Dimension is {found:g}", "1, 2 or 3")
                break
        else:
            found = rows.shape[1]
        axes = range(min(int(found), rows.shape[1]))
        flat = [axis for axis in axes if len(rows) > 1 and np.ptp(rows[:, axis]) == 0]
        if flat and flat[0] > 0:
            raise refusal(
                self.path,
                f"all particles have one value of {self.name('position')} along "
                f"{'xyz'[flat[0]]}, and the file says {found:g}-D",
                "particles that fill all dimensions",
                f"problem.dimension = {flat[0]}",
            )
        return int(found)

    def _masses(self, n: int) -> np.ndarray:
        if self.has("mass"):
            return self.scalars("mass", n)
        each = self.header("MassTable", 0)[0]
        if not each > 0.0:
            raise refusal(
                self.path,
                f"{GAS} has no Masses, and Header/MassTable states {each:g} for gas",
                f"the dataset {GAS}/Masses, or a positive entry in Header/MassTable",
            )
        return np.full(n, each)

    def _place(self, found: Contents, dim: int) -> None:
        """Move the particles to the origin of the file, and add the box and its boundary."""
        origin = np.resize(self.header("Origin", 0), 3)[:dim]
        size = self.header("BoxSize", 0)
        if (size.size not in (1, 2, 3) or 1 < size.size < dim) or not (
            np.isfinite(size).all() and (size >= 0.0).all()
        ):
            raise refusal(
                self.path,
                f"Header/BoxSize is {size.tolist()}",
                f"one length, or one for each of {dim} axes",
            )
        size = np.full(dim, size[0]) if size.size == 1 else size[:dim]
        if origin.any():
            found.position += origin[:, None]
        if (size > 0.0).all():
            found.box, found.boundary = np.stack([origin, origin + size], axis=1), "periodic"
        if (own := self._own_problem()) and own["dimension"] == dim:
            box = np.array(own["domain"], dtype=float)
            found.box = np.tile(box, (dim, 1)) if box.ndim == 1 else box
            found.boundary = own["boundary"]

    def _own_problem(self) -> dict[str, Any] | None:
        """Return the table [problem] of the configuration in one of our own checkpoints, or None.

        The public groups of a checkpoint widen the box to hold all particles.
        """
        group = self.get(self.file, "Checkpoint")
        if group is None or "configuration" not in group.attrs:
            return None
        try:
            tables = tomllib.loads(str(group.attrs["configuration"]))
            formulation = tables["physics"].get("formulation", "gas")
        except DAMAGE:
            raise refusal(
                self.path, "the configuration in /Checkpoint cannot be read", "an intact checkpoint"
            ) from None
        if formulation != "gas":
            raise refusal(
                self.path,
                f'it is a checkpoint with physics.formulation = "{formulation}", whose state has '
                "more than positions, velocities, masses and energies",
                "a checkpoint of gas",
                "`sph restart` continues such a run",
            )
        return tables["problem"]

    def _sort(self, found: Contents) -> None:
        """Order the particles by ID, so that the particle with the k-th lowest ID is number k."""
        if not self.has("id"):
            return
        name, ids = self.name("id"), self.array("id")
        if ids.dtype.kind not in "iu" or ids.shape != found.mass.shape:
            raise refusal(
                self.path,
                f"{name} is of type {ids.dtype} and shape {ids.shape}",
                f"{found.mass.size} whole numbers",
            )
        order = np.argsort(ids, kind="stable")
        ranked = ids[order]
        same = np.flatnonzero(ranked[1:] == ranked[:-1])
        if same.size:
            raise refusal(
                self.path,
                f"{name} has {ranked[same[0]]} more than once; {same.size} repetition(s)",
                "a different number for each particle",
                "a copy without ParticleIDs: particles then keep their order",
            )
        if (order[1:] < order[:-1]).any():
            for key in ("position", "velocity", "mass", "internal_energy"):
                setattr(found, key, np.ascontiguousarray(getattr(found, key)[..., order]))
            found.others = {key: array[order] for key, array in found.others.items()}
