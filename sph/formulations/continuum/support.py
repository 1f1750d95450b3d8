"""The support pass: support radii that follow the density (eq 400)."""

from numba import njit

from sph.compiled import COMPILED
from sph.neighbours.order import BLOCK


@njit(**COMPILED)
def supports(first, last, dim, models, neighbours, before, mass, density, support, wanted):
    """Set support (N,) of superblocks [first, last) from the predicted density (N,).

    before: the support radii of the last step. wanted (blocks,): see `sph.passes.Sweep`.
    """
    lists = neighbours.lists
    for block in range(lists.first[first], lists.first[last]):
        if wanted[block] == 0.0:
            continue
        most = 0.0
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            spacing = (mass[i] / density[i]) ** (1.0 / len(dim))
            H = min(models.support_ratio * models.eta * spacing, models.max_support)
            support[i] = H
            # NaN asks for no wider lists: the watchdog finds it
            most = max(most, H / neighbours.list_support[i])
        wanted[block] = most if most > neighbours.reach_factor else 0.0
