"""What other programs see of a checkpoint and of its exports, for check_readers.py."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from sph.analysis.export import fields, tables, vtk
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import Checkpoint

# xx, yy, zz, xy, xz, yz of a tensor (3, 3)
TENSOR = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))


class Files(NamedTuple):
    """A state, and the files of it that programs open."""

    state: Checkpoint
    checkpoint: Path
    table: Path  # CSV
    grid: Path  # VTKHDF


class Reader(NamedTuple):
    """A program: the package that it needs, and what it sees.

    see: returns arrays by the names of the export, with the rows of `rows`; besides, the position
    (N, 3), time, box (3,) if known, and slice, an image of the density in the middle plane.
    is_in_cgs: whether these are in cm, g and s; otherwise in code units, without any conversion.
    units_within: by how much its units may differ from those that the file states, relatively.
    """

    name: str
    package: str
    see: Callable[[Files], dict]
    is_in_cgs: bool
    units_within: float = 0.0


def written(states: Sequence[Checkpoint], directory: Path, checkpoint: Path | None = None) -> Files:
    """Write exports of the last of `states`, and a checkpoint unless there is one.

    The earlier states are time steps of the VTKHDF file, too.
    """
    state = states[-1]
    if checkpoint is None:
        checkpoint = directory / "state.h5"
        checkpoints.write(checkpoint, state)
    table, *_ = tables.write(state, directory, "")
    tables.write_times({"": state.time}, directory)
    return Files(state, checkpoint, table, vtk.write(states, directory / "states.vtkhdf"))


def rows(values: np.ndarray) -> np.ndarray:
    """Return scalars (N,), vectors as (N, 3) and symmetric tensors as (N, 6)."""
    if values.ndim == 1:
        return values
    dimension = values.shape[1]
    if values.ndim == 2:
        return np.pad(values, ((0, 0), (0, 3 - dimension)))
    whole = np.pad(values, ((0, 0), (0, 3 - dimension), (0, 3 - dimension)))
    return whole[:, TENSOR[0], TENSOR[1]]


def unit(public, power: str = "**", join: str = "*", none: str = "dimensionless") -> str:
    """Return the unit of a field in cgs as a text, such as "g*cm**-3"."""
    powers = (("g", public.mass), ("cm", public.length), ("s", public.time))
    return join.join(f"{name}{power}{one}" for name, one in powers if one) or none


def public_fields(state: Checkpoint) -> dict:
    """Return the declaration of each exported field by the name of the export."""
    return {one.name: one.public for one in fields.of(state)}


# --- the checkpoint itself ---------------------------------------------------------------------


def open_in_yt(files: Files):
    """Return the data set, in the units of the run."""
    import yt

    yt.set_log_level("error")
    length, mass, time = files.state.config.units.in_cgs()
    speed = length / time
    units = {
        "UnitLength_in_cm": length,
        "UnitMass_in_g": mass,
        "UnitVelocity_in_cm_per_s": speed,
        "UnitEnergy_in_cgs": mass * speed**2,
    }
    return yt.load(str(files.checkpoint), unit_base=units)


# names of fields whose units yt knows; all others are in the units of the file
KNOWN_TO_YT = {
    "Velocities": "Velocities", "Masses": "Masses", "ParticleIDs": "ParticleIDs",
    "Densities": "Density", "InternalEnergies": "InternalEnergy",
    "SmoothingLengths": "SmoothingLength",
}  # fmt: skip


def by_yt(files: Files) -> dict:
    data = open_in_yt(files)
    gas, seen = data.all_data(), {}
    for name, public in public_fields(files.state).items():
        found = gas["PartType0", KNOWN_TO_YT.get(public.name, public.name)]
        powers = (public.length, public.mass, public.time)
        if public.name in KNOWN_TO_YT:
            seen[name] = found.to_value(unit(public))
        else:
            seen[name] = np.asarray(found) * files.state.config.units.factor(*powers)
    middle = data.slice("z", data.domain_center[2])
    image = middle.to_frb(data.domain_width[0], 64, center=data.domain_center)["gas", "density"]
    return seen | {
        "position": gas["PartType0", "Coordinates"].to_value("cm"),
        "box": data.domain_width.to_value("cm"),
        "time": data.current_time.to_value("s"),
        "slice": np.asarray(image),
    }


KNOWN_TO_PYNBODY = {
    "Velocities": "vel", "Masses": "mass", "Densities": "rho", "InternalEnergies": "u",
    "SmoothingLengths": "smooth", "Pressures": "p", "ParticleIDs": "iord",
}  # fmt: skip


def by_pynbody(files: Files) -> dict:
    import pynbody

    gas = pynbody.load(str(files.checkpoint)).gas
    seen = {
        name: gas[KNOWN_TO_PYNBODY.get(public.name, public.name)].in_units(
            unit(public, join=" ", none="1")
        )
        for name, public in public_fields(files.state).items()
        if name != "id"
    }
    seen = {name: np.asarray(values) for name, values in seen.items()}
    return seen | {
        "id": np.asarray(gas["iord"]),
        "position": np.asarray(gas["pos"].in_units("cm")),
        "time": float(gas.properties["time"].in_units("s")),
    }


def by_swiftsimio(files: Files) -> dict:
    import swiftsimio

    data = swiftsimio.load(str(files.checkpoint))
    seen = {}
    for name, public in public_fields(files.state).items():
        attribute = re.sub("([a-z])([A-Z])", r"\1_\2", public.name).lower()
        seen[name] = getattr(data.gas, attribute).to_physical_value(unit(public))
    return seen | {
        "position": data.gas.coordinates.to_physical_value("cm"),
        "box": data.metadata.boxsize.to_physical_value("cm"),
        "time": float(data.metadata.time.to_value("s")),
        "adiabatic index": np.asarray(data.metadata.gas_gamma).item(),
    }


# --- its exports -------------------------------------------------------------------------------


def grids(path: Path):
    """Yield the grid of each time step as pyvista sees it, and its time."""
    import pyvista
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    for step, time in enumerate(times or (None,)):
        reader.SetStep(step)
        reader.Update()
        yield pyvista.wrap(reader.GetOutput()).copy(), time


def by_pyvista(files: Files) -> dict:
    *_, (grid, time) = grids(files.grid)
    if grid.n_cells != grid.n_points:
        raise ValueError(f"{grid.n_cells} cells of {grid.n_points} particles")
    seen = {}
    for name in public_fields(files.state):
        values = np.asarray(grid.point_data[name])
        seen[name] = rows(values.reshape(-1, 3, 3)) if values.shape[1:] == (9,) else values
    # of a single step, the reader states no time
    return seen | {
        "position": np.asarray(grid.points), "time": files.state.time if time is None else time
    }  # fmt: skip


def by_sarracen(files: Files) -> dict:
    import pandas
    import sarracen

    table = sarracen.read_csv(str(files.table))
    found = (table.xcol, table.mcol, table.rhocol, table.hcol)
    if found != ("x", "mass", "density", "h"):
        raise ValueError(f"took {found} for x, mass, density and h")

    def columns(names):
        return np.stack([np.asarray(table[name]) if name in table else zero for name in names], 1)

    zero = np.zeros(len(table))
    seen = {}
    for name in public_fields(files.state):
        if name in table:
            seen[name] = np.asarray(table[name])
        elif name == "velocity":
            seen[name] = columns(["vx", "vy", "vz"])
        else:
            parts = [f"{name}_{'xyz'[i]}{'xyz'[j]}" for i, j in zip(*TENSOR, strict=True)]
            seen[name] = columns(parts if parts[0] in table else [f"{name}_{x}" for x in "xyz"])
    times = pandas.read_csv(files.table.with_name("times.csv"))
    return seen | {"position": columns("xyz"), "time": float(times["time"][0])}


READERS = (
    Reader("yt", "yt", by_yt, True),
    Reader("pynbody", "pynbody", by_pynbody, True),
    # takes units near pc, M_sun, … for its own units of these names; its solar mass is 3e-6 larger
    Reader("swiftsimio", "swiftsimio", by_swiftsimio, True, 4e-6),
    Reader("ParaView", "pyvista", by_pyvista, False),
    Reader("sarracen", "sarracen", by_sarracen, False),
)


def box(files: Files) -> np.ndarray:
    """Return the sides (3,) of the box of the checkpoint in cm, whose corner is at 0."""
    with h5py.File(files.checkpoint) as file:
        sides = np.asarray(file["Header"].attrs["BoxSize"])
    return sides * files.state.config.units.factor(1, 0, 0)
