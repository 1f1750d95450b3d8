"""Bisection on artificial properties: what it finds, and what it asks for."""

import math

import pytest

from sph.stability.search import DIGITS, Edge, Stride, find

# Two rounded values may each be off by half a unit of their last digit, the first of which is at
# least 1.
ROUNDING = 1.0 + 10.0 ** (1 - DIGITS)
DOUBLING = Stride(2.0, 6)


class RecordedRule:
    """Answers by `rule`, and keeps what it was asked."""

    def __init__(self, rule):
        self.rule, self.batches = rule, []

    def __call__(self, values):
        self.batches.append(list(values))
        return [self.rule(value) for value in values]


@pytest.mark.parametrize("at_once", [1, 2, 5])
@pytest.mark.parametrize("end", [0.1501, 0.31, 0.6, 3.3])
@pytest.mark.parametrize("resolution", [1.1, 1.01])
def test_search_upper_end_lies_between_stable_and_unstable(end, resolution, at_once):
    asked = RecordedRule(lambda value: value <= end)
    inside, outside = find(asked, 0.15, DOUBLING, resolution, at_once)
    assert inside <= end < outside
    assert outside / inside <= resolution * ROUNDING
    assert max(map(len, asked.batches)) <= at_once


def test_search_lower_end_is_bracketed():
    inside, outside = find(RecordedRule(lambda value: value > 0.9), 1.6, Stride(1 / 1.4, 3), 1.1)
    assert outside <= 0.9 < inside
    assert inside / outside <= 1.1 * ROUNDING


def test_search_bisects_no_more_than_resolution_needs():
    asked = RecordedRule(lambda value: value < 0.2)
    find(asked, 0.15, DOUBLING, 1.1)
    # the start, one stride, and halvings of a factor of 2 until 2^(1/2^k) <= 1.1: k = 3
    halvings = math.ceil(math.log2(math.log(2.0) / math.log(1.1)))
    assert len(asked.batches) == 2 + halvings


def test_search_unstable_start_finds_end_below_it():
    inside, outside = find(RecordedRule(lambda value: value < 0.05), 0.15, DOUBLING, 1.1)
    assert inside < 0.05 <= outside < 0.15


def test_search_all_stable_or_all_unstable_has_no_end():
    assert find(RecordedRule(lambda value: True), 1.0, DOUBLING, 1.1) == Edge(64.0, None)
    assert find(RecordedRule(lambda value: False), 1.0, DOUBLING, 1.1) == Edge(None, 1.0)


@pytest.mark.parametrize("at_once", [1, 4])
def test_search_meeting_unstable_gap_ends_there(at_once):
    """Unstable from 1.9 to 4.5, stable to 12: strides to 2 and 4 are in the hole."""
    asked = RecordedRule(lambda value: value < 1.9 or 4.5 < value < 12.0)
    inside, outside = find(asked, 1.0, DOUBLING, 1.1, at_once)
    assert inside < 1.9 <= outside
    assert outside / inside <= 1.1 * ROUNDING


def test_search_unordered_verdicts_ends_between_unlike_neighbours():
    def rule(value):
        return value == 1.0 or int(value * 97) % 3 == 0

    inside, outside = find(RecordedRule(rule), 1.0, DOUBLING, 1.1)
    assert rule(inside)
    assert not rule(outside)
    assert max(inside / outside, outside / inside) <= 1.1 * ROUNDING
