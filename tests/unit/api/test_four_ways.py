"""The same two clouds by a problem file, by arrays, by a file of particles, and by regions."""

from pathlib import Path

import numpy as np
import pytest

import sph

CLOUDS = Path(__file__).parents[3] / "docs" / "notebooks" / "two_clouds.py"
SIDE = 16  # a power of two: positions and masses are exact, however they are computed
TIMES = (0.0, 0.02, 0.04)
SHARED = {
    "physics": {"gamma": 5.0 / 3.0, "alpha": 1.0},
    "time": {"end": TIMES[-1]},
    "output": {"interval": 0.02},
}


def arrays():
    axis = (np.arange(SIDE) + 0.5) / SIDE
    position = np.stack([one.ravel() for one in np.meshgrid(axis, axis, indexing="ij")])
    left, right = (((position - [[x], [0.5]]) ** 2).sum(axis=0) < 0.01 for x in (0.3, 0.7))
    density = np.where(left | right, 4.0, 1.0)
    return {
        "position": position,
        "velocity": np.stack([1.0 * left - 1.0 * right, np.zeros(SIDE**2)]),
        "mass": density / SIDE**2,
        "internal_energy": 1.0 / ((5.0 / 3.0 - 1.0) * density),
    }


def of_run(problem):
    return [one.state_hash for one in sph.run({"problem": problem, **SHARED}).checkpoints]


def by_problem_file(directory):
    return of_run({"file": CLOUDS, "n": SIDE**2})


def by_arrays(directory):
    with sph.Simulation(**arrays(), box=[0.0, 1.0], physics=SHARED["physics"]) as clouds:
        found = []
        for time in TIMES:
            clouds.advance(time)
            found.append(clouds.state_hash)
        return found


def by_file_of_particles(directory):
    np.savez(directory / "clouds.npz", **arrays(), domain=[[0.0, 1.0]] * 2)
    return of_run({"name": "file", "path": directory / "clouds.npz"})


def by_regions(directory):
    cloud = {"shape": "disc", "radius": 0.1, "density": 4.0}
    regions = [
        {"shape": "everywhere", "density": 1.0, "pressure": 1.0},
        {**cloud, "centre": [0.3, 0.5], "velocity": [1.0, 0.0]},
        {**cloud, "centre": [0.7, 0.5], "velocity": [-1.0, 0.0]},
    ]
    return of_run({"name": "regions", "n": SIDE**2, "region": regions})


@pytest.mark.slow
@pytest.mark.parametrize("way", [by_arrays, by_file_of_particles, by_regions])
def test_two_clouds_have_one_state_hash(way, tmp_path):
    expected = by_problem_file(tmp_path)
    assert len(set(expected)) == len(TIMES)
    assert way(tmp_path) == expected
