"""Order, lists and selection against brute force: nothing within reach may be missing, ever."""

from itertools import pairwise, product

import dense
import numpy as np
import pytest
from marks import slow_except
from numba import njit

from sph import simd
from sph.compiled import FLAGS
from sph.domain import Domain
from sph.errors import NumericalError
from sph.neighbours import first_guess, lists, order
from sph.neighbours.lists import SUPERBLOCK
from sph.neighbours.order import BLOCK
from sph.neighbours.search import (
    BUILD_OVER_PASSES,
    COPYING,
    GROWTH,
    WIDTH,
    Origin,
    Search,
    best_skin,
)
from sph.passes import Neighbours
from sph.passes.gather import (
    copy_box,
    largest_of,
    longest_list,
    near_blocks,
    near_particles,
    own_box,
    place_block,
    scratch,
    unit,
    unpacked,
)
from sph.simd import at
from sph.threads import Team

SHAPES = ["random", "clustered", "line", "plane", "equal_coordinates", "coincident"]
BOUNDARIES = [("mirror",), ("periodic", "mirror"), ("open", "periodic", "mirror")]


class EagerTeam(Team):
    """Hands over even a single item, which real teams find too little."""

    def run(self, function, items, *arguments, smallest=1):
        return super().run(function, items, *arguments, smallest=1)


def positions(shape, dimension, count, seed=1):
    """(D, N) in the unit box."""
    random = np.random.default_rng(seed)
    x = random.random((dimension, count))
    if shape == "clustered":
        return 0.3 + 0.7 * (x - 0.3) * random.random(count) ** 4
    if shape == "line":  # along a diagonal of the box
        return np.repeat(x[:1], dimension, axis=0)
    if shape == "plane":
        x[-1] = 0.5
    if shape == "equal_coordinates":  # a lattice of four values an axis: several in each place
        return np.floor(4 * x) / 4
    if shape == "coincident":
        return np.full_like(x, 0.25)
    return x


def supports(dimension, count, seed=2):
    """(N,) by a factor ten, few enough neighbours for lists to be worth having."""
    return np.random.default_rng(seed).uniform(0.03, 0.3, count)


def ordered(position, threads=1):
    team = EagerTeam(threads)
    found = order.block_order(position, np.arange(position.shape[1]), team)
    team.close()
    return found


def search_over(boundaries, position, support, skin, threads=1):
    """(Search, order) with lists built over these particles."""
    d, count = position.shape
    search = Search(Domain(np.tile([0.0, 1.0], (d, 1)), boundaries), EagerTeam(threads))
    new = ordered(position)
    origin = Origin(np.ascontiguousarray(position[:, new]), support[new], skin)
    search.build(origin, np.arange(count))
    return search, new


def entries(search):
    """The (blocks, images) of the list of each superblock."""
    found = search.lists
    packed = [found.entries[a : a + n] for a, n in zip(found.start, found.count, strict=True)]
    return [unpacked.py_func(one) for one in packed]


def listed(search):
    """(N, images, N) whether the superblock of i lists the image of the block of j."""
    count = search.origin.support.size
    found = np.zeros((count, len(search.images.sign), count), dtype=bool)
    for k, (blocks, images) in enumerate(entries(search)):
        assert len(set(zip(blocks, images, strict=True))) == blocks.size  # each at most once
        i = slice(search.lists.first[k] * BLOCK, search.lists.first[k + 1] * BLOCK)
        for block, image in zip(blocks, images, strict=True):
            found[i, image, block * BLOCK : (block + 1) * BLOCK] = True
    return found


def distances(search, position):
    """(N, images, N) between i and the image of j."""
    sign, offset = search.images
    image = sign[:, :, None] * position + offset[:, :, None]  # (images, D, N)
    return np.linalg.norm(position.T[:, None, :, None] - image, axis=2)


def missing(search, position, support):
    """Pairs within the larger of their supports that are not in the lists."""
    larger = np.maximum(support[:, None, None], support)
    return np.count_nonzero((distances(search, position) < larger) & ~listed(search))


# --- order ---


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_order_depends_only_on_positions_and_ids(shape, dimension):
    position = positions(shape, dimension, 203)
    identity = np.random.default_rng(3).permutation(203)
    team = EagerTeam(1)
    one = order.block_order(position, identity, team)
    assert sorted(one) == list(range(203))
    shuffle = np.random.default_rng(4).permutation(203)
    other = order.block_order(np.ascontiguousarray(position[:, shuffle]), identity[shuffle], team)
    np.testing.assert_array_equal(identity[one], identity[shuffle][other])


@pytest.mark.parametrize("shape", ["random", "equal_coordinates"])
@pytest.mark.parametrize("threads", [2, 3])
def test_order_and_lists_independent_of_threads(shape, threads, monkeypatch):
    monkeypatch.setattr(order, "SMALLEST_RANGE", 0)
    position = positions(shape, 2, 1500)  # more chunks of blocks than threads
    np.testing.assert_array_equal(ordered(position, threads), ordered(position))
    support = supports(2, 1500) / 8
    one, two = (
        entries(search_over(("periodic", "mirror"), position, support, 0.2, number)[0])
        for number in (1, threads)
    )
    for a, b in zip(one, two, strict=True):
        assert list(map(np.ndarray.tolist, a)) == list(map(np.ndarray.tolist, b))


@pytest.mark.parametrize("count", [2, 7, 8, 9, 16, 17, 31, 64, 65, 100])
def test_blocks_full_compact_and_split_at_median(count):
    position = positions("random", 1, count)
    in_order = position[0, ordered(position)]
    # in 1-D a split at the median leaves every block to the right of the one before
    blocks = [in_order[a : a + BLOCK] for a in range(0, count, BLOCK)]
    assert len(blocks) == order.number_of_blocks(count)
    for left, right in pairwise(blocks):
        assert len(left) == BLOCK
        assert left.max() < right.min()


def test_order_splits_longest_axis():
    position = positions("random", 3, 16) * np.array([[1.0], [9.0], [1.0]])
    y = position[1, ordered(position)]
    assert y[:BLOCK].max() < y[BLOCK:].min()


# --- lists ---


@pytest.mark.parametrize("boundaries", BOUNDARIES, ids=str)
@pytest.mark.parametrize("shape", SHAPES)
def test_lists_contain_all_within_larger_support(shape, boundaries):
    d = len(boundaries)
    position, support = positions(shape, d, 203), supports(d, 203)
    search, new = search_over(boundaries, position, support, 0.0)
    assert missing(search, position[:, new], support[new]) == 0
    assert np.sum(np.diff(search.lists.first)) == order.number_of_blocks(203)


@pytest.mark.parametrize("count", [*range(2, 20), 63, 64, 65, 100])
def test_lists_few_particles_complete(count):
    position, support = positions("random", 2, count), supports(2, count)
    search, new = search_over(("periodic", "mirror"), position, support, 0.1)
    assert missing(search, position[:, new], 1.1 * support[new]) == 0


def gaps(search, position):
    """(blocks, images, blocks) between the box of a block and the image of another."""
    edges = np.arange(0, position.shape[1], BLOCK)
    low = np.minimum.reduceat(position, edges, axis=1)[:, None]  # (D, 1, blocks)
    high = np.maximum.reduceat(position, edges, axis=1)[:, None]
    sign, offset = (one.T[:, :, None] for one in search.images)
    ends = np.array([sign * low + offset, sign * high + offset])
    above = ends.min(axis=0)[:, None] - high[:, 0, :, None, None]
    below = low[:, 0, :, None, None] - ends.max(axis=0)[:, None]
    return np.linalg.norm(np.maximum(0, np.maximum(above, below)), axis=0)


@pytest.mark.parametrize("boundaries", BOUNDARIES, ids=str)
@pytest.mark.parametrize("shape", ["random", "clustered"])
def test_lists_contain_only_blocks_within_reach_of_a_block(shape, boundaries):
    position, support = positions(shape, len(boundaries), 403), supports(2, 403) / 3
    search, new = search_over(boundaries, position, support, 0.1)
    x, H = position[:, new], np.maximum.reduceat(support[new], np.arange(0, 403, BLOCK))
    near = gaps(search, x) < 1.1 * np.maximum(H[:, None, None], H)
    for k, (blocks, images) in enumerate(entries(search)):
        own = slice(*search.lists.first[k : k + 2])
        expected = np.argwhere(near[own].any(axis=0))  # in order of images, then blocks
        np.testing.assert_array_equal(np.column_stack([images, blocks]), expected)
    assert np.diff(search.lists.first).max() <= SUPERBLOCK


@pytest.mark.parametrize("boundaries", BOUNDARIES, ids=str)
@pytest.mark.parametrize("seed", range(4))
def test_lists_stale_before_missing_a_pair(boundaries, seed):
    """Random motion, step by step: as long as the lists are trusted they are complete."""
    random = np.random.default_rng(seed)
    d, count = len(boundaries), 120
    position, support = positions("random", d, count, seed), supports(d, count, seed)
    search, new = search_over(boundaries, position, support, 0.25)
    x, H = position[:, new], support[new]
    direction = random.normal(size=x.shape) * random.choice([0.02, 0.2, 1], count)
    steps = 0
    while not search.stale(x, H):
        # trusted to the reach, not only to the supports of this moment
        reach = (1 - 1e-12) * search.reach_factor * search.origin.support
        assert missing(search, x, reach) == 0
        x = x + 0.007 * direction * H.min()
        H = H * (1 + 0.003 * random.uniform(-1, 1.5, count))
        steps += 1
    assert steps > 5


@pytest.mark.parametrize(
    ("moves", "growth", "trusted"),
    # skin 0.2: two particles that moved m supports each leave a reach of 1.2 - 2 m
    [
        (0.0, 1.19, True),
        (0.0, 1.21, False),
        (0.05, 1.09, True),
        (0.05, 1.11, False),
        (0.09, 1.0, True),
        (0.11, 1.0, False),
        (0.11, 0.9, True),
    ],
)
def test_lists_valid_until_skin_used_up(moves, growth, trusted):
    position = np.array([[0.2, 0.8]])
    search, _ = search_over(("open",), position, np.array([0.1, 0.1]), 0.2)
    moved = position + np.array([[moves * 0.1, 0.0]])
    grown = np.array([0.1, 0.1]) * growth
    assert search.stale(moved, grown) != trusted


def test_lists_two_approaching_particles_stale_before_contact():
    # listed within 0.12; from 0.1201 apart, each goes towards the other
    position, H = np.array([[0.4, 0.5201]]), np.array([0.1, 0.1])
    # company, so that the two are in superblocks of their own
    n = 2 * SUPERBLOCK * BLOCK
    far = np.linspace(2, 9, n // 2 - 1)[None]
    everything = np.concatenate([-far, position, far], axis=1)
    search, _ = search_over(("open",), everything, np.full(n, 0.1), 0.2)
    x = search.origin.position.copy()
    i, j = np.flatnonzero((x[0] > 0) & (x[0] < 1))
    assert not listed(search)[i, 0, j]
    for step in np.linspace(0, 0.02, 41):
        moved = x.copy()
        moved[0, i] += step * np.sign(x[0, j] - x[0, i])
        moved[0, j] -= step * np.sign(x[0, j] - x[0, i])
        meet = abs(moved[0, i] - moved[0, j]) < H[0]
        assert search.stale(moved, np.full(n, 0.1)) or not meet
    assert meet  # the motion did bring them together


def test_search_without_lists_is_stale():
    search = Search(Domain(np.array([[0.0, 1.0]]), ("open",)), Team(1))
    assert search.stale(np.zeros((1, 3)), np.ones(3))


# --- widening ---


@pytest.fixture
def full_builds(monkeypatch):
    """One entry for each build of all lists."""
    build, calls = lists.Builder.all, []
    monkeypatch.setattr(lists.Builder, "all", lambda *a: calls.append(1) or build(*a))
    return calls


@pytest.mark.parametrize("asking", [1, 40])
@pytest.mark.parametrize("boundaries", BOUNDARIES, ids=str)
def test_widening_extends_requesting_blocks_and_keeps_others(boundaries, asking, full_builds):
    d = len(boundaries)
    position, support = positions("random", d, 600), supports(d, 600) / 20
    search, new = search_over(boundaries, position, support, 0.1)
    x, listed_for = position[:, new], support[new]
    x[0] += 0.02 * listed_for  # toward one side; 1.1 - 2 x 0.02 is left
    assert not search.stale(x, listed_for)
    wanted = np.zeros(order.number_of_blocks(600))
    wanted[np.linspace(3, 70, asking).astype(int)] = np.linspace(3.0, 1.2, asking)
    before, boxes = search.reach_factor, search.boxes
    search.widen(wanted, np.arange(600))
    asked = listed_for * np.repeat(np.maximum(wanted, 1), BLOCK)[:600]
    np.testing.assert_array_equal(search.origin.support, asked)
    # complete as far as before in units of the new supports, for particles that have moved since
    assert search.reach_factor == before == pytest.approx(1.06, rel=1e-12)
    assert search.boxes is boxes
    assert missing(search, x, (1 - 1e-12) * before * asked) == 0
    assert len(full_builds) == (1 if asking == 1 else 2)
    assert not search.stale(x, asked)


def test_widening_renews_only_lists_that_ask_or_are_reached(full_builds, monkeypatch):
    again, wanted_again = lists.Builder.again, []
    monkeypatch.setattr(
        lists.Builder, "again", lambda *a: wanted_again.append(a[2].copy()) or again(*a)
    )
    position, support = positions("random", 2, 4000), np.full(4000, 0.02)
    search, _ = search_over(("periodic", "mirror"), position, support, 0.1)
    first, old = search.lists.first, entries(search)
    wanted = np.zeros(order.number_of_blocks(4000))
    wanted[[100, 300]] = 2.0
    search.widen(wanted, np.arange(4000))
    own = np.searchsorted(first, [100, 300], side="right") - 1
    new = entries(search)
    reached = {k for one in own for k in np.searchsorted(first, new[one][0], side="right") - 1}
    renewed = set(np.flatnonzero(np.any(wanted_again, axis=0)))
    assert renewed == reached | set(own)
    assert len(renewed) < 0.4 * len(new)
    assert len(full_builds) == 1
    assert search.lists.entries.size == search.lists.count.sum()  # no gaps where old lists were
    for k in set(range(len(new))) - renewed:
        np.testing.assert_array_equal(new[k], old[k])
    # and what is renewed is what a build for these supports gives
    search.build(search.origin, np.arange(4000))
    for one, other in zip(new, entries(search), strict=True):
        np.testing.assert_array_equal(one, other)


def test_widening_that_needs_more_images_builds_all_lists(full_builds):
    position, support = positions("random", 2, 300), np.full(300, 0.05)
    search, new = search_over(("periodic", "mirror"), position, support, 0.1)
    wanted = np.zeros(order.number_of_blocks(300))
    wanted[20] = 25.0  # wider than the box
    search.widen(wanted, np.arange(300))
    assert len(full_builds) == 2
    assert missing(search, position[:, new], search.origin.support) == 0


@pytest.mark.parametrize("asking", [1, 100])
def test_widening_serves_requests_below_the_support_of_the_lists(asking):
    """Where all supports have shrunk, lists that reach less far than those of old still serve."""
    position, support = positions("random", 2, 1000), np.full(1000, 0.05)
    search, _ = search_over(("periodic", "open"), position, support, 0.1)
    x = search.origin.position + np.array([[0.2 * 0.05], [0.0]])
    assert not search.stale(x, 0.6 * support)
    assert search.reach_factor == pytest.approx(0.7, rel=1e-12)
    wanted = np.zeros(order.number_of_blocks(1000))
    wanted[:asking] = 0.8
    search.widen(wanted, np.arange(1000))
    reach = search.reach_factor * search.origin.support
    assert np.all(reach[: asking * BLOCK] >= (1 - 1e-12) * 0.8 * 0.05)
    assert missing(search, x, (1 - 1e-12) * reach) == 0


# --- selection ---


@njit(**FLAGS)
def _selected(first, last, dim, neighbours, position, support, support_inverse, own, found):
    """Write the candidates that a pass selects for each block to found (blocks, columns).

    Candidate j of an image has the number image N + j; -1 marks columns without a candidate. own: 0
    for the reach of the block's particles, otherwise also for that of the candidates.
    """
    D, lanes, lists, n = len(dim), neighbours.lanes, neighbours.lists, support.size
    fields = dim + (0, 0)  # noqa: RUF005  # position, number, 1/H
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        x_0 = at(dim, position, begin * BLOCK)
        per_length = unit(largest_of(support, begin * BLOCK, min(end * BLOCK, n)))
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            reach = largest_of(support, block * BLOCK, min((block + 1) * BLOCK, n)) * per_length
            copy_box(
                dim, boxes, t, neighbours, block, image, x_0, per_length, reach if own > 0 else 0.0
            )
            to = t * len(fields) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            for p in range(BLOCK):
                j = block * BLOCK + p
                copied[to + D * BLOCK + p] = image * n + j if j < n else -1
                H_inv = support_inverse[j] if j < n else 1e9
                copied[to + (D + 1) * BLOCK + p] = H_inv / per_length
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, n)
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            nc = near_particles(
                lanes, dim, copied, fields, own * (D + 1), chosen, blocks, low, high, reach, near
            )
            for k in range(nc):
                found[block, k] = int(near[D, k])


def selected(search, position, support, own, lanes=simd.DOUBLE):
    """(blocks, columns) the candidates that a pass selects, see `_selected`."""
    blocks = order.number_of_blocks(support.size)
    found = np.full((blocks, len(search.images.sign) * support.size), -1)
    near = Neighbours(
        search.lists, search.images, search.boxes, search.origin.support, search.reach_factor,
        lanes,
    )  # fmt: skip
    dim = (0,) * len(position)
    _selected(0, near.superblocks, dim, near, position, support, 1 / support, own, found)
    return found


def near_boxes(search, position, support, own):
    """Likewise, by brute force: the numbers of the candidates of each block, in order."""
    sign, offset = search.images
    image = (sign[:, :, None] * position + offset[:, :, None]).transpose(1, 0, 2)
    largest = np.tile(support, len(sign)) if own else 0.0
    for a in range(0, support.size, BLOCK):
        x = position[:, a : a + BLOCK]
        low, high = x.min(axis=1)[:, None, None], x.max(axis=1)[:, None, None]
        gap = np.linalg.norm(np.maximum(0, np.maximum(low - image, image - high)), axis=0)
        reach = np.maximum(support[a : a + BLOCK].max(), largest)
        yield np.flatnonzero(gap.ravel() < reach)


@pytest.mark.parametrize("own", [0, 1])
@pytest.mark.parametrize("shape", ["random", "clustered", "equal_coordinates"])
@pytest.mark.parametrize(
    "scene",
    slow_except(
        {1},
        [(one, simd.DOUBLE) for one in BOUNDARIES]
        + [(BOUNDARIES[1], lanes) for lanes in (simd.SINGLE, simd.SCALAR)],
    ),
    ids=str,
)
def test_selection_is_all_within_reach_of_the_box_of_a_block(scene, shape, own):
    boundaries, lanes = scene
    position, support = positions(shape, len(boundaries), 203), supports(2, 203)
    search, new = search_over(boundaries, position, support, 0.1)
    x, H = search.origin.position, support[new]
    found = selected(search, x, H, own, lanes)
    for numbers, expected in zip(found, near_boxes(search, x, H, own), strict=True):
        np.testing.assert_array_equal(numbers[numbers >= 0], expected)
    if shape == "random":
        assert (found >= 0).mean() < 0.9 * listed(search).mean()


@pytest.mark.parametrize("own", [0, 1])
@pytest.mark.parametrize("boundaries", slow_except({1}, BOUNDARIES), ids=str)
def test_selection_is_independent_of_when_lists_were_built(boundaries, own):
    d = len(boundaries)
    position, support = positions("random", d, 403), supports(d, 403) / 2
    search, new = search_over(boundaries, position, support, 0.1)
    x, H = search.origin.position, support[new]
    expected = selected(search, x, H, own)
    moves = np.random.default_rng(6).normal(size=x.shape)
    earlier = x + 0.1 * H * moves / np.linalg.norm(moves, axis=0)
    search.build(Origin(earlier, 0.9 * H, 0.45), np.arange(403))
    assert not search.stale(x, H)
    np.testing.assert_array_equal(selected(search, x, H, own), expected)
    wanted = np.zeros(order.number_of_blocks(403))
    wanted[[2, 30]] = 1.5
    search.widen(wanted, np.arange(403))
    np.testing.assert_array_equal(selected(search, x, H, own), expected)


@njit(**FLAGS)
def _chosen(first, last, dim, neighbours, position, per_length, reach):
    """Return how many blocks of each list are within `reach` of the first of its superblock."""
    lanes, lists = neighbours.lanes, neighbours.lists
    _, _, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(dim))
    number = np.empty(last - first, np.int64)
    for one in range(first, last):
        own = lists.first[one]
        x_0 = at(dim, position, own * BLOCK)
        for t in range(lists.count[one]):
            block, image = unpacked(lists.entries[lists.start[one] + t])
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, 0.0)
        low, high = own_box(dim, neighbours, own, x_0, per_length)
        number[one] = near_blocks(lanes, dim, boxes, lists.count[one], low, high, reach, chosen)
    return number


@pytest.mark.parametrize(
    "lanes", slow_except({0}, [simd.DOUBLE, simd.SINGLE, simd.SCALAR]), ids=str
)
def test_selection_has_no_lanes_beyond_the_list_for_any_reach(lanes):
    """The first guess of particles in one place is smaller than their support by nine decades."""
    search, _ = search_over(("open",) * 2, positions("random", 2, 203), np.full(203, 2.0), 0.1)
    near = Neighbours(search.lists, search.images, search.boxes, search.origin.support, 1.0, lanes)
    found = _chosen(0, near.superblocks, (0, 0), near, search.origin.position, 1e9, 4e9)
    np.testing.assert_array_equal(found, search.lists.count)


@pytest.mark.parametrize("skin", [0.01, 1.0])
@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_lists_supports_wider_than_box_complete(boundary, skin):
    """However wide their skin is: 0.95 of the box was refused where 0.95 (1 + skin) was more."""
    position, support = positions("random", 2, 50), np.full(50, 0.95)
    support[:10] = 3.2
    search, new = search_over((boundary,) * 2, position, support, skin)
    assert missing(search, position[:, new], support[new]) == 0


def test_unsupported_supports_and_counts_are_refused(monkeypatch):
    position = positions("random", 1, 10)
    with pytest.raises(NumericalError, match="600 times the shortest side of the box"):
        search_over(("periodic",), position, np.full(10, 600.0), 0.1)
    monkeypatch.setattr(lists, "MAX_PARTICLES", 9)
    search = Search(Domain(np.array([[0.0, 1.0]]), ("open",)), Team(1))
    with pytest.raises(NumericalError, match="10 particles: expected at most 9"):
        search.order(position, np.arange(10))


def test_lists_rebuilt_equal_for_any_capacity():
    position, support = positions("random", 2, 700), supports(2, 700) / 4
    search, _ = search_over(("periodic", "mirror"), position, support, 0.1)
    first = listed(search)
    few = Origin(search.origin.position, 0.2 * search.origin.support, 0.1)
    for origin in (few, search.origin):  # from little room to much, and back
        search.build(origin, np.arange(700))
    np.testing.assert_array_equal(listed(search), first)


# --- skin and first guess ---


def test_lists_are_built_again_where_any_chunk_has_too_little_room():
    n = 4 * lists.CHUNK * SUPERBLOCK * BLOCK
    search, _ = search_over(("mirror",), positions("random", 1, n), supports(1, n) / 8, 0.1)
    expected, needed = entries(search), search._room
    assert needed.size == 4
    assert needed.min() > 8  # what a region has to spare
    for chunk, room in product(range(4), (0, 1)):
        search._room = np.where(np.arange(4) == chunk, room, needed)
        search.build(search.origin, np.arange(n))
        np.testing.assert_array_equal(search._room, needed)
        assert all(map(np.array_equal, entries(search), expected))


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_skin_covers_step_and_grows_while_worthwhile(dimension):
    assert best_skin(0.0, dimension) == GROWTH  # lists for ever need only the room for growth
    for step in (1e-4, 1e-3, 1e-2):
        kept = (best_skin(step, dimension) - GROWTH) / (2 * step) + 1
        assert kept == pytest.approx(round(kept), abs=1e-9)  # a whole number of steps; rounding
        assert 1 <= round(kept) <= 20
    assert best_skin(1e3, dimension) == GROWTH  # too fast to keep any: build at every step


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_skin_is_the_cheapest_of_those_for_a_whole_number_of_steps(dimension):
    for step in [0.0, *np.geomspace(1e-7, 10.0, 300).tolist()]:
        costs = [
            (BUILD_OVER_PASSES / k + COPYING * (1 + skin / WIDTH) ** dimension, skin)
            for k in range(1, 21)
            for skin in [GROWTH + 2 * (k - 1) * step]
        ]
        assert best_skin(step, dimension) == min(costs)[1]


def arranged(shape, dimension, count, random):
    """(D, N) as a problem may place particles: noisy lattice, concentration, sheet or filament."""
    filled = {"sheet": dimension - 1, "filament": 1}.get(shape, dimension)
    side = round(count ** (1 / filled))
    x = np.indices((side,) * filled).reshape(filled, -1) + random.uniform(0.2, 0.8, (filled, 1))
    x = (x + random.uniform(-0.3, 0.3, x.shape)) / side - 0.5
    if shape == "concentration":
        x *= 2 * abs(x).max(axis=0)
    return np.concatenate([x, np.zeros((dimension - filled, x.shape[1]))])


@pytest.mark.parametrize(
    ("shape", "dimension"),
    [(shape, d) for shape in ("noise", "concentration") for d in (1, 2, 3)]
    + [("sheet", 2), ("sheet", 3), ("filament", 3)],
)
def test_first_guess_near_converged_support(shape, dimension):
    position = arranged(shape, dimension, 300, np.random.default_rng(7))
    position = np.ascontiguousarray(position[:, ordered(position)])
    count = position.shape[1]
    scene = dense.Scene(
        np.tile([-0.5, 0.5], (dimension, 1)), ("open",) * dimension, density_passes="converged"
    )
    guess = first_guess.from_spacing(position, scene.h_ratio * scene.eta)
    gas = np.zeros_like(position), np.ones(count), np.ones(count)
    factor = guess / dense.rates(scene, position, *gas, guess).support
    # ten: Newton is there in some four steps, each bounded by a factor two
    assert 1 / 10 < factor.min() <= factor.max() < 10


@pytest.mark.parametrize("count", [2, 3, 8, 9, 33])
@pytest.mark.parametrize("shape", ["random", "line", "plane"])
def test_first_guess_few_particles_finite_and_positive(shape, count):
    guess = first_guess.from_spacing(positions(shape, 3, count), 2.5)
    assert np.all(np.isfinite(guess) & (guess > 0))


def test_first_guess_coincident_block_is_positive():
    position = positions("random", 3, 100)
    position[:, : 2 * BLOCK] = 0.5
    guess = first_guess.from_spacing(np.ascontiguousarray(position[:, ordered(position)]), 2.5)
    assert np.all(np.isfinite(guess) & (guess > 0))


def held(position, radius):
    """Particles within `radius` (N,) of each one, by brute force."""
    squared = ((position[:, :, None] - position[:, None, :]) ** 2).sum(axis=0)
    return (squared < radius[:, None] ** 2).sum(axis=1)


@pytest.mark.parametrize("dimension", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("factor", [0.1, 1.0, 100.0, 1e6])
def test_trim_reduces_only_far_too_large_guesses(dimension, factor):
    position = positions("random", dimension, 3000)
    position = np.ascontiguousarray(position[:, ordered(position)])
    ratio = 2.5  # spacings to a support
    wanted = (2.0, np.pi, 4 / 3 * np.pi)[dimension - 1] * ratio**dimension
    before = np.full(3000, factor * ratio * 3000 ** (-1 / dimension))
    guess = before.copy()
    first_guess.trim(position, ratio, 1e-9, guess)
    if factor <= 1.0:
        assert np.array_equal(guess, before)
        return
    # eight times as many at the most about the middle of a block; about a particle up to a block's
    # extent away from it somewhat more
    assert held(position, guess).max() < 2 * first_guess.TOO_MANY * wanted
    assert held(position, before).min() > 2 * first_guess.TOO_MANY * wanted
    # and it is halved no further than needed: twice it holds more, walls leave an eighth of a ball
    assert held(position, 2 * guess).min() > first_guess.TOO_MANY * wanted / 8


def test_trim_coincident_particles_terminates():
    guess = np.ones(100)
    first_guess.trim(np.full((3, 100), 0.5), 0.5, 1e-3, guess)
    assert 1e-3 < guess.max() <= 2e-3
