"""Meaning and unit of the columns of history.csv, one row for each step.

Parts declare further columns (`Part.columns`), and so do problems (`Problem.quantities`).
"""

from collections.abc import Mapping

from sph import quantity as units
from sph.quantity import Quantity

AXES = "xyz"

# Of every run. `limiter_particle` and `limiter` belong to the next step, whose length is `dt`.
OF_ALL: Mapping[str, Quantity] = {
    "step": Quantity("number of the step, 0 for the initial state"),
    "t": Quantity("time at the end of the step", units.TIME),
    "dt": Quantity(
        "longest allowed length of the next step; a step is shorter where it ends at an output",
        units.TIME,
    ),
    "limiter_particle": Quantity("ID of the particle that limits dt, 0 if no particle does"),
    "limiter": Quantity("criterion that limits dt"),
    "kinetic_energy": Quantity("kinetic energy of all particles", units.ENERGY),
    "kinetic_energy_without_bulk": Quantity(
        "kinetic energy relative to the mean velocity, along axes that conserve momentum",
        units.ENERGY,
    ),
    "internal_energy": Quantity("internal energy of all particles", units.ENERGY),
    "total_energy": Quantity(
        "sum of kinetic, internal and, where the run has them, potential energies", units.ENERGY
    ),
    "energy_drift": Quantity(
        "change of the energy without bulk motion since the start, less the energy that sources "
        "added, over the energy at the start"
    ),
    "energy_injected": Quantity(
        "energy that kept internal energies positive since the start, part of the energy drift",
        units.ENERGY,
    ),
    **{
        f"momentum_{axis}": Quantity(f"momentum of all particles along {axis}", units.MOMENTUM)
        for axis in AXES
    },
    "min_density": Quantity("smallest density of a particle", units.DENSITY),
    "max_density": Quantity("largest density of a particle", units.DENSITY),
    "min_internal_energy": Quantity(
        "smallest internal energy per unit mass of a particle", units.SPECIFIC_ENERGY
    ),
    "max_internal_energy": Quantity(
        "largest internal energy per unit mass of a particle", units.SPECIFIC_ENERGY
    ),
    "wall_seconds": Quantity(
        "elapsed time since the start, all sessions, with compilation", units.SECONDS
    ),
    "cpu_seconds": Quantity(
        "CPU time of all threads since the start, all sessions, without compilation",
        units.CPU_SECONDS,
    ),
}

# Of some runs, with the condition.
OF_SOME: Mapping[str, tuple[Quantity, str]] = {
    "held_supports": (
        Quantity("number of particles whose support radius is held at physics.max_support"),
        "all boundaries are open",
    ),
    "volume_ratio": (
        Quantity("sum of m/rho over the volume of the box"),
        "gas fills a closed box",
    ),
    "energy_added": (
        Quantity("energy that sources added since the start", units.ENERGY),
        "a part adds energy (physics.heating)",
    ),
    "shortest_step": (
        Quantity("shortest step of a particle in this long step", units.TIME),
        'time.stepping = "individual"',
    ),
    "updates": (
        Quantity("number of updates of a particle in this long step"),
        'time.stepping = "individual"',
    ),
}


def shared(dimension: int) -> list[str]:
    """Return the columns of every run in that number of dimensions, in order."""
    unused = {f"momentum_{axis}" for axis in AXES[dimension:]}
    return [name for name in OF_ALL if name not in unused]
