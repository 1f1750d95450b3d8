"""Torn bodies: how many connected pieces each solid body has (eq 454).

The equations contain no law of fracture. A body that tears does so because its particles have moved
out of the supports of their neighbours, often by the tensile instability, so where and when it
tears depends on the arrangement of the particles.

Two particles of a body are linked if they exert forces on each other: if their distance is less
than the mean of their support radii (eq 401). No shorter distance would do: material that is
stretched along one axis and compressed along another has neighbours at several particle spacings.
"""

from typing import NamedTuple

import numpy as np

from sph import faults
from sph.domain import Domain
from sph.state import Field, Public

BODY = Field(
    "body",
    at_least=0.0,
    public=Public("Bodies", 0, 0, 0, 0, "Number of the solid body from 1, or 0 in a fluid"),
)

# Parts of the supports within which links are searched, until a body is found to be in one piece.
# Half the support holds the nearest neighbours only, and the search costs a fifth in 3-D.
SHARES = (0.5, 1.0)
NAMED = 4  # pieces whose sizes a message lists


class Pieces(NamedTuple):
    """Solid bodies at the start, their pieces now, and sizes of the pieces of torn bodies."""

    bodies: int
    pieces: int
    torn: dict[int, list[int]]  # by number of the body: particles of its pieces, largest first
    particle: int  # ID of a particle of the smallest piece of the first torn body, or 0


def start(state, support: np.ndarray, domain: Domain, is_solid: np.ndarray) -> None:
    """Number the solid bodies from 1 in `state.body`; a number that the problem gave remains.

    A body is a connected piece of one material. support: (N,) support radii; is_solid: (N,),
    whether a particle's material has a strength; the body of other particles is 0.
    """
    if state.body.any():
        state.body[~is_solid] = 0.0
        return
    material = state.get("material")
    kinds = np.zeros(state.number) if material is None else material
    number = 0
    for kind in np.unique(kinds[is_solid]):
        members = np.flatnonzero(is_solid & (kinds == kind))
        count, label = _connected(state.position, support, members, domain)
        state.body[members] = number + 1 + label
        number += count


def of(state, domain: Domain) -> Pieces:
    """Return the pieces of the bodies."""
    bodies = np.unique(state.body[state.body > 0.0])
    pieces, torn, particle = 0, {}, 0
    for body in bodies:
        members = np.flatnonzero(state.body == body)
        count, label = _connected(state.position, state.support, members, domain)
        pieces += count
        if count > 1:
            sizes = np.bincount(label)
            torn[int(body)] = sorted(sizes.tolist(), reverse=True)
            particle = particle or int(state.id[members[label == np.argmin(sizes)]].min())
    return Pieces(bodies.size, pieces, torn, particle)


def check(simulation) -> None:
    """Raise NumericalError if a body has torn."""
    found = of(simulation.particles, simulation.scene.domain)
    if found.torn:
        raise faults.fault(
            simulation,
            f"{in_words(found)}. The equations contain no law of fracture: where a body tears "
            "depends on the particles",
            "physics.tensile_correction = 0.3, or physics.allow_tearing = true",
            found.particle,
        )


def in_words(found: Pieces) -> str:
    """Return which body has torn, and the sizes of its pieces."""
    body, sizes = next(iter(found.torn.items()))
    listed = ", ".join(str(size) for size in sizes[:NAMED]) + ", …" * (len(sizes) > NAMED)
    others = len(found.torn) - 1
    also = f"; {others} more bod{'ies have' if others > 1 else 'y has'} torn" * (others > 0)
    return (
        f"solid body {body} of {found.bodies} has torn into {len(sizes)} pieces of {listed} "
        f"particles{also}"
    )


def _connected(position, support, members, domain: Domain) -> tuple[int, np.ndarray]:
    """Return the number of connected pieces of `members`, indices (M,), and their labels (M,)."""
    from scipy.sparse import coo_matrix  # these cost 0.1 s to import
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    where, H = position[:, members], support[members]
    low, length = domain.box[:, :1], np.diff(domain.box)
    is_periodic = np.array([[each == "periodic"] for each in domain.boundaries])
    period = np.where(is_periodic, length, 0.0)  # 0 for an axis without copies
    inside = np.where(is_periodic, np.mod(where - low, length), where)
    inside = np.where(is_periodic & (inside >= length), 0.0, inside)  # mod of a tiny negative one
    tree = cKDTree(inside.T, boxsize=period[:, 0])
    count, label = members.size, np.arange(members.size)
    for share in SHARES:
        first, second = tree.query_pairs(share * H.max(), output_type="ndarray").T
        apart = inside[:, first] - inside[:, second]
        apart -= period * np.round(apart / length)
        near = (apart**2).sum(axis=0) < (share * 0.5 * (H[first] + H[second])) ** 2
        links = (np.ones(near.sum(), dtype=bool), (first[near], second[near]))
        graph = coo_matrix(links, shape=(members.size, members.size))
        count, label = connected_components(graph, directed=False)
        if count == 1:
            break
    return count, label
