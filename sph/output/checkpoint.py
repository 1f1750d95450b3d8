"""Checkpoints: one HDF5 file with the exact state for a restart, which other tools can read too.

The state is in the private group /Checkpoint, beside the public groups of `sph.output.layout`.
Its datasets are the numerical state and nothing else, so two runs that agree have equal datasets;
what is text (configuration, versions, lineage, hashes) is attributes. Nothing that varies from run
to run is written: equal checkpoints are equal files, byte by byte.
"""

import hashlib
import importlib.metadata
import json
import platform
import sys
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from sph import config as configuration
from sph import fingerprint
from sph.errors import ConfigError, FileError
from sph.output import layout
from sph.output.files import PatientFile, replacing
from sph.particles import Particles
from sph.shell_words import quoted
from sph.version import __version__

# To be raised with every change of what the datasets of /Checkpoint mean.
FORMAT_VERSION = 1

GROUP = "Checkpoint"
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
NOT_PARTICLES = ("time", "step", "next_step", "list_position", "list_support", "list_skin")

# What h5py raises on a damaged file, by where in it the damage is.
DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError)

START_ELSEWHERE = "Try: an earlier checkpoint of the run, or start the run anew."


@dataclass
class Checkpoint:
    """The state at the end of a step, and all that a restart needs to go on bit for bit."""

    particles: Particles
    time: float
    step: int  # steps done
    next_step: float  # dt of the coming step, before it is cut to land on an output
    list_position: np.ndarray  # (D, N) where the neighbour lists were built
    list_support: np.ndarray  # (N,) H with which they were built
    list_skin: float  # their skin, as a fraction of H
    config: configuration.Config
    lineage: tuple[str, ...]  # the runs it came from, oldest first
    computed_by: str | None = None  # of one that was read: `fingerprint.as_json` of its writer

    @property
    def pressure(self) -> np.ndarray:
        """(N,) pressure of the corrected internal energy, as the scheme understands it."""
        return self.particles.pressure_by(self.config.physics.eos_model())

    def field(self, name: str) -> np.ndarray:
        """(N,) or (D, N) of the particles, pressure included."""
        return self.pressure if name == "pressure" else getattr(self.particles, name)

    def by_id(self, values: np.ndarray) -> np.ndarray:
        """`values`, (N,) or (D, N), in the order of the particles' IDs."""
        return values[..., np.argsort(self.particles.id)]


def write(path: Path, checkpoint: Checkpoint) -> None:
    """Write `checkpoint` to `path`: the whole file or, after an error or a kill, none of it.

    Raises FileError where the file system refuses.
    """
    with replacing(Path(path)) as unfinished, PatientFile(unfinished) as disk:
        with h5py.File(disk, "w") as file:
            layout.write_public(file, checkpoint)
            _write_private(file.create_group(GROUP), checkpoint)
        disk.raise_failure()


def read(path: Path) -> Checkpoint:
    """The checkpoint in `path`, bit for bit as it was written.

    Raises FileError where it is missing, not a checkpoint, truncated, damaged or of another format.
    """
    path = Path(path)
    _refuse_what_is_not_hdf5(path)
    try:
        file = h5py.File(path, "r")
    except DAMAGE as error:
        raise FileError(f"{path} is truncated or damaged.\n{START_ELSEWHERE}") from error
    with file:
        try:
            group = _private_group(path, file)
            state = {name: dataset[()] for name, dataset in group.items()}
            attributes = dict(group.attrs)
            _check_hashes(state, attributes)
            config = _config(path, attributes["configuration"])
            found = _checkpoint(state, config, tuple(json.loads(attributes["lineage"])))
            found.computed_by = attributes.get("computed_by")
            return found
        except DAMAGE as error:
            raise FileError(f"{path} is damaged ({error}).\n{START_ELSEWHERE}") from error


def state_hash(state: dict[str, np.ndarray]) -> str:
    """SHA-256 over names, types, shapes and bytes of `state`, whatever the order of its entries."""
    digest = hashlib.sha256()
    for name in sorted(state):
        array = np.asarray(state[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _write_private(group: h5py.Group, checkpoint: Checkpoint) -> None:
    state = {name: np.asarray(getattr(checkpoint, name)) for name in NOT_PARTICLES}
    state |= checkpoint.particles.arrays()
    for name, array in state.items():
        if array.ndim:
            layout.write_array(group, name, array)
        else:
            group.create_dataset(name, data=array)
    text = checkpoint.config.to_toml(include_run=False)
    group.attrs.update(
        {
            "format_version": FORMAT_VERSION,
            "configuration": text,
            "lineage": json.dumps(checkpoint.lineage),
            "sha256": state_hash(state),
            "configuration_sha256": _text_hash(text),
            "machine": f"{platform.machine()} {sys.byteorder}-endian",
            "versions": _versions(),
            "computed_by": fingerprint.as_json(),
        }
    )


def _versions() -> str:
    """The program and what it computes with, as JSON."""
    packages = {name: importlib.metadata.version(name) for name in ("numpy", "numba", "h5py")}
    return json.dumps({"sph": __version__, "python": platform.python_version(), **packages})


def _text_hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _refuse_what_is_not_hdf5(path: Path) -> None:
    try:
        with path.open("rb") as file:
            beginning = file.read(len(HDF5_SIGNATURE))
    except FileNotFoundError:
        raise FileError(
            f"there is no checkpoint {path}.\nTry: `ls {quoted(path.parent)}` for those there are."
        ) from None
    except OSError as error:
        raise FileError(
            f"cannot read {path}: {error.strerror}.\nTry: the path of a checkpoint_*.h5 file."
        ) from error
    if beginning != HDF5_SIGNATURE:
        raise FileError(
            f"{path} is not an HDF5 file, so not a checkpoint.\n"
            "Try: a file checkpoint_*.h5 from the directory checkpoints of a run."
        )


def _private_group(path: Path, file: h5py.File) -> h5py.Group:
    if GROUP not in file or "format_version" not in file[GROUP].attrs:
        raise FileError(
            f"{path} is an HDF5 file but not a checkpoint of sph: it has no group /{GROUP}.\n"
            "Try: a file checkpoint_*.h5 from the directory checkpoints of a run."
        )
    version = int(file[GROUP].attrs["format_version"])
    if version != FORMAT_VERSION:
        age, remedy = (
            ("a newer", "a newer sph")
            if version > FORMAT_VERSION
            else ("an older", "the sph that wrote it, or start the run anew")
        )
        raise FileError(
            f"{path} is of {age} format ({version}) than this sph {__version__} reads "
            f"({FORMAT_VERSION}).\nTry: {remedy}."
        )
    return file[GROUP]


def _check_hashes(state: dict[str, np.ndarray], attributes: dict) -> None:
    if state_hash(state) != attributes["sha256"]:
        raise ValueError("the state does not match its SHA-256")
    if _text_hash(attributes["configuration"]) != attributes["configuration_sha256"]:
        raise ValueError("the configuration does not match its SHA-256")


def _config(path: Path, text: str) -> configuration.Config:
    try:
        return configuration.from_text(text, f"the configuration in {path}")
    except ConfigError as error:
        raise FileError(
            f"{path} holds a configuration that this sph {__version__} does not take: {error}\n"
            "Try: the sph that wrote it, or start the run anew."
        ) from error


def _checkpoint(state: dict, config, lineage: tuple[str, ...]) -> Checkpoint:
    return Checkpoint(
        time=float(state.pop("time")),
        step=int(state.pop("step")),
        next_step=float(state.pop("next_step")),
        list_position=state.pop("list_position"),
        list_support=state.pop("list_support"),
        list_skin=float(state.pop("list_skin")),
        particles=Particles(**state),
        config=config,
        lineage=lineage,
    )
