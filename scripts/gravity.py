"""Accuracy and cost of self-gravity, for several distributions of particles.

    python scripts/gravity.py                                default settings, 10,000 particles
    python scripts/gravity.py 1e4 1e5 1e6 --sets evrard      growth of the cost
    python scripts/gravity.py --order quadrupole octupole --angle 0.4 0.5 0.6

Errors are those of a sample of particles against direct summation: |a - a_direct|/|a_direct|, and
of the potential. The cost is the CPU time of both gravity passes in one thread, per particle.
`momentum` is |sum m a|/sum m |a|, zero if every force had an equal and opposite one. Prints
Markdown.
"""

import argparse
import time

import numpy as np

from sph import config, registry
from sph.clock import Clock
from sph.parts.gravity import FOLDER, OPENING_ANGLE
from sph.scene import Scene
from sph.simulation import Simulation
from sph.state import State

TEXT = """
[problem]
name = "uniform"
dimension = 3
n = 8
boundary = "open"
domain = [-20.0, 20.0]
[time]
end = 1.0
[output]
interval = 1.0
[physics.gravity]
"""


def directions(random, n):
    x = random.normal(size=(3, n))
    return x / np.sqrt((x**2).sum(axis=0))


def plummer(random, n):
    """97 % of the mass of a Plummer sphere of scale radius 1."""
    radius = 1 / np.sqrt(random.uniform(0, 0.97, n) ** (-2 / 3) - 1)
    return radius * directions(random, n)


def uniform(random, n):
    return random.uniform(0, 1, n) ** (1 / 3) * directions(random, n)


def evrard(random, n):
    """Density proportional to 1/r."""
    return random.uniform(0, 1, n) ** (1 / 2) * directions(random, n)


def clumps(random, n):
    """Five Plummer spheres whose sizes differ by a factor of 25."""
    shares, sizes = (0.4, 0.2, 0.2, 0.1, 0.1), (0.25, 0.1, 0.05, 0.025, 0.01)
    parts = [
        size * plummer(random, round(share * n)) + random.uniform(-2, 2, (3, 1))
        for share, size in zip(shares, sizes, strict=True)
    ]
    return np.concatenate(parts, axis=1)


SETS = {"plummer": plummer, "uniform": uniform, "evrard": evrard, "clumps": clumps}


def begun(position):
    """Return a simulation with converged supports of particles at these positions."""
    scene, n = Scene(config.from_text(TEXT)), position.shape[1]
    still, equal, energy = np.zeros_like(position), np.full(n, 1.0 / n), np.ones(n)
    simulation = Simulation(
        scene, State.at_start(scene.fields, position, still, equal, energy), 1, Clock()
    )
    simulation.begin()
    return simulation


def direct(simulation, chosen):
    """Return acceleration (3, M) and potential (M,) of the chosen particles, summed directly."""
    p, kernel, dim = simulation.particles, simulation.scene.physics.kernel_model(), (0, 0, 0)
    C, H, z = kernel.normalisation(dim), p.support, p.zeta
    acceleration, potential = [], []
    for i in chosen:
        x = p.position[:, i : i + 1] - p.position
        r = np.sqrt((x**2).sum(axis=0))
        pull = depth = 0.0
        for support, zeta in ((H[i], z[i]), (H, z)):
            wide = np.maximum(support, r)
            depth = depth + kernel.potential_depth(r / wide) / wide
            pull = pull + kernel.enclosed_over_q3(r / wide) / wide**3
            pull = pull + zeta * C * kernel.dw_over_q(dim, r / support) / support**5
        acceleration.append(-0.5 * (x * (p.mass * pull)).sum(axis=1))
        potential.append(-0.5 * (p.mass * depth).sum())
    return np.array(acceleration).T, np.array(potential)


def timed(simulation, one):
    """Make a pass of gravity, and return its CPU seconds."""
    simulation.sweep.neighbours = simulation.neighbours()
    start = time.process_time()
    simulation.sweep.make(one)
    return time.process_time() - start


def measured(simulation, order, angle, chosen, exact):
    """Return a row of the table."""
    (part,) = (one for one in simulation.scene.parts if one.name == "gravity")
    settings = {"order": order, "G": 1.0, "softening": 0.0, "opening_angle": angle}
    part.models = part.models._replace(expansion=registry.model(FOLDER, settings, "order"))
    p = simulation.particles
    best = np.inf
    for _ in range(3):
        p.acceleration[:] = 0.0
        best = min(best, sum(timed(simulation, one) for one in part.passes))
    a = p.acceleration
    errors = np.sqrt(((a[:, chosen] - exact[0]) ** 2).sum(axis=0) / (exact[0] ** 2).sum(axis=0))
    momentum = np.linalg.norm(a @ p.mass) / (np.sqrt((a**2).sum(axis=0)) @ p.mass)
    figures = (
        np.median(errors), np.quantile(errors, 0.99), errors.max(),
        np.median(abs(p.potential[chosen] / exact[1] - 1)), momentum,
    )  # fmt: skip
    return [*(f"{one:.1e}" for one in figures), f"{best / p.number * 1e6:.2f}"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("particles", nargs="*", type=float, default=[1e4])
    parser.add_argument("--sets", nargs="+", choices=SETS, default=[*SETS])
    orders = registry.names(FOLDER)
    parser.add_argument("--order", nargs="+", choices=orders, default=["octupole"])
    parser.add_argument("--angle", nargs="+", type=float, default=[OPENING_ANGLE])
    parser.add_argument("--sample", type=int, default=1000, help="particles summed directly")
    asked = parser.parse_args()
    head = ("particles", "distribution", "order", "angle", "median error", "99 %", "largest",
            "potential", "momentum", "CPU µs")  # fmt: skip
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    for number in map(int, asked.particles):
        for name in asked.sets:
            random = np.random.default_rng(1)
            simulation = begun(SETS[name](random, number))
            n = simulation.particles.number
            chosen = random.choice(n, min(n, asked.sample), replace=False)
            exact = direct(simulation, chosen)
            for order in asked.order:
                for angle in asked.angle:
                    row = measured(simulation, order, angle, chosen, exact)
                    print(
                        f"| {n:,} | {name} | {order} | {angle:g} | {' | '.join(row)} |", flush=True
                    )
            simulation.close()


if __name__ == "__main__":
    main()
