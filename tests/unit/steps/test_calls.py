"""Calls by address: arguments of all kinds, results, and what cannot be held."""

from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

from sph.steps.calls import RESULTS, Held, Table, Unsuitable, address, call, words_of


class Pair(NamedTuple):
    scale: float
    name: object


@njit
def run(calls, words):
    status = 0
    for k in range(calls.shape[0]):
        status += call(calls[k, 0], words.ctypes.data + 8 * calls[k, 1])
    return status


@njit
def mixed(first, flag, missing, pair, vectors, tensors, written):
    D, n = vectors.shape
    for i in range(n):
        written[i] = first + pair.scale * vectors[D - 1, i] + tensors[0, D - 1, i]
        if flag and missing is None:
            written[i] += 100.0
    return written.sum(), n


@njit
def failing(number):
    if number > 1.0:
        raise ValueError("too large")
    return number


@njit
def with_default(number, other=2.0):
    return number + other


@njit
def returns_array(number):
    return np.full(2, number)


def result(words, calls, k=0):
    begin = calls[k, 1] + 1
    return words[begin : begin + RESULTS]


@njit
def takes_text(text):
    return float(len(text))


def test_arguments_of_all_kinds_arrive():
    vectors, tensors = np.arange(6.0).reshape(2, 3), np.ones((2, 2, 3))
    written, expected = np.empty(3), np.empty(3)
    arguments = 3, True, None, Pair(0.5, None), vectors[:, ::1], tensors
    total, number = mixed(*arguments, expected)
    table = Table()
    table.add(mixed, *arguments, written)
    words, calls = table.finished()
    assert run(calls, words) == 0
    assert written.tolist() == expected.tolist()
    assert result(words, calls).view(np.float64)[0] == total
    assert result(words, calls)[1] == number


def test_strided_array_and_entry_of_tuple_are_held_by_name():
    vectors = np.arange(12.0).reshape(2, 6)[:, ::2]
    written, other = np.zeros(3), np.zeros(3)
    pair = Pair(Held("scale", 0.5), None)
    table = Table()
    table.add(mixed, 0, False, None, Held("pair", pair), vectors, np.ones((2, 2, 3)),
              Held("written", written))  # fmt: skip
    words, calls = table.finished()
    run(calls, words)
    assert written.tolist() == (0.5 * vectors[1] + 1.0).tolist()
    words.view(np.float64)[table.places["scale"]] = 2.0
    words[table.places["written"]] = address(other)
    run(calls, words)
    assert other.tolist() == (2.0 * vectors[1] + 1.0).tolist()
    (place,) = table.places["pair"]
    found = words_of(Pair(4.0, None))
    words[place : place + len(found)] = found
    run(calls, words)
    assert other.tolist() == (4.0 * vectors[1] + 1.0).tolist()


def test_exception_is_a_status():
    table = Table()
    table.add(failing, 0.5)
    words, calls = table.finished()
    assert run(calls, words) == 0
    assert result(words, calls).view(np.float64)[0] == 0.5
    table.add(failing, 2.0)
    words, calls = table.finished()
    assert run(calls, words) != 0


@pytest.mark.parametrize(
    ("function", "arguments"),
    [(with_default, (1.0,)), (returns_array, (1.0,)), (takes_text, ("text",)), (mixed, (1.0,))],
)
def test_calls_that_cannot_be_held(function, arguments):
    with pytest.raises(Unsuitable):
        Table().add(function, *arguments)
