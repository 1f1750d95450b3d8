"""Safe reading of the group /Checkpoint of an HDF5 file, which may be damaged or hostile.

Only what `sph.output.checkpoint` writes is read. Each link, dataset and attribute is checked before
HDF5 follows or reads it. HDF5 itself crashes, hangs or exhausts memory on some damaged files. So a
file without a digest is first read by a child process with limited time and memory. The child runs
this file as a script, which therefore imports nothing of sph.
"""

import io
import json
import os
import re
import resource
import subprocess
import sys

import h5py
import numpy as np

GROUP = "Checkpoint"
SIGNATURE = b"\x89HDF\r\n\x1a\n"

# Number of axes of each dataset. All are float64 except INTEGERS.
SCALARS = ("time", "step", "next_step", "list_skin")
ENERGIES = ("energy_injected", "energy_added", "baseline_energy", "baseline_scale")  # format 2
LISTS = {"list_position": 2, "list_support": 1}
# Fields of every checkpoint, and those that one of format 1 may have; format 2 names its fields.
FIELDS = {
    **dict.fromkeys(
        ("id", "mass", "internal_energy", "support", "density", "omega", "energy_rate"), 1
    ),
    **dict.fromkeys(("position", "velocity", "acceleration"), 2),
}
OF_SOME_SCENES = ("alpha", "alpha_rate", "pressure")
# Names in the list of fields, and their entries: rank, and whether a restart can compute it anew.
NAME = re.compile(r"[a-z][a-z0-9_]{0,60}")
ENTRIES = [(rank, remade) for rank in range(3) for remade in (False, True)]
INTEGERS = ("id", "step")
TEXTS = ("configuration", "lineage", "sha256", "configuration_sha256")
LATER_TEXTS = ("computed_by", "fields")  # missing in the oldest files

# Exceptions of h5py on damaged files.
DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError)

# Limits of the child process in CPU seconds and bytes: a constant, and a part per byte of the file.
SECONDS, SECONDS_A_BYTE = 5.0, 1 / 20e6
MEMORY, MEMORY_A_BYTE = 256 << 20, 3
# Ratio of the wall-clock limit to the CPU limit, for a busy machine.
PATIENCE = 6


class Refused(Exception):
    """A file is refused. kind: "damaged", "foreign" or "format" (its text is the format number)."""

    def __init__(self, kind: str, text: str):
        super().__init__(text)
        self.kind, self.text = kind, text


def load(file: io.FileIO, version: int) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the datasets and the text attributes of /Checkpoint. Raises Refused.

    version: the newest format number that this version of sph reads. HDF5 reads through `file`, so
    it takes no lock and opens no other file.
    """
    try:
        with h5py.File(file, "r") as opened:
            group, found = _group(opened, version)
            size = os.fstat(file.fileno()).st_size
            axes, optional = _axes(group, found)
            datasets = _datasets(group, axes, optional)
            for name, dataset in datasets.items():
                _check(name, axes[name], dataset, size)
            if sum(one.nbytes for one in datasets.values()) > size:
                raise Refused("foreign", "its datasets are larger than the file")
            later = [one for one in LATER_TEXTS if h5py.h5a.exists(group.id, one.encode())]
            texts = {name: _attribute(group, name, str) for name in (*TEXTS, *later)}
            return {name: dataset[()] for name, dataset in datasets.items()}, texts
    except DAMAGE as error:
        raise Refused("damaged", str(error)) from error


def check_apart(file: io.FileIO, version: int) -> None:
    """Read the file in a child process with limited time and memory. Raises Refused."""
    size = os.fstat(file.fileno()).st_size
    seconds = SECONDS + SECONDS_A_BYTE * size
    command = [sys.executable, "-P", __file__, str(version), str(seconds)]
    try:
        child = subprocess.run(
            command,
            stdin=file.fileno(),
            capture_output=True,
            timeout=PATIENCE * seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise Refused("damaged", "HDF5 did not finish reading it in time") from None
    if child.returncode == 0:
        return
    try:
        raise Refused(*json.loads(child.stdout))
    except (ValueError, TypeError):
        raise Refused(
            "damaged", "HDF5 fails to read it, or needs too much time or memory"
        ) from None


def _group(file: h5py.File, version: int) -> tuple[h5py.Group, int]:
    """Return /Checkpoint and the number of its format."""
    name = GROUP.encode()
    if name not in file.id or not _is_hard(file.id, name):
        raise Refused("foreign", f"it has no group /{GROUP}")
    group = h5py.Group(h5py.h5g.open(file.id, name))
    if not h5py.h5a.exists(group.id, b"format_version"):
        raise Refused("foreign", f"/{GROUP} has no format_version")
    found = int(_attribute(group, "format_version", int))
    if not 1 <= found <= version:
        raise Refused("format", str(found))
    return group, found


def _axes(group: h5py.Group, version: int) -> tuple[dict[str, int], set[str]]:
    """Return the number of axes of each dataset, and the names of those that may be missing."""
    known = {**dict.fromkeys(SCALARS, 0), **LISTS, **FIELDS}
    if version == 1:
        return known | dict.fromkeys(OF_SOME_SCENES, 1), set(OF_SOME_SCENES)
    named = fields_of(_attribute(group, "fields", str))
    axes = {name: rank + 1 for name, (rank, _) in named.items()}
    for name in FIELDS.keys() & axes.keys():
        if axes[name] != FIELDS[name]:
            raise Refused("foreign", f"the field {name} is of rank {axes[name] - 1}")
    return {**dict.fromkeys((*SCALARS, *ENERGIES), 0), **LISTS, **axes}, set()


def fields_of(text: str) -> dict[str, tuple[int, bool]]:
    """Return rank, and whether it may be missing, of each field in a JSON text."""
    try:
        found = {name: tuple(entry) for name, entry in json.loads(text).items()}
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise Refused("foreign", "its list of fields is not a JSON object") from None
    reserved = {*SCALARS, *ENERGIES, *LISTS}
    for name, entry in found.items():
        if not NAME.fullmatch(name) or name in reserved or entry not in ENTRIES:
            raise Refused("foreign", f"its list of fields has a wrong name or rank: {name[:60]!a}")
    return {name: (int(rank), bool(remade)) for name, (rank, remade) in found.items()}


def _datasets(
    group: h5py.Group, axes: dict[str, int], optional: set[str]
) -> dict[str, h5py.Dataset]:
    """Return the datasets of /Checkpoint, not yet read."""
    there = {name for name in axes if name.encode() in group.id}
    missing = axes.keys() - there - optional
    if missing or group.id.get_num_objs() != len(there):
        lacks = f": {', '.join(sorted(missing))} missing" if missing else ""
        raise Refused("foreign", f"/{GROUP} does not hold the datasets of a checkpoint{lacks}")
    for name in there:
        if not _is_hard(group.id, name.encode()):
            raise Refused("foreign", f"{name} is a link to another place")
    return {name: h5py.Dataset(h5py.h5d.open(group.id, name.encode())) for name in sorted(there)}


def _is_hard(parent, name: bytes) -> bool:
    return parent.links.get_info(name).type == h5py.h5l.TYPE_HARD


def _check(name: str, axes: int, dataset: h5py.Dataset, size: int) -> None:
    """Raise Refused if type, shape, filters or storage differ from those of a checkpoint."""
    kind = np.dtype(np.int64 if name in INTEGERS else np.float64)
    if dataset.dtype != kind or dataset.id.get_type().get_size() != kind.itemsize:
        raise Refused("foreign", f"{name} is of type {dataset.dtype.str}, expected {kind.str}")
    if len(dataset.shape or ()) != axes or dataset.shape is None:
        raise Refused("foreign", f"{name} has the shape {dataset.shape}")
    plan = dataset.id.get_create_plist()
    filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
    if filters not in ([], [h5py.h5z.FILTER_FLETCHER32]):
        raise Refused("foreign", f"{name} is compressed or filtered")
    layout = plan.get_layout()
    if layout not in (h5py.h5d.COMPACT, h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED) or (
        plan.get_external_count()
    ):
        raise Refused("foreign", f"{name} is stored in another file")
    if layout == h5py.h5d.CHUNKED and np.prod(plan.get_chunk(), dtype=float) * 8 > size:
        raise Refused("foreign", f"{name} has chunks larger than the file")
    if dataset.id.get_storage_size() < dataset.nbytes:
        raise Refused("foreign", f"{name} is not stored in full")


def _attribute(group: h5py.Group, name: str, kind: type):
    attribute = h5py.h5a.open(group.id, name.encode())
    fits = (
        h5py.check_string_dtype(attribute.dtype) is not None
        if kind is str
        else attribute.dtype.kind in "iu"
    )
    if attribute.shape != () or not fits:
        raise Refused("foreign", f"the attribute {name} is not a single {kind.__name__}")
    return group.attrs[name]


def _limit(size: int, seconds: float) -> None:
    """Limit the time and memory of this process, after its imports."""
    limits = {resource.RLIMIT_CPU: int(seconds) + 1, resource.RLIMIT_CORE: 0}
    try:
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        limits[resource.RLIMIT_AS] = used + MEMORY + MEMORY_A_BYTE * size
    except OSError:
        pass  # this system has no /proc: only the time is limited
    for which, most in limits.items():
        hard = resource.getrlimit(which)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(which, (most, hard))


def main() -> int:
    """Read the file on standard input; print the reason for a refusal as JSON."""
    version, seconds = int(sys.argv[1]), float(sys.argv[2])
    _limit(os.fstat(0).st_size, seconds)
    try:
        with io.FileIO(0, closefd=False) as file:
            load(file, version)
    except Refused as refused:
        print(json.dumps([refused.kind, refused.text]))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
