"""VTKHDF files for ParaView and pyvista: particles as points, checkpoints as time steps.

The layout is that of "VTKHDF file format", version 2, type UnstructuredGrid, in the documentation
of VTK. Each particle is a cell (a vertex). Each time step is one part, appended to all datasets.
"""

from collections.abc import Iterable
from pathlib import Path

import h5py
import numpy as np

from sph.analysis.export import fields
from sph.output.checkpoint import Checkpoint
from sph.output.files import replacing
from sph.state import Public

VERSION = (2, 0)
VERTEX = 1  # VTK's number of this type of cell
CHUNK = 16384  # rows of a chunk
# what has a unit besides the arrays
OTHERS = {"Points": Public("", 1, 0, 0, 0, ""), "time": Public("", 0, 0, 1, 0, "")}
UNIT = "unit of {}"  # name of the array of field data with the unit of an array, or of the time
# the only strings that VTK reads: it ends with an error at others
TEXT = h5py.string_dtype("ascii")
ONE = np.array([[1, 1]])  # numbers of components and of tuples of a string
COUNTS = ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds")
OFFSETS = ("PointOffsets", "CellOffsets", "ConnectivityIdOffsets")


def write(checkpoints: Iterable[Checkpoint], path: Path) -> Path:
    """Write the particles of `checkpoints`, in order of time, to `path`. Raises FileError.

    Checkpoints are asked for one after another, so they need not fit into memory together. Points
    are in the coordinates of the run, with 0 along unused axes.
    """
    with replacing(path) as unfinished, h5py.File(unfinished, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(VERSION, dtype=np.int64)
        root.attrs["Type"] = np.bytes_("UnstructuredGrid")
        root.create_group("PointData")
        root.create_group("CellData")
        steps = root.create_group("Steps")
        for number, checkpoint in enumerate(checkpoints):
            _append_step(root, steps, checkpoint, number)
            steps.attrs["NSteps"] = np.int64(number + 1)
    return path


def _append_step(root: h5py.Group, steps: h5py.Group, checkpoint: Checkpoint, number: int) -> None:
    place = _in_three_dimensions(fields.position(checkpoint))
    n = len(place)
    before = len(root["Points"]) if number else 0
    for name in OFFSETS:
        _append(steps, name, np.array([before]))
    _append(steps, "Values", np.array([checkpoint.time]))
    _append(steps, "PartOffsets", np.array([number]))
    _append(steps, "NumberOfParts", np.array([1]))
    for name in COUNTS:
        _append(root, name, np.array([n]))
    _append(root, "Points", place)
    _append(root, "Connectivity", np.arange(n))
    _append(root, "Offsets", np.arange(n + 1))
    _append(root, "Types", np.full(n, VERTEX, dtype=np.uint8))
    data, offsets = root["PointData"], steps.require_group("PointDataOffsets")
    for one in fields.of(checkpoint):
        dataset = _append(data, one.name, _in_three_dimensions(one.values))
        dataset.attrs["Description"] = one.public.description
        dataset.attrs["Unit"] = fields.unit_of(checkpoint.config, one.public)
        _append(offsets, one.name, np.array([before]))
    _append_units(root, steps, checkpoint.config)


def _append_units(root: h5py.Group, steps: h5py.Group, config) -> None:
    """Append a step to the field data, which hold the same units in all steps.

    ParaView and pyvista show field data, and no attributes of HDF5.
    """
    units = {name: dataset.attrs["Unit"] for name, dataset in root["PointData"].items()}
    units |= {name: fields.unit_of(config, one) for name, one in OTHERS.items()}
    data = root.require_group("FieldData")
    places = [steps.require_group(f"FieldData{what}") for what in ("Offsets", "Sizes")]
    for name, unit in units.items():
        if not unit:  # a pure number
            continue
        if UNIT.format(name) not in data:
            data.create_dataset(UNIT.format(name), data=[unit], dtype=TEXT)
        for group, row in zip(places, (np.array([0]), ONE), strict=True):
            _append(group, UNIT.format(name), row)


def _append(group: h5py.Group, name: str, rows: np.ndarray) -> h5py.Dataset:
    """Append rows to a dataset of that name, which is made if it is missing."""
    if name not in group:
        return group.create_dataset(
            name, data=rows, maxshape=(None, *rows.shape[1:]), chunks=(CHUNK, *rows.shape[1:])
        )
    dataset = group[name]
    before = len(dataset)
    dataset.resize(before + len(rows), axis=0)
    dataset[before:] = rows
    return dataset


def _in_three_dimensions(values: np.ndarray) -> np.ndarray:
    """Scalars (N,) as they are, vectors (N, D) as (N, 3), tensors (N, D, D) as (N, 9)."""
    if values.ndim == 1:
        return values
    n, D = values.shape[:2]
    found = np.zeros((n, *(3 for _ in values.shape[1:])))
    found[(slice(None), *(slice(D) for _ in values.shape[1:]))] = values
    return found.reshape(n, -1)
