"""What the group /Checkpoint of an HDF5 file holds, read so that no file can do harm.

Only what `sph.output.checkpoint` writes is read: each link, dataset and attribute is judged before
HDF5 follows or fills it. HDF5 itself crashes, hangs or takes all memory on some damaged files. A
file without a digest is therefore read by a child process first, under limits: this file alone,
run as a script, so it imports nothing of sph.
"""

import io
import json
import os
import resource
import subprocess
import sys

import h5py
import numpy as np

GROUP = "Checkpoint"
SIGNATURE = b"\x89HDF\r\n\x1a\n"

# Number of axes of each dataset; all are float64 but those of INTEGERS.
SCALARS = ("time", "step", "next_step", "list_skin")
VECTORS = ("position", "velocity", "acceleration", "list_position")
LISTS = ("id", "mass", "internal_energy", "support", "density", "omega", "energy_rate",
         "list_support")  # fmt: skip
OF_SOME_SCENES = ("alpha", "alpha_rate", "pressure")
AXES = {
    **dict.fromkeys(SCALARS, 0),
    **dict.fromkeys((*LISTS, *OF_SOME_SCENES), 1),
    **dict.fromkeys(VECTORS, 2),
}
INTEGERS = ("id", "step")
TEXTS = ("configuration", "lineage", "sha256", "configuration_sha256")
LATER_TEXTS = ("computed_by",)  # which the first files did not have

# What h5py raises on a damaged file, by where in it the damage is.
DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError)

# Limits of the child process: seconds and bytes, for the smallest file and for each of its bytes.
SECONDS, SECONDS_A_BYTE = 5.0, 1 / 20e6
MEMORY, MEMORY_A_BYTE = 256 << 20, 3
# How much longer than its processor seconds it may take, on a machine that others use too.
PATIENCE = 6


class Refused(Exception):
    """Why a file is not read; kind: "damaged", "foreign" or "format" (the text is its number)."""

    def __init__(self, kind: str, text: str):
        super().__init__(text)
        self.kind, self.text = kind, text


def load(file: io.FileIO, version: int) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """The datasets and the texts of /Checkpoint. Raises Refused; version: the format known here.

    HDF5 reads through `file`: it takes no lock, and opens no other file.
    """
    try:
        with h5py.File(file, "r") as opened:
            group = _group(opened, version)
            size = os.fstat(file.fileno()).st_size
            datasets = _datasets(group)
            for name, dataset in datasets.items():
                _check(name, dataset, size)
            if sum(one.nbytes for one in datasets.values()) > size:
                raise Refused("foreign", "its datasets are larger than the file")
            later = [one for one in LATER_TEXTS if h5py.h5a.exists(group.id, one.encode())]
            texts = {name: _attribute(group, name, str) for name in (*TEXTS, *later)}
            return {name: dataset[()] for name, dataset in datasets.items()}, texts
    except DAMAGE as error:
        raise Refused("damaged", str(error)) from error


def check_apart(file: io.FileIO, version: int) -> None:
    """Read the file in a process of its own, under limits. Raises Refused."""
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
        raise Refused("damaged", "HDF5 does not come to an end with it") from None
    if child.returncode == 0:
        return
    try:
        raise Refused(*json.loads(child.stdout))
    except (ValueError, TypeError):
        raise Refused("damaged", "HDF5 fails at it, or wants too much time or memory") from None


def _group(file: h5py.File, version: int) -> h5py.Group:
    name = GROUP.encode()
    if name not in file.id or not _is_hard(file.id, name):
        raise Refused("foreign", f"it has no group /{GROUP}")
    group = h5py.Group(h5py.h5g.open(file.id, name))
    if not h5py.h5a.exists(group.id, b"format_version"):
        raise Refused("foreign", f"/{GROUP} has no format_version")
    found = int(_attribute(group, "format_version", int))
    if found != version:
        raise Refused("format", str(found))
    return group


def _datasets(group: h5py.Group) -> dict[str, h5py.Dataset]:
    """The datasets of /Checkpoint, not read yet."""
    there = {name for name in AXES if name.encode() in group.id}
    missing = AXES.keys() - there - set(OF_SOME_SCENES)
    if missing or group.id.get_num_objs() != len(there):
        lacks = f": {', '.join(sorted(missing))} missing" if missing else ""
        raise Refused("foreign", f"/{GROUP} has not the datasets of a checkpoint{lacks}")
    for name in there:
        if not _is_hard(group.id, name.encode()):
            raise Refused("foreign", f"{name} is a link to somewhere else")
    return {name: h5py.Dataset(h5py.h5d.open(group.id, name.encode())) for name in sorted(there)}


def _is_hard(parent, name: bytes) -> bool:
    return parent.links.get_info(name).type == h5py.h5l.TYPE_HARD


def _check(name: str, dataset: h5py.Dataset, size: int) -> None:
    """Raise Refused where the dataset is not of the kind that checkpoints have."""
    kind = np.dtype(np.int64 if name in INTEGERS else np.float64)
    if dataset.dtype != kind or dataset.id.get_type().get_size() != kind.itemsize:
        raise Refused("foreign", f"{name} is of type {dataset.dtype.str}, expected {kind.str}")
    if len(dataset.shape or ()) != AXES[name] or dataset.shape is None:
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
        raise Refused("foreign", f"the attribute {name} is not one {kind.__name__}")
    return group.attrs[name]


def _limit(size: int, seconds: float) -> None:
    """Set the limits of this process, which has imported all it needs."""
    limits = {resource.RLIMIT_CPU: int(seconds) + 1, resource.RLIMIT_CORE: 0}
    try:
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        limits[resource.RLIMIT_AS] = used + MEMORY + MEMORY_A_BYTE * size
    except OSError:
        pass  # no such account on this system: the time alone is limited
    for which, most in limits.items():
        hard = resource.getrlimit(which)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(which, (most, hard))


def main() -> int:
    """Read the file on standard input; says on standard output why not, as JSON."""
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
