"""Torn bodies: connected pieces of each solid body."""

from types import SimpleNamespace

import numpy as np
import pytest

from sph.domain import Domain
from sph.errors import NumericalError
from sph.formulations.continuum import pieces
from sph.state import COMMON, Field, State

OPEN = Domain(np.array([[-50.0, 50.0], [-50.0, 50.0]]), ("open", "open"))
SUPPORT = 2.4  # 2 d with d = 1.2 spacings


def bar(columns, rows=4, x=0.0):
    """A square lattice of spacing 1, (2, N)."""
    return np.array([[x + i, float(j)] for i in range(columns) for j in range(rows)]).T


def state_of(position, material=None, support=SUPPORT):
    n = position.shape[1]
    fields = (*COMMON, pieces.BODY, *[Field("material")] * (material is not None))
    state = State.at_start(fields, position, np.zeros((2, n)), np.ones(n), np.zeros(n))
    state.support[:] = support
    if material is not None:
        state.material[:] = material
    return state


def started(*args, domain=OPEN, is_solid=None, **keys):
    state = state_of(*args, **keys)
    solid = np.ones(state.number, dtype=bool) if is_solid is None else is_solid
    pieces.start(state, state.support, domain, solid)
    return state


def test_whole_body_is_one_piece():
    state = started(bar(20))
    assert (state.body == 1.0).all()
    assert pieces.of(state, OPEN) == pieces.Pieces(1, 1, {}, 0)


@pytest.mark.parametrize(("gap", "count"), [(2.39, 1), (2.41, 2)])
def test_gap_tears_where_supports_end(gap, count):
    state = started(bar(20))
    state.position[0] += (gap - 1.0) * (state.position[0] > 9.5)
    assert pieces.of(state, OPEN).pieces == count


def test_mean_support_of_a_pair_links():
    state = started(bar(2, rows=1))
    state.position[0, 1] = 3.0
    assert pieces.of(state, OPEN).pieces == 2
    state.support[1] = 3.5
    assert pieces.of(state, OPEN).pieces == 2
    state.support[1] = 3.7
    assert pieces.of(state, OPEN).pieces == 1


def test_single_particle_counts_as_piece_and_is_named():
    state = started(bar(20))
    state.position[1, 7] = 40.0
    found = pieces.of(state, OPEN)
    assert found == pieces.Pieces(1, 2, {1: [79, 1]}, 8)


def test_ring_in_three_arcs():
    angle = np.arange(120) / 120 * 2.0 * np.pi
    ring = 120 / (2.0 * np.pi) * np.array([np.cos(angle), np.sin(angle)])
    state = started(ring)
    arc = np.arange(120) // 40
    state.position[:] += 3.0 * np.array([np.cos(2.1 * arc + 1.0), np.sin(2.1 * arc + 1.0)])
    found = pieces.of(state, OPEN)
    assert found.torn == {1: [40, 40, 40]}


def test_bodies_are_pieces_at_start_and_do_not_link():
    state = started(np.hstack([bar(5), bar(5, x=10.0)]))
    assert state.body[:20].tolist() == [1.0] * 20
    assert state.body[20:].tolist() == [2.0] * 20
    state.position[0, 20:] -= 6.0  # in contact
    state.position[1, 0] = 30.0
    assert pieces.of(state, OPEN).torn == {1: [19, 1]}
    # the right half of one body in contact with the other is a piece nevertheless
    state.position[0, 10:20] += 20.0
    state.position[0, 20:] += 20.0
    assert pieces.of(state, OPEN).torn == {1: [10, 9, 1]}


def test_materials_in_contact_are_bodies_and_fluids_are_none():
    material = np.repeat([0.0, 1.0, 2.0], 20)
    state = started(bar(15), material, is_solid=material != 1.0)
    assert np.unique(state.body[:20]).tolist() == [1.0]
    assert np.unique(state.body[20:40]).tolist() == [0.0]
    assert np.unique(state.body[40:]).tolist() == [2.0]
    state.position[1, 25] = 40.0  # a drop of the fluid
    assert not pieces.of(state, OPEN).torn


def test_bodies_of_the_problem_remain():
    state = state_of(bar(10))
    state.body[:] = np.repeat([2.0, 1.0], 20)
    pieces.start(state, state.support, OPEN, np.ones(40, dtype=bool))
    assert state.body.tolist() == [2.0] * 20 + [1.0] * 20


def test_periodic_axis_links_and_wall_does_not():
    box = np.array([[0.0, 20.0], [0.0, 10.0]])
    position = np.hstack([bar(3), bar(3, x=17.5)])  # ends are 1.5 and .5 from the faces
    periodic = Domain(box, ("periodic", "mirror"))
    assert pieces.of(started(position, domain=periodic), periodic).bodies == 1
    assert pieces.of(started(position, domain=Domain(box, ("mirror",) * 2)), periodic).bodies == 2


def test_check_names_body_sizes_and_remedy():
    state = started(np.hstack([bar(5), bar(5, x=10.0)]))
    scene = SimpleNamespace(domain=OPEN)
    simulation = SimpleNamespace(particles=state, scene=scene, step=3, time=0.5)
    pieces.check(simulation)
    state.position[1, [20, 39]] = [30.0, -30.0]
    with pytest.raises(NumericalError) as error:
        pieces.check(simulation)
    message = str(error.value)
    assert "solid body 2 of 2 has torn into 3 pieces of 18, 1, 1 particles" in message
    assert "physics.tensile_correction = 0.3, or physics.allow_tearing = true" in message
    assert error.value.particle in (21, 40)


def test_many_pieces_are_summarised():
    found = pieces.Pieces(3, 9, {2: [50, 9, 3, 2, 1, 1], 3: [4, 4]}, 7)
    assert pieces.in_words(found) == (
        "solid body 2 of 3 has torn into 6 pieces of 50, 9, 3, 2, … particles; 1 more body has torn"
    )
