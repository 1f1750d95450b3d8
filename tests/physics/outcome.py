"""Run a shipped configuration in memory and keep what it says of itself."""

from dataclasses import dataclass
from pathlib import Path

from sph.analysis import errors, truth
from sph.clock import Clock
from sph.scene import Scene
from sph.simulation import Simulation

CONFIGS = Path(__file__).parents[2] / "configs"


@dataclass
class Outcome:
    """The end of a run and its figures."""

    simulation: Simulation
    energies: list[float]
    momenta: list
    diagnostics: list[dict]
    times: list[float]

    @property
    def particles(self):
        return self.simulation.particles

    @property
    def pressure(self):
        return self.simulation.scene.formulation.pressure(self.particles)

    @property
    def energy_drift(self) -> float:
        return max(abs(e - self.energies[0]) for e in self.energies) / abs(self.energies[0])

    def l1(self, field: str) -> float:
        scene, time = self.simulation.scene, self.simulation.time
        found = errors.against_exact(scene.config, time, self.particles, self.pressure)
        return found["fields"][field]["L1"]

    def report(self) -> dict[str, float]:
        scene, time = self.simulation.scene, self.simulation.time
        return truth.figures(scene.config, time, self.particles, self.pressure)


def simulate(config, max_steps: int | None = None) -> Outcome:
    """Run to config.time.end, or for max_steps steps."""
    clock = Clock()
    simulation = Simulation.start(Scene(config), threads=2, clock=clock)
    outcome = Outcome(simulation, [], [], [], [])

    def note():
        outcome.energies.append(simulation.totals.energy)
        outcome.momenta.append(simulation.totals.momentum)
        outcome.times.append(simulation.time)
        outcome.diagnostics.append(config.problem.diagnostics(simulation.particles))

    note()
    while simulation.time < config.time.end and simulation.step != max_steps:
        simulation.advance(config.time.end)
        note()
    simulation.close()
    clock.close()
    return outcome
