"""Checkpoints: HDF5 files with the exact state for a restart, readable by other tools.

The state is in the private group /Checkpoint, beside the public groups of `sph.output.layout`.
Its datasets are the numerical state and nothing else, so two runs that agree have equal datasets;
what is text (configuration, versions, lineage, hashes) is attributes. Nothing that varies from run
to run is written: equal checkpoints are equal files, byte by byte.
"""

import functools
import hashlib
import importlib.metadata
import io
import json
import platform
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from sph import config as configuration
from sph import extensions, fingerprint
from sph.config import outside
from sph.errors import ConfigError, FileError
from sph.output import hdf5, layout, stored, validity
from sph.output.files import Damaged, PatientFile, is_sealed, opened, replacing, seal
from sph.output.stored import GROUP, Refused
from sph.scene import Scene
from sph.state import State
from sph.totals import Baseline, Budget
from sph.version import __version__

# To be raised with every change of what the datasets of /Checkpoint mean.
FORMAT_VERSION = 2

# Fields of earlier versions, which no step needs any more.
RETIRED = {"stress_rate"}

NOT_PARTICLES = ("time", "step", "next_step", "list_position", "list_support", "list_skin")

# Last in the lineage of a file that contains only some particles, which cannot be restarted.
PART = "a particle that failed and its neighbours, alone"

START_ELSEWHERE = "Try: an earlier checkpoint of the run, or start the run again."


@dataclass
class Checkpoint:
    """The state at the end of a step, and all that a restart needs to continue bit for bit."""

    particles: State
    time: float
    step: int  # steps done
    next_step: float  # dt of the next step, before it is cut to end at an output
    list_position: np.ndarray  # (D, N) where the neighbour lists were built
    list_support: np.ndarray  # (N,) H with which they were built
    list_skin: float  # their skin, as a fraction of H
    config: configuration.Config
    lineage: tuple[str, ...]  # restarts of the run, oldest first
    budget: Budget | None = None  # None: of format 1, which leaves them to the history
    computed_by: str | None = None  # of one that was read: `fingerprint.as_json` of its writer

    @functools.cached_property
    def scene(self) -> Scene:
        """The scene of the configuration."""
        return Scene(self.config)

    @property
    def pressure(self) -> np.ndarray:
        """(N,) pressure of the corrected internal energy, as the formulation understands it."""
        return self.scene.formulation.pressure(self.particles)

    def field(self, name: str) -> np.ndarray:
        """(N,) or (D, N) of the particles, pressure included. Raises KeyError."""
        if name == "pressure":
            return self.pressure
        if (found := self.particles.get(name)) is None:
            raise KeyError(name)
        return found

    def by_id(self, values: np.ndarray) -> np.ndarray:
        """`values`, (N,) or (D, N), in the order of the particles' IDs."""
        return values[..., np.argsort(self.particles.id)]


def write(path: Path, checkpoint: Checkpoint) -> None:
    """Write `checkpoint` to `path` atomically. Raises FileError."""
    state = _state(checkpoint)
    with (
        ThreadPoolExecutor(1) as beside,
        replacing(path) as unfinished,
        PatientFile(unfinished) as disk,
    ):
        digest = beside.submit(state_hash, state)  # while HDF5 waits for the disk
        with h5py.File(disk, "w") as file:
            layout.write_public(file, checkpoint)
            _write_private(hdf5.create_group(file.id, GROUP), checkpoint, state, digest)
        seal(disk)
        disk.raise_failure()


def read(path: Path) -> Checkpoint:
    """Return the checkpoint in `path`, bit for bit as it was written.

    Raises Damaged if its content is not what was written, and FileError if it is missing, cannot be
    read, is not a checkpoint, has another format, or does not hold a valid state.
    """
    path = Path(path)
    try:
        with opened(path) as file:
            state, texts = _stored(path, file)
    except FileNotFoundError:
        raise FileError(
            f"{path}: checkpoint not found.\nTry: `ls {path.parent}` for existing ones."
        ) from None
    _check_hashes(path, state, texts)
    config = _config(path, texts)
    checkpoint = _checkpoint(path, state, config, texts)
    _check_state(path, checkpoint)
    return checkpoint


def hash_of(checkpoint: Checkpoint) -> str:
    """SHA-256 of the state of a checkpoint, whichever file it is in."""
    return state_hash(_state(checkpoint))


def state_hash(state: dict[str, np.ndarray]) -> str:
    """SHA-256 over names, types, shapes and bytes of `state`, whatever the order of its entries."""
    digest = hashlib.sha256()
    for name in sorted(state):
        array = np.asarray(state[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _state(checkpoint: Checkpoint) -> dict[str, np.ndarray]:
    state = {name: np.asarray(getattr(checkpoint, name)) for name in NOT_PARTICLES}
    if checkpoint.budget is not None:
        injected, added, baseline = checkpoint.budget
        values = np.array([injected, added, *baseline])
        state |= {name: values[k] for k, name in enumerate(stored.ENERGIES)}
    return state | checkpoint.particles.arrays()


def _fields(particles: State) -> str:
    """Rank of each stored field, and whether a restart can make it anew, as JSON."""
    return json.dumps({f.name: [f.rank, f.remade] for f in particles.fields if f.stored})


def _write_private(group: h5py.h5g.GroupID, checkpoint: Checkpoint, state, digest) -> None:
    """Write the state; digest: the future of its SHA-256."""
    for name, array in state.items():
        hdf5.write_dataset(group, name, array)  # no checksum of HDF5's: two digests are enough
    text = checkpoint.config.recorded
    hdf5.write_attributes(
        group,
        {
            "format_version": FORMAT_VERSION if checkpoint.budget is not None else 1,
            "fields": _fields(checkpoint.particles),
            "configuration": text,
            "lineage": json.dumps(checkpoint.lineage),
            "sha256": digest.result(),
            "configuration_sha256": _text_hash(text),
            "machine": f"{platform.machine()} {sys.byteorder}-endian",
            "versions": _versions(),
            "computed_by": fingerprint.as_json(),
        },
    )


@functools.cache
def _versions() -> str:
    """The program and what it computes with, as JSON."""
    packages = {name: importlib.metadata.version(name) for name in ("numpy", "numba", "h5py")}
    return json.dumps({"sph": __version__, "python": platform.python_version(), **packages})


def _text_hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _stored(path: Path, file: io.FileIO) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """The datasets and texts of an open file, which HDF5 sees once its digest is right."""
    if file.read(len(stored.SIGNATURE)) != stored.SIGNATURE:
        raise Damaged(
            f"{path} is not an HDF5 file, so not a checkpoint.\n"
            "Try: a file checkpoint_*.h5 from the directory checkpoints of a run."
        )
    sealed = False
    try:
        sealed = is_sealed(file)
        if not sealed:  # by an older version, or cut
            stored.check_apart(file, FORMAT_VERSION)
        return stored.load(file, FORMAT_VERSION)
    except ValueError as error:
        raise _damaged(path, str(error)) from error
    except Refused as refused:
        raise _refusal(path, refused, sealed) from refused


def _damaged(path: Path, what: str) -> Damaged:
    return Damaged(f"{path} is truncated or damaged ({what}).\n{START_ELSEWHERE}")


def _refusal(path: Path, refused: Refused, sealed: bool) -> FileError:
    """The error for what `stored` refused. A file that is as it was written is not damaged."""
    if refused.kind == "format":
        version = int(refused.text)
        age, remedy = (
            ("a newer", "a newer version of sph")
            if version > FORMAT_VERSION
            else ("an older", "the version of sph that wrote it, or start the run again")
        )
        return FileError(
            f"{path} has {age} format ({version}) than this version of sph ({__version__}) reads "
            f"({FORMAT_VERSION}).\nTry: {remedy}."
        )
    if refused.kind == "damaged":
        return _damaged(path, refused.text)
    kind = FileError if sealed else Damaged
    return kind(
        f"{path} is an HDF5 file but not a checkpoint of sph: {refused.text}.\n"
        "Try: a file checkpoint_*.h5 from the directory checkpoints of a run."
    )


def _check_hashes(path: Path, state: dict[str, np.ndarray], texts: dict[str, str]) -> None:
    if state_hash(state) != texts["sha256"]:
        raise _damaged(path, "the state does not match its SHA-256")
    if _text_hash(texts["configuration"]) != texts["configuration_sha256"]:
        raise _damaged(path, "the configuration does not match its SHA-256")


def _check_state(path: Path, checkpoint: Checkpoint) -> None:
    faults = validity.faults_of_shape(checkpoint)
    if not faults and PART not in checkpoint.lineage:  # a part shows numbers that are wrong
        faults = validity.faults_of_value(checkpoint)
    if faults:
        raise _not_of_a_run(path, faults)


def _lineage(path: Path, text: str) -> tuple[str, ...]:
    try:
        lineage = json.loads(text)
    except (ValueError, RecursionError):
        lineage = None
    if not isinstance(lineage, list) or not all(isinstance(one, str) for one in lineage):
        raise _damaged(path, "its lineage is not a list of texts")
    return tuple(lineage)


def _config(path: Path, texts: dict[str, str]) -> configuration.Config:
    try:
        return configuration.from_text(texts["configuration"], f"the configuration in {path}")
    except (ConfigError, RecursionError) as error:
        added = f", with its {extensions.PACKAGE} on the Python path"
        of_users = extensions.PACKAGE in texts.get("computed_by", "")
        sources = [key for key in outside.SOURCES if f"\n{key} = " in texts["configuration"]]
        remedy = f"the version of sph that wrote it{added * of_users}"
        if sources:
            remedy = "the problem as it was (of a file, problem.py in the run directory is a copy)"
        raise FileError(
            f"{path} has a configuration that is invalid in this version of sph ({__version__}): "
            f"{error}\nTry: {remedy}, or start the run again."
        ) from error


def _checkpoint(path: Path, state: dict, config, texts: dict[str, str]) -> Checkpoint:
    budget = None
    if stored.ENERGIES[0] in state:
        injected, added, *baseline = (float(state.pop(name)) for name in stored.ENERGIES)
        budget = Budget(injected, added, Baseline(*baseline))
    others = {name: state.pop(name) for name in NOT_PARTICLES}
    scene = Scene(config)
    for name in RETIRED - {field.name for field in scene.fields}:
        state.pop(name, None)
    _check_fields(path, state, scene, texts.get("fields"))
    found = Checkpoint(
        particles=State(scene.fields, state),
        time=float(others["time"]),
        step=int(others["step"]),
        next_step=float(others["next_step"]),
        list_position=others["list_position"],
        list_support=others["list_support"],
        list_skin=float(others["list_skin"]),
        config=config,
        lineage=_lineage(path, texts["lineage"]),
        budget=budget,
        computed_by=texts.get("computed_by"),
    )
    found.scene = scene
    return found


def _check_fields(path: Path, arrays: dict, scene: Scene, fields: str | None) -> None:
    """Raise FileError where the fields are not those of the scene, but for what can be remade."""
    remade = set(stored.OF_SOME_SCENES[1:])  # of format 1
    if fields is not None:
        remade = {name for name, (_, one) in stored.fields_of(fields).items() if one}
    needed = {field.name for field in scene.fields if field.stored}
    faults = [
        f"{name} is missing, which contradicts its configuration"
        for name in sorted(needed - arrays.keys() - {f.name for f in scene.fields if f.remade})
    ] + [
        f"{name} is present, which contradicts its configuration"
        for name in sorted(arrays.keys() - needed - remade)
    ]
    if faults:
        raise _not_of_a_run(path, faults)


def _not_of_a_run(path: Path, faults: list[str]) -> FileError:
    return FileError(
        f"{path} does not hold the state of a run: {'; '.join(faults)}.\n{START_ELSEWHERE}"
    )
