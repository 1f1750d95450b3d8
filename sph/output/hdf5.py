"""Groups, datasets and attributes of HDF5, written with few calls.

A checkpoint has about 120 small attributes. h5py's `attrs` spends 28 microseconds on each, which
was half of what the checkpoint of a small run cost; the low-level calls take 9. The file is byte by
byte the one that h5py's `attrs.update`, `create_group` and `create_dataset` write.
"""

import functools
from collections.abc import Callable, Mapping

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5p, h5s, h5t

TEXT = h5py.string_dtype()


def create_group(parent: h5g.GroupID, name: str) -> h5g.GroupID:
    """A new group in the group or file `parent`: both are what h5py's objects have as `id`."""
    return h5g.create(parent, name.encode())


def write_attributes(owner: h5g.GroupID | h5d.DatasetID, attributes: Mapping[str, object]) -> None:
    """Attach new attributes: numbers, arrays of numbers, np.bytes_ (ASCII) and str (UTF-8)."""
    for name, value in attributes.items():
        kind = TEXT if isinstance(value, str) else None
        data = np.asarray(value, dtype=kind, order="C")
        stored, in_memory = _text_types() if kind else _types(data.dtype)
        attribute = h5a.create(owner, name.encode(), stored, _space(data.shape))
        attribute.write(data, mtype=in_memory)


def write_dataset(group: h5g.GroupID, name: str, array: np.ndarray) -> h5d.DatasetID:
    """A new dataset."""
    data = np.asarray(array, order="C")
    stored, in_memory = _types(data.dtype)
    plan = _plan_of_dataset(None)
    dataset = h5d.create(group, name.encode(), stored, _space(data.shape), dcpl=plan)
    dataset.write(h5s.ALL, h5s.ALL, data, mtype=in_memory)
    return dataset


def write_checked(
    group: h5g.GroupID, name: str, part: Callable[[int, int], np.ndarray], number: int, longest: int
) -> h5d.DatasetID:
    """A new dataset of `number` rows that is checked when it is read (Fletcher-32).

    part(first, last) returns rows [first, last). A chunk has up to `longest` rows. Chunks are asked
    for and written one after another, so that all rows never exist at once.
    """
    chunk = min(number, longest)
    data = np.asarray(part(0, chunk), order="C")
    shape, (stored, in_memory) = (number, *data.shape[1:]), _types(data.dtype)
    plan = _plan_of_dataset(data.shape)
    dataset = h5d.create(group, name.encode(), stored, _space(shape), dcpl=plan, dapl=_uncached())
    if chunk == number:
        dataset.write(h5s.ALL, h5s.ALL, data, mtype=in_memory)
        return dataset
    space = h5s.create_simple(shape)
    for first in range(0, number, chunk):
        if first > 0:
            del data  # before the next part exists
            data = np.asarray(part(first, min(first + chunk, number)), order="C")
        space.select_hyperslab((first, *(0 for _ in shape[1:])), data.shape)
        dataset.write(_space(data.shape), space, data, mtype=in_memory)
    return dataset


def link(group: h5g.GroupID, name: str, target: str) -> None:
    """A soft link to the path `target`."""
    group.links.create_soft(name.encode(), target.encode())


# Types, shapes and plans belong to no file: each is made once.


@functools.cache
def _types(kind: np.dtype) -> tuple[h5t.TypeID, h5t.TypeID]:
    """Of numbers and ASCII: the type in the file and the one in memory."""
    return h5t.py_create(kind, logical=True), h5t.py_create(kind)


@functools.cache
def _text_types() -> tuple[h5t.TypeID, h5t.TypeID]:
    """Of str, which NumPy holds as objects."""
    return _types.__wrapped__(TEXT)


@functools.cache
def _uncached() -> h5p.PropDAID:
    """The access to a dataset that writes each chunk at once; HDF5 would keep 8 MB in memory."""
    access = h5p.create(h5p.DATASET_ACCESS)
    access.set_chunk_cache(1, 0, 1.0)
    return access


@functools.lru_cache(64)
def _space(shape: tuple[int, ...]) -> h5s.SpaceID:
    return h5s.create_simple(shape)


@functools.lru_cache(64)
def _plan_of_dataset(chunks: tuple[int, ...] | None) -> h5p.PropDCID:
    plan = h5p.create(h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)  # equal datasets are equal bytes
    if chunks is not None:
        plan.set_chunk(chunks)
        plan.set_fletcher32()
    return plan
