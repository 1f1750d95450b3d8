"""What `sph run --dry-run` says of a run."""

import re

import numpy as np
import pytest

from sph import config as configuration
from sph import preview
from sph.scene import Scene

TUBE = """
[problem]
name = "shock_tube"
n = 60
boundary = "mirror"
[time]
end = 0.2
[output]
interval = 0.06
[run]
threads = 1
"""


@pytest.fixture
def simulation(simulate):
    return simulate(configuration.from_text(TUBE))


def figure(text, pattern):
    return float(re.search(pattern.replace("#", r"([0-9.e+-]*\d)"), text)[1])


def test_parts_in_and_left_out():
    text = preview.describe(configuration.from_text(TUBE))
    inside, outside = re.search(r"Compiled in:\n(.*)Left out:\n(.*)Particles", text, re.S).groups()
    for part in ("1-D", "grad_h", "wendland_c2", "ideal_gas", "Balsara", "divergence", "u/|du/dt|"):
        assert part in inside
    for part in ("equation for alpha: alpha is one number", "curl of velocity: no curl in 1-D"):
        assert part in outside


def test_parts_that_the_configuration_takes_out():
    config = configuration.from_text(TUBE)
    config = config.override(["physics.balsara=false", "physics.energy_limit=false"])
    inside, outside = Scene(config).parts()
    for part in ("Balsara", "divergence", "u/|du/dt|"):
        assert not any(part in one for one in inside)
        assert any(part in one for one in outside)


def test_figures(simulation):
    text = preview.describe(configuration.from_text(TUBE))
    assert figure(text, "Particles: #,") == simulation.particles.number
    dt = simulation.limit.dt
    assert figure(text, "First step: #,") == pytest.approx(dt, rel=1e-3)  # printed with 4 digits
    assert f"by the signal speed of particle {simulation.limit.particle};" in text
    assert figure(text, "at that size # steps") == np.ceil(0.2 / dt)
    assert figure(text, "Output: # checkpoints") == 5  # t = 0, 0.06, 0.12, 0.18 and the end
    assert figure(text, "a step costs # CPU s") > 0
    assert "on 1 thread(s)" in text
    memory = figure(text, r"lists \(# bytes each\)")
    # lists are built anew in the three steps that are timed, and may be somewhat longer
    assert memory == pytest.approx(
        preview.bytes_held(simulation) / simulation.particles.number, rel=0.2
    )


def test_memory_counts_particles_and_lists(simulation):
    held = preview.bytes_held(simulation)
    assert held > sum(array.nbytes for array in simulation.particles.arrays().values())
    simulation.particles.alpha = np.zeros(1000)
    assert preview.bytes_held(simulation) == held + 8000
    lists = simulation.search.lists
    longer = np.zeros(lists.candidates.size + 1000, lists.candidates.dtype)
    simulation.search.lists = lists._replace(candidates=longer)
    assert preview.bytes_held(simulation) == held + 8000 + 1000 * longer.itemsize


def test_neighbours_are_counted(simulation):
    x, H = simulation.particles.position[0], simulation.particles.support
    sign, offset = simulation.scene.domain.images
    images = np.concatenate([s * x + o for s, o in zip(sign[:, 0], offset[:, 0], strict=True)])
    counted = np.mean(np.sum(np.abs(x[:, None] - images) < H[:, None], axis=1))
    # whole particles in 2 H, against a volume: some half a neighbour of 5 apart
    assert preview.neighbours_per_particle(simulation) == pytest.approx(counted, abs=0.5)
