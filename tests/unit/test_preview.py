"""What `sph run --dry-run` says of a run."""

import re

import numpy as np
import pytest

from sph import config as configuration
from sph import preview
from sph.errors import NumericalError
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


def test_preview_counts_outputs():
    made = configuration.from_text(TUBE)
    assert preview.describe(made).endswith("Output: 5 checkpoints.")
    assert preview._frames(made) == ""
    assert (
        preview._frames(made.override(["output.frames=9"])) == ", and 9 frames, at most one a step"
    )


def test_preview_lists_parts_in_and_left_out():
    text = preview.describe(configuration.from_text(TUBE))
    inside, outside = re.search(r"Compiled in:\n(.*)Left out:\n(.*)Particles", text, re.S).groups()
    for part in ("1-D", "grad_h", "wendland_c2", "ideal_gas", "Balsara", "divergence", "u/|du/dt|"):
        assert part in inside
    for part in ("equation for alpha: alpha is constant", "curl of velocity: no curl in 1-D"):
        assert part in outside


def test_preview_lists_parts_disabled_by_configuration():
    config = configuration.from_text(TUBE)
    config = config.override(["physics.balsara=false", "physics.energy_limit=false"])
    inside, outside = Scene(config).described()
    for part in ("Balsara", "divergence", "u/|du/dt|"):
        assert not any(part in one for one in inside)
        assert any(part in one for one in outside)


def test_preview_figures_match_simulation(simulation):
    text = preview.describe(configuration.from_text(TUBE))
    assert figure(text, "Particles: #,") == simulation.particles.number
    dt = simulation.limit.dt
    assert figure(text, "First step: #,") == pytest.approx(dt, rel=1e-3)  # printed with 4 digits
    assert f"by the signal speed of particle {simulation.limit.particle};" in text
    step = figure(text, r"step \d+ is #:")  # printed with 4 digits, of which the steps know more
    assert figure(text, "at that size # steps") == pytest.approx(0.2 / step, rel=0.02)
    assert figure(text, "Output: # checkpoints") == 5  # t = 0, 0.06, 0.12, 0.18 and the end
    assert figure(text, "a step costs # CPU s") > 0
    assert "on 1 thread(s)" in text
    memory = figure(text, r"lists \(# bytes each\)")
    # lists are built anew in the three steps that are timed, and may be somewhat longer
    assert memory == pytest.approx(
        preview.bytes_held(simulation) / simulation.particles.number, rel=0.2
    )


def test_preview_memory_counts_particles_and_lists(simulation):
    held = preview.bytes_held(simulation)
    assert held > sum(array.nbytes for array in simulation.particles.arrays().values())
    simulation.particles.alpha = np.zeros(1000)
    assert preview.bytes_held(simulation) == held + 8000
    lists = simulation.search.lists
    longer = np.zeros(lists.entries.size + 1000, lists.entries.dtype)
    simulation.search.lists = lists._replace(entries=longer)
    assert preview.bytes_held(simulation) == held + 8000 + 1000 * longer.itemsize


def test_preview_neighbours_match_count(simulation):
    x, H = simulation.particles.position[0], simulation.particles.support
    sign, offset = simulation.scene.domain.images
    images = np.concatenate([s * x + o for s, o in zip(sign[:, 0], offset[:, 0], strict=True)])
    counted = np.mean(np.sum(np.abs(x[:, None] - images) < H[:, None], axis=1))
    # whole particles in 2 H, against a volume: some half a neighbour of 5 apart
    assert preview.neighbours_per_particle(simulation) == pytest.approx(counted, abs=0.5)


@pytest.fixture
def small_build_limit(monkeypatch):
    """Most particles that a preview builds, so few that a small run is beyond them."""
    monkeypatch.setattr(preview, "MOST_BUILT", 1000)


def described(text, *overrides):
    return preview.describe(configuration.from_text(text).override(overrides))


BOX = """
[problem]
name = "gresho"
n = 16384
[run]
threads = 1
"""


def test_preview_of_many_particles_scaled_from_fewer(small_build_limit, monkeypatch, capsys):
    scaled = described(BOX)
    assert "trying 1000 of 16384 particles" in capsys.readouterr().err
    assert figure(scaled, "Figures are scaled from # particles") == 1024  # 32 by 32
    monkeypatch.setattr(preview, "MOST_BUILT", 10**9)
    whole = described(BOX)
    assert "scaled" not in whole
    for pattern in ("Particles: (?:some )?#,", "Memory: # MB", "First step: #,",
                    "at that size (?:some )?# steps"):  # fmt: skip
        # 0.2 was found, in the steps: 32 particles across smear the vortex
        assert figure(scaled, pattern) == pytest.approx(figure(whole, pattern), rel=0.3)
    cost = "a step costs # CPU s"
    # of milliseconds on a shared machine: this is to find a factor of 16 that was left out
    assert 0.25 < figure(scaled, cost) / figure(whole, cost) < 4.0


def test_preview_of_hundred_million_particles_is_fast(small_build_limit):
    text = described(BOX, "problem.n=100000000")
    assert "Particles: some 1e+08," in text
    # 244 bytes or more a particle, by the arrays and lists of a small run
    assert figure(text, "Memory: # MB") > 1e4


@pytest.mark.slow
def test_preview_problem_with_larger_minimum_uses_it(small_build_limit):
    contrast = BOX.replace("gresho", "contrast")
    keys = ["problem.masses=equal", "problem.profile=graded", "problem.ratio=1e5"]
    text = described(contrast, *keys, "problem.n=1000000")
    # 1000 of one mass would leave too few spacings of the thinnest gas
    assert figure(text, "Figures are scaled from # particles") > 3000


def test_preview_failure_names_particle_number(small_build_limit):
    tube = BOX.replace("gresho", "shock_tube").replace("16384", "50000")
    with pytest.raises(NumericalError, match="with 4000 particles"):
        described(tube, "physics.max_energy_drift=1e-300")


def test_preview_with_tiny_step_is_reported(monkeypatch):
    assert preview._count(float("inf"), True) == "some inf"
    assert preview._count(3.2, True) == "4"
    assert preview._count(123456.0, False) == "some 1.23e+05"
