"""The low-level writers give the files that h5py's own methods give."""

import io

import h5py
import numpy as np
import pytest

from sph.output import hdf5

ATTRIBUTES = {
    "one number": np.array([1.5]),
    "six": np.zeros(6),
    "whole": np.array([3]),
    "unsigned": np.arange(6, dtype=np.uint32),
    "number": 2,
    "fraction": 0.25,
    "of NumPy": np.float64(0.1),
    "name": np.bytes_("wendland_c2"),
    "text": "résumé\nof it",
    "empty": "",
}
ARRAYS = {
    "vector": np.arange(12.0).reshape(2, 6),
    "transposed": np.arange(12.0).reshape(2, 6).T,
    "part": np.arange(12)[::2],
    "scalar": np.asarray(0.1),
    "none": np.zeros((2, 0)),
}


def written(fill) -> bytes:
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        fill(file)
    return content.getvalue()


def test_attributes_equal_those_of_h5py():
    def ours(file):
        hdf5.write_attributes(hdf5.create_group(file.id, "Header"), ATTRIBUTES)

    assert written(ours) == written(
        lambda file: file.create_group("Header").attrs.update(ATTRIBUTES)
    )


@pytest.mark.parametrize("name", ARRAYS)
def test_dataset_equals_that_of_h5py(name):
    array = ARRAYS[name]
    assert written(lambda file: hdf5.write_dataset(file.id, "a", array)) == written(
        lambda file: file.create_dataset("a", data=array)
    )


@pytest.mark.parametrize("name", ["vector", "transposed", "part"])
@pytest.mark.parametrize("rows", [1, 2, 4, 5, 100])
def test_checked_dataset_equals_that_of_h5py(name, rows):
    """Written part by part, whether or not a number of chunks fills the dataset."""
    array, asked = ARRAYS[name], []
    chunks = (min(rows, len(array)), *array.shape[1:])

    def theirs(file):
        file.create_dataset("a", data=array, chunks=chunks, fletcher32=True, rdcc_nbytes=0)

    def part(first, last):
        asked.append(last - first)
        return array[first:last]

    def ours(file):
        hdf5.write_checked(file.id, "a", part, len(array), rows)

    assert written(ours) == written(theirs)
    assert max(asked) <= rows


def test_links_equal_those_of_h5py():
    def theirs(file):
        file["Density"] = h5py.SoftLink("/PartType0/Densities")

    assert written(lambda file: hdf5.link(file.id, "Density", "/PartType0/Densities")) == written(
        theirs
    )
