"""The public part of a checkpoint: groups that yt, pynbody and swiftsimio read.

SWIFT's names and conventions, in code units. A one- or two-dimensional run is laid into three
dimensions: its unused axes are as long as the longest used one and all particles lie in their
middle, so that a slice through the middle of the box finds them.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import h5py
import numpy as np

from sph import kernels
from sph.output import hdf5
from sph.state import Public

# Makes rows of an array (…, n) of a field, or of part of one: (n,), (n, 3) or (n, 6).
Rows = Callable[[np.ndarray], np.ndarray]

# Bytes of a chunk, at most: the Fletcher-32 filter works by the chunk, for which HDF5 needs up to
# four copies. With half of this, HDF5 kept 13 MB more after it had closed the file.
LARGEST_CHUNK = 1_572_864

CENTIMETRE_GRAM_SECOND = {
    "Unit mass in cgs (U_M)": 1.0,
    "Unit length in cgs (U_L)": 1.0,
    "Unit time in cgs (U_t)": 1.0,
    "Unit current in cgs (U_I)": 1.0,
    "Unit temperature in cgs (U_T)": 1.0,
}


# Columns of a symmetric tensor, SWIFT's: xx, yy, zz, xy, xz, yz. Not (n, 3, 3), which pynbody 2.8
# refuses to load.
TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
COLUMNS = (1, 3, len(TENSOR))  # by rank

# Names that yt knows; soft links, since pynbody does not list a field that is hard-linked twice.
SINGULAR = {
    "Density": "Densities",
    "InternalEnergy": "InternalEnergies",
    "SmoothingLength": "SmoothingLengths",
    "Pressure": "Pressures",
}


class Frame(NamedTuple):
    """A box from 0 to `size` whose corner is at `origin` in the run's own coordinates."""

    origin: np.ndarray  # (3,)
    size: np.ndarray  # (3,)


def frame_of(problem, position: np.ndarray) -> Frame:
    """The domain, with axes that are not periodic widened to hold all of (D, N) `position`."""
    low, high = problem.box[:, 0].copy(), problem.box[:, 1].copy()
    widened = np.array([boundary != "periodic" for boundary in problem.boundaries])
    low[widened] = np.minimum(low, position.min(axis=1))[widened]
    high[widened] = np.maximum(high, position.max(axis=1))[widened]
    origin, size = np.zeros(3), np.full(3, (high - low).max())
    origin[: low.size], size[: low.size] = low, high - low
    return Frame(origin, size)


def in_frame(frame: Frame, boundaries: tuple[str, ...], position: np.ndarray) -> np.ndarray:
    """(N, 3) coordinates from 0 to frame.size of (D, N) `position`, periodic axes wrapped."""
    coordinates = np.empty((position.shape[1], 3))
    coordinates[:] = frame.size / 2
    for axis, boundary in enumerate(boundaries):
        x = position[axis] - frame.origin[axis]
        if boundary == "periodic":
            outside = np.flatnonzero(~((x > 0.0) & (x < frame.size[axis])))
            x[outside] %= frame.size[axis]  # the remainder of all would take ten times as long
            # the remainder of a number just below 0 rounds up to the size itself
            x[x >= frame.size[axis]] = 0.0
        coordinates[:, axis] = x
    return coordinates


def write_public(file: h5py.File, checkpoint) -> None:
    """Write all public groups of `checkpoint` (a sph.output.checkpoint.Checkpoint)."""
    root = file.id
    particles, problem = checkpoint.particles, checkpoint.config.problem
    frame = frame_of(problem, particles.position)
    for name, attributes in _header(checkpoint, frame).items():
        hdf5.write_attributes(hdf5.create_group(root, name), attributes)
    group = hdf5.create_group(root, "PartType0")
    for public, array, in_rows in _fields(checkpoint, frame):
        dataset = write_rows(group, public.name, array, in_rows)
        hdf5.write_attributes(dataset, _unit_attributes(public))
        del dataset  # closes it, which frees its chunks
    for link, target in SINGULAR.items():
        hdf5.link(group, link, f"/PartType0/{target}")


def write_rows(
    group: h5py.h5g.GroupID, name: str, array: np.ndarray, in_rows: Rows
) -> h5py.h5d.DatasetID:
    """A dataset of the rows of an array (…, N), in which damage is found when it is read."""

    def part(first: int, last: int) -> np.ndarray:
        return in_rows(array[..., first:last])

    longest = LARGEST_CHUNK // (8 * COLUMNS[array.ndim - 1])
    return hdf5.write_checked(group, name, part, array.shape[-1], longest)


def _fields(checkpoint, frame: Frame) -> Iterator[tuple[Public, np.ndarray, Rows]]:
    """Each public field: its array, and what makes rows of it.

    Rows are scalars (N,), vectors (N, 3) and symmetric tensors (N, 6).
    """
    config, particles = checkpoint.config, checkpoint.particles
    ratio = kernels.support_ratio(config.physics.kernel_model(), particles.dimension)
    special: dict[str, Rows] = {
        "position": partial(in_frame, frame, config.problem.boundaries),
        "support": lambda support: support / ratio,
    }
    for field in particles.fields:
        if field.public is not None and field.stored:
            rows = special.get(field.name, USUAL[field.rank])
            yield field.public, getattr(particles, field.name), rows
    for public, array in checkpoint.scene.formulation.derived(particles):
        yield public, array, USUAL[array.ndim - 1]


def _scalar(array: np.ndarray) -> np.ndarray:
    return array


def _vector(array: np.ndarray) -> np.ndarray:
    """(N, 3) of (D, N): zero along unused axes."""
    found = np.zeros((array.shape[1], 3))
    found[:, : array.shape[0]] = array.T
    return found


def _tensor(array: np.ndarray) -> np.ndarray:
    """(N, 6) of a symmetric (3, 3, N)."""
    return np.stack([array[a, b] for a, b in TENSOR], axis=1)


USUAL: tuple[Rows, ...] = (_scalar, _vector, _tensor)  # by rank


def _header(checkpoint, frame: Frame) -> dict[str, Mapping]:
    """Attributes of each group that holds nothing else."""
    physics, dimension = checkpoint.config.physics, checkpoint.particles.dimension
    # Six kinds of particle, gas first: yt reads six and no more.
    number = np.array([checkpoint.particles.number, 0, 0, 0, 0, 0])
    return {
        "Header": {
            "BoxSize": frame.size,
            "Origin": frame.origin,
            "NumPart_ThisFile": number,
            "NumPart_Total": (number & 0xFFFFFFFF).astype(np.uint32),
            "NumPart_Total_HighWord": (number >> 32).astype(np.uint32),
            "MassTable": np.zeros(6),
            "NumFilesPerSnapshot": np.array([1]),
            "ThisFile": np.array([0]),
            "Time": np.array([checkpoint.time]),
            "Redshift": np.array([0.0]),
            "Scale-factor": np.array([1.0]),
            "Dimension": np.array([3]),  # pynbody takes no other; the true one is in HydroScheme
            "Flag_Entropy_ICs": np.array([0]),
        },
        "Units": _one_element(CENTIMETRE_GRAM_SECOND),
        "InternalCodeUnits": _one_element(CENTIMETRE_GRAM_SECOND),
        "Cosmology": {"Cosmological run": np.array([0])},
        "Policy": {"cosmological integration": np.array([0])},
        # scalars, for yt, which knows cubic boxes only
        "Parameters": {
            "BoxSize": frame.size.max(),
            "Omega0": 0.0,
            "OmegaLambda": 0.0,
            "HubbleParam": 1.0,
        },
        "HydroScheme": {
            **_equation_of_state(physics.eos_model()),
            "Dimension": np.array([dimension]),
            "Scheme": np.bytes_(checkpoint.scene.formulation.label),
            "Kernel function": np.bytes_(physics.kernel_model().name),
            "Kernel eta": np.array([_eta(checkpoint)]),
            "CFL parameter": np.array([physics.C]),
        },
    }


def _eta(checkpoint) -> float:
    """Return h over the particle spacing, for h of the attribute `SmoothingLengths`."""
    models, dimension = checkpoint.scene.formulation.models, checkpoint.particles.dimension
    # the formulation may have another smoothing length
    return models.eta * (models.support_ratio / kernels.support_ratio(models.kernel, dimension))


def _equation_of_state(eos) -> dict:
    """Its name and its parameters, gamma under the name that readers know."""
    parameters = {key: np.array([value]) for key, value in eos._asdict().items()}
    if "gamma" in parameters:
        parameters["Adiabatic index"] = parameters.pop("gamma")
    return {"Equation of state": np.bytes_(eos.name), **parameters}


def _one_element(numbers: Mapping[str, float]) -> dict[str, np.ndarray]:
    return {name: np.array([number]) for name, number in numbers.items()}


def _unit_attributes(field: Public) -> dict:
    return _one_element(
        {
            "U_L exponent": float(field.length),
            "U_M exponent": float(field.mass),
            "U_t exponent": float(field.time),
            "U_I exponent": 0.0,
            "U_T exponent": 0.0,
            "a-scale exponent": float(field.scale_factor),
            "h-scale exponent": 0.0,
            "Conversion factor to CGS (not including cosmological corrections)": 1.0,
        }
    ) | {"Description": np.bytes_(field.description)}
