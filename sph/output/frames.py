"""Frames for movies: small files with the fields that pictures show, in single precision."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from sph.config import Config
from sph.errors import FileError
from sph.output import hdf5
from sph.output.files import (
    Damaged,
    PatientFile,
    explained,
    holding_directory,
    is_sealed,
    opened,
    refuse_link,
    remove_unfinished,
    replacing,
    seal,
)
from sph.quantity import FIELDS, LENGTH, PRESSURE, VELOCITY, Quantity
from sph.scene import Scene
from sph.state import State

# To be raised with every change of what the datasets mean.
FORMAT_VERSION = 1

NAME = re.compile(r"frame_(\d{8,})\.h5")

# Datasets of a frame, with the shape of each; "pressure" and those of gas are in every frame.
CONTENTS = {
    "position": (Quantity("position", LENGTH), "(D, N)"),
    "velocity": (Quantity("velocity", VELOCITY), "(D, N)"),
    "mass": (Quantity("mass", "mass"), "(N,)"),
    "density": (FIELDS["density"], "(N,)"),
    "internal_energy": (FIELDS["internal_energy"], "(N,)"),
    "pressure": (FIELDS["pressure"], "(N,)"),
    "support": (Quantity("support radius, where the kernel becomes zero", LENGTH), "(N,)"),
    "deviatoric_stress": (Quantity("deviatoric stress of a solid", PRESSURE), "(D, D, N)"),
    "plastic_strain": (Quantity("equivalent plastic strain of a solid"), "(N,)"),
    "body": (Quantity("number of the body, if there are several"), "(N,)"),
}
OF_ALL = tuple(CONTENTS)[:7]

# Magnitudes for which single precision keeps seven digits, also of values 1e8 times smaller.
SMALLEST, LARGEST = 1e-30, 1e38
# Values whose range is a smaller part of their size are stored as offsets from the middle: of a
# wave of 1e-6 of the density, single precision alone would leave one digit.
SMALL_RANGE = 0.1


@dataclass
class Frame:
    """What pictures show of the state at the end of a step."""

    particles: State
    pressure: np.ndarray  # (N,)
    time: float
    step: int
    config: Config


@dataclass(frozen=True)
class Frames:
    """The directory of the frames of a run, which exists only if the run writes frames."""

    path: Path

    def path_of(self, step: int) -> Path:
        """Return the path of the frame of a step."""
        return self.path / f"frame_{step:08d}.h5"

    def paths(self) -> list[Path]:
        """Return the existing frames in the order of steps."""
        return list(self._by_step().values())

    def up_to(self, step: int) -> list[Path]:
        """Return the existing frames of `step` and earlier ones."""
        return [path for number, path in self._by_step().items() if number <= step]

    @contextmanager
    def held(self) -> Iterator[None]:
        """Make the directory, and write frames within the block only to it. Raises FileError."""
        refuse_link(self.path)
        with explained(f"cannot write to {self.path}"):
            self.path.mkdir(exist_ok=True)
        with holding_directory(self.path):
            yield

    def drop_after(self, step: int) -> None:
        """Remove frames of later steps and unfinished files. Raises FileError."""
        if not self.path.is_dir():
            return
        refuse_link(self.path)
        with explained(f"cannot remove frames in {self.path}"):
            for number, path in self._by_step().items():
                if number > step:
                    path.unlink()
            remove_unfinished(self.path)

    def _by_step(self) -> dict[int, Path]:
        found = self.path.iterdir() if self.path.is_dir() else ()
        named = [(NAME.fullmatch(path.name), path) for path in found]
        return dict(sorted((int(name[1]), path) for name, path in named if name))


def write(path: Path, particles: State, pressure: np.ndarray, time: float, step: int) -> None:
    """Write a frame to `path` atomically. Raises FileError."""
    arrays = {name: particles.get(name) for name in CONTENTS} | {"pressure": pressure}
    with replacing(path) as unfinished, PatientFile(unfinished) as disk:
        with h5py.File(disk, "w") as file:
            root = file["/"].id
            hdf5.write_attributes(
                root, {"format_version": FORMAT_VERSION, "time": time, "step": step}
            )
            for name, array in arrays.items():
                if array is not None:
                    offset, rest = _in_single_precision(array)
                    dataset = hdf5.write_dataset(root, name, rest)
                    hdf5.write_attributes(dataset, {"offset": offset})
        seal(disk)
        disk.raise_failure()


def read(path: Path, config: Config) -> Frame:
    """Return the frame in `path`, with fields in double precision; config: that of the run.

    Raises Damaged if its content is not what was written, and FileError if it is missing or cannot
    be read.
    """
    path = Path(path)
    try:
        with opened(path) as file:
            arrays, attributes = _content(file)
        number = arrays["mass"].size
        if {array.shape[-1] for array in arrays.values()} != {number}:
            raise ValueError("the numbers of particles differ")
        pressure = arrays["pressure"]
        return Frame(
            State(Scene(config).fields, arrays), pressure, float(attributes["time"]),
            int(attributes["step"]), config,
        )  # fmt: skip
    except FileNotFoundError:
        raise FileError(f"{path}: frame not found.\nTry: `ls {path.parent}`.") from None
    except (OSError, KeyError, ValueError) as error:
        raise Damaged(
            f"{path} is not a whole frame ({error}).\nTry: without this file, which no restart "
            "needs."
        ) from error


def _content(file) -> tuple[dict[str, np.ndarray], dict]:
    """Return the datasets in double precision, and the attributes. Raises ValueError, KeyError."""
    if not is_sealed(file):
        raise ValueError("there is no SHA-256 at its end")
    with h5py.File(file, "r") as found:
        if found.attrs["format_version"] != FORMAT_VERSION:
            raise ValueError(f"its format is not {FORMAT_VERSION}, the one that this sph reads")
        arrays = {
            name: found[name][()] + np.asarray(found[name].attrs["offset"])[..., None]
            for name in CONTENTS
            if name in OF_ALL or name in found
        }
        return arrays, dict(found.attrs)


def _in_single_precision(array: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return an offset for each component, often zero, and the rest (…, N).

    In double precision where single precision has no such numbers, such as masses in g.
    """
    low, high = array.min(axis=-1), array.max(axis=-1)
    middle = 0.5 * low + 0.5 * high
    offset = np.where(high - low < SMALL_RANGE * np.abs(middle), middle, 0.0)
    rest = array - offset[..., None]
    largest = np.abs(rest).max()
    fits = largest == 0.0 or SMALLEST < largest < LARGEST
    return offset, rest.astype(np.float32) if fits else rest
