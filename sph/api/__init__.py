"""The Python interface: run a configuration, open a run, simulate particles given as arrays.

Import the names from `sph` itself, which loads this package on first use.
"""

from sph.api.arrays import Simulation
from sph.api.particles import Particles
from sph.api.results import Checkpoint, Run, open
from sph.api.runs import run
from sph.api.view import View

__all__ = ["Checkpoint", "Particles", "Run", "Simulation", "View", "open", "run"]
