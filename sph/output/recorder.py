"""Frames during a run: when one is due, and writing it."""

from contextlib import AbstractContextManager, nullcontext

from sph.config import Config
from sph.output import frames
from sph.output.frames import Frames
from sph.output.times import next_frame
from sph.simulation import Simulation


class Recorder:
    """Writes the frames of a run. Without the key output.frames no frame is ever due."""

    def __init__(self, config: Config, directory: Frames):
        self._end, self._number = config.time.end, config.output.frames
        self._directory = directory
        self.due = next_frame(0.0, self._end, self._number)  # time from which on

    def held(self) -> AbstractContextManager:
        """Within the block, hold the directory of the frames."""
        return nullcontext() if self._number is None else self._directory.held()

    def begin(self, simulation: Simulation) -> None:
        """Write the first frame, if the run is to have frames and has none yet."""
        self.due = next_frame(simulation.time, self._end, self._number)
        if self._number is not None and not self._directory.paths():
            self._write(simulation)

    def record(self, simulation: Simulation) -> None:
        """Write a frame if it is due. To be called before the checkpoint of the same step.

        Otherwise a restart from that checkpoint could miss the frame of a run that was killed.
        """
        if simulation.time >= self.due:
            self._write(simulation)
            self.due = next_frame(simulation.time, self._end, self._number)

    def _write(self, simulation: Simulation) -> None:
        particles, step = simulation.particles, simulation.step
        with simulation.clock.phase("output"):
            pressure = simulation.scene.formulation.pressure(particles)
            path = self._directory.path_of(step)
            frames.write(path, particles, pressure, simulation.time, step)
