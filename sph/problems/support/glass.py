"""Relaxation of particles to a glass: a disordered arrangement whose densities are uniform.

The volume of each particle is given. In a good arrangement the *filling* (eq 460) is the same for
all particles: the density that SPH sums is then that of the scene. Two stages lead there. Repulsion
(Diehl et al. 2015, PASA 32, e048) spreads the particles. Descent along the gradient of the scatter
of the filling, with the step sizes of Barzilai & Borwein (1988), IMA J. Numer. Anal. 8, 141, then
removes what repulsion leaves.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from sph import kernels, stop_signals
from sph.domain import Domain

SWEEPS = 60  # most of repulsion: more reduce the scatter by little
REACH, STRENGTH = 2.0, 0.5  # of the repulsion, in spacings
CHECK = 10  # repulsion sweeps between two measurements of the scatter
FARTHEST = 0.1  # most that a particle moves in a step of the descent, in spacings
CHUNK = 10_000  # particles whose pairs exist at a time, for a small memory


class Reached(NamedTuple):
    """The end of a relaxation."""

    position: np.ndarray  # (D, N)
    scatter: float  # density error (eq 461): rms of filling over its mean, minus 1
    mean: float  # of the filling; 1 but for the bias of the kernel
    iterations: int


class Smoothing(NamedTuple):
    """The density sum of the run: kernel, and H over the particle spacing V^(1/D)."""

    kernel: kernels.Kernel
    ratio: float


class _Near(NamedTuple):
    """Pairs of a particle i and a particle or image j, i's neighbours in order."""

    i: np.ndarray  # (P,)
    j: np.ndarray  # (P,)
    apart: np.ndarray  # (D, P) x_i - x_j
    distance: np.ndarray  # (P,)


def relaxed(
    position: np.ndarray,
    domain: Domain,
    volume: Callable[[np.ndarray], np.ndarray],
    smoothing: Smoothing,
    residual: float,
    most: int,
    told: Callable[[int, float], None],
) -> Reached:
    """Return positions (D, N) whose filling scatters by no more than `residual`, if `most` allows.

    volume: returns (N,) volumes of particles at positions (D, N). Boundaries are periodic or
    mirrors. told: called with the number of iterations and the scatter after each measurement.
    """
    position, volume = position.copy(), _unless_ended(volume)
    last = Reached(position, np.inf, np.nan, 0)
    while last.iterations < min(SWEEPS, most):
        for _ in range(min(CHECK, most - last.iterations)):
            position += _push(position, domain, volume(position))
            domain.bring_inside(position, ())
        found = measured(position, domain, volume(position), smoothing)
        found = found._replace(iterations=min(last.iterations + CHECK, most))
        told(found.iterations, found.scatter)
        if found.scatter <= residual or found.iterations == most:
            return found
        worse, last = found.scatter > last.scatter, found
        if worse:  # volumes differ: repulsion does not settle where the filling is uniform
            break
    return _descended(last, domain, volume, smoothing, residual, most, told)


def _unless_ended(volume: Callable[[np.ndarray], np.ndarray]):
    """Return the function, which every iteration calls, with an end where a signal asks for one."""

    def checked(position: np.ndarray) -> np.ndarray:
        stop_signals.heed()
        return volume(position)

    return checked


def measured(position, domain: Domain, volume, smoothing: Smoothing) -> Reached:
    """Return the scatter and the mean of the filling of particles with volumes (N,)."""
    mean, scatter = _moments(_filling(position, domain, volume, smoothing), volume)
    return Reached(position, scatter, mean, 0)


def _moments(filling: np.ndarray, volume: np.ndarray) -> tuple[float, float]:
    """Return the mean, and the rms deviation relative to the mean (eq 461)."""
    mean = float((volume * filling).sum() / volume.sum())
    variance = (volume * (filling - mean) ** 2).sum() / volume.sum()
    return mean, float(np.sqrt(variance)) / mean


def _descended(start: Reached, domain, volume, smoothing, residual, most, told) -> Reached:
    """Return the end of the second stage (eq 463), with the positions of least scatter."""
    position, best, before, step = start.position.copy(), start, None, np.inf
    for count in range(start.iterations + 1, most + 1):
        sizes = volume(position)
        filling = _filling(position, domain, sizes, smoothing)
        mean, scatter = _moments(filling, sizes)
        told(count, scatter)
        if scatter < best.scatter:
            best = Reached(position.copy(), scatter, mean, count)
        if scatter <= residual:
            break
        slope = _slope(position, domain, sizes, smoothing, filling - mean)
        if before is not None:
            moved, turned = before[0], slope - before[1]
            step = abs(float((moved * turned).sum())) / (float((turned**2).sum()) or 1.0)
        longest = float(np.sqrt((slope**2).sum(axis=0)).max()) or 1.0
        before = -min(step, FARTHEST / longest) * slope, slope
        position += sizes ** (1.0 / len(position)) * before[0]
        domain.bring_inside(position, ())
    return best._replace(iterations=count)


def _push(position: np.ndarray, domain: Domain, volume: np.ndarray) -> np.ndarray:
    """Return displacements (D, N) by repulsion of near particles (eq 462)."""
    side = volume ** (1.0 / len(position))
    found = np.zeros_like(position)
    for near in _pairs(position, domain, REACH * side):
        reach = 0.5 * REACH * (side[near.i] + side[near.j])
        fade = np.maximum(0.0, 1.0 - near.distance / reach) ** 2
        _add(found, near, STRENGTH * side[near.i] * fade)
    return found


def _filling(position, domain: Domain, volume, smoothing: Smoothing) -> np.ndarray:
    """Return the filling (N,) of particles with volumes (N,) (eq 460)."""
    dim = (0,) * len(position)
    kernel, norm = smoothing.kernel, kernels.normalisation(smoothing.kernel, dim)
    support = smoothing.ratio * volume ** (1.0 / len(dim))
    weight = norm / support ** len(dim)
    found = volume * weight * kernels.w(kernel, dim, np.zeros(1))
    for near in _pairs(position, domain, support):
        q = np.minimum(near.distance / support[near.i], 1.0)
        each = volume[near.j] * weight[near.i] * kernels.w(kernel, dim, q)
        found += np.bincount(near.i, each, found.size)
    return found


def _slope(position, domain: Domain, volume, smoothing: Smoothing, error) -> np.ndarray:
    """Return half of d(sum of error^2)/dx (D, N) in units of spacings, up to a constant factor.

    error: filling minus its mean (N,).
    """
    dim = (0,) * len(position)
    kernel, norm = smoothing.kernel, kernels.normalisation(smoothing.kernel, dim)
    side = volume ** (1.0 / len(dim))
    support = smoothing.ratio * side
    weight = error * norm / support ** (len(dim) + 1)
    found = np.zeros_like(position)
    for near in _pairs(position, domain, support):
        force = np.zeros_like(near.distance)
        for end in (near.i, near.j):
            q = np.minimum(near.distance / support[end], 1.0)
            force += weight[end] * kernels.dw_over_q(kernel, dim, q) * q
        _add(found, near, side[near.i] * volume[near.j] * force)
    return found


def _add(total: np.ndarray, near: _Near, strength: np.ndarray) -> None:
    """Add vectors of length `strength` (P,) along each pair to the first particle's (D, N)."""
    each = strength / np.maximum(near.distance, 1e-300)
    for axis, along in enumerate(near.apart):
        total[axis] += np.bincount(near.i, each * along, total.shape[1])


def _pairs(position: np.ndarray, domain: Domain, reach: np.ndarray) -> Iterator[_Near]:
    """Yield all pairs closer than the larger of their reaches (N,), images of the box included."""
    from scipy.spatial import cKDTree  # costs 0.1 s to import, which only a glass needs

    longest = float(reach.max())
    low, high = domain.box[:, :1] - longest, domain.box[:, 1:] + longest
    images = domain.images_within(longest)
    places, owners = [], []
    for sign, offset in zip(images.sign, images.offset, strict=True):
        image = sign[:, None] * position + offset[:, None]
        there = np.flatnonzero(((image >= low) & (image <= high)).all(axis=0))
        places.append(image[:, there])
        owners.append(there)
    place, owner = np.hstack(places), np.concatenate(owners)
    tree = cKDTree(place.T)
    for first in range(0, position.shape[1], CHUNK):
        here = cKDTree(position[:, first : first + CHUNK].T)
        found = here.sparse_distance_matrix(tree, longest, output_type="ndarray")
        i, j, distance = first + found["i"], found["j"], found["v"]
        near = distance < np.maximum(reach[i], reach[owner[j]])
        near &= (owner[j] != i) | (distance > 0.0)
        i, j = i[near], j[near]
        yield _Near(i, owner[j], position[:, i] - place[:, j], distance[near])
