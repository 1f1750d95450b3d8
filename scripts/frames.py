"""Whether a run's verdict depends on bulk motion: every shipped periodic scene, boosted.

    python scripts/frames.py [CONFIG ...] [--steps 60]

Each scene is run, with few particles and a few dozen steps, at several Courant numbers, at rest and
with all particles moved at up to a million times the speed of sound. A line for each scene and C
says how energy drifted in each frame; the exit code is 1 where a verdict differs from that at rest.
"""

import argparse
import math
import sys
from pathlib import Path

import numpy as np

from sph import config as configuration
from sph.clock import Clock
from sph.errors import NumericalError
from sph.scene import Scene
from sph.simulation import Simulation

CONFIGS = Path(__file__).parents[1] / "configs"
PARTICLES = {1: 100, 2: 400, 3: 1000}
COURANT = (0.15, 0.5, 1.0, 2.0)
BOOSTS = (1e-3, 1.0, 1e3, 1e6)  # of the speed of sound
DIRECTION = (1.0, 0.61, -0.37)
# Rounding of a boosted step, up to 1e-10 of the speed of sound, which chaos multiplies: drifts that
# differ by less are one, and those below NOISE may be rounding alone.
CHAOS = 0.3
NOISE = 1e-7


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("configs", nargs="*", type=Path)
    parser.add_argument("--steps", type=int, default=60)
    asked = parser.parse_args()
    wrong = 0
    for path in asked.configs or sorted(CONFIGS.glob("*.toml")):
        if set(configuration.load(path).problem.boundaries) == {"periodic"}:
            wrong += verdicts(path, asked.steps)
    sys.exit(min(wrong, 1))


def verdicts(path: Path, steps: int) -> int:
    """Print the drifts of one scene; the number of verdicts that differ from that at rest."""
    wrong = 0
    for C in COURANT:
        config = configuration.load(path)
        n = PARTICLES[config.problem.dimension]
        config = config.override([f"problem.n={n}", f"physics.C={C}"])
        still = drift(config, 0.0, steps)
        moving = [drift(config, boost, steps) for boost in BOOSTS]
        differ = [boost for boost, one in zip(BOOSTS, moving, strict=True) if not same(still, one)]
        wrong += len(differ)
        told = "  ".join(f"{one:9.2e}" for one in (still, *moving))
        verdict = f"DIFFERS at {differ}" if differ else "same"
        print(f"{path.stem:24s} C = {C:<5g} {told}  {verdict}", flush=True)
    return wrong


def drift(config, boost: float, steps: int) -> float:
    """Largest energy drift in so many steps, inf where the run stopped itself."""
    clock = Clock()
    simulation = Simulation.of_problem(Scene(config), 2, clock)
    p = simulation.particles
    u, gamma = np.median(p.internal_energy), simulation.scene.eos.gamma
    along = np.array(DIRECTION[: p.dimension])[:, None]
    p.velocity += boost * math.sqrt(gamma * (gamma - 1.0) * u) * along
    largest = 0.0
    try:
        simulation.begin()
        while simulation.time < config.time.end and simulation.step < steps:
            simulation.advance(config.time.end)
            largest = max(largest, abs(simulation.energy_drift))
    except NumericalError:
        largest = math.inf
    simulation.close()
    clock.close()
    return largest


def same(still: float, moving: float) -> bool:
    """Whether both stop, or energy drifts by the same but for what chaos makes of rounding."""
    if math.isinf(still) or math.isinf(moving):
        return still == moving
    return abs(moving - still) <= CHAOS * still or max(still, moving) < NOISE


if __name__ == "__main__":
    main()
