"""Initial states that swiftsimio's own writer wrote, stored because swiftsimio needs 170 MB.

    pip install swiftsimio==12.4.0
    PYTHONPATH=. python tests/unit/problems/swiftsimio_files.py

writes swiftsimio_2d.hdf5, in cm, g and s, and swiftsimio_3d.hdf5, in pc, solar masses and Myr,
beside this file. The particles are those of `ic_files.particles`.
"""

from pathlib import Path

import ic_files
import numpy as np

HERE = Path(__file__).parent
STORED = {2: HERE / "swiftsimio_2d.hdf5", 3: HERE / "swiftsimio_3d.hdf5"}


def write(path: Path, dimension: int) -> None:
    """Write the particles with swiftsimio."""
    import swiftsimio
    import unyt

    cgs = unyt.unit_systems.cgs_unit_system
    galactic = unyt.UnitSystem("galactic", "pc", "Msun", "Myr")
    length, mass, time = ("cm", "g", "s") if dimension == 2 else ("pc", "Msun", "Myr")

    def with_unit(array, unit, exponent=0):
        return swiftsimio.cosmo_array(
            array, unit, comoving=True, scale_factor=1.0, scale_exponent=exponent
        )

    state, speed = ic_files.particles(dimension), f"{length}/{time}"
    writer = swiftsimio.Writer(
        unit_system=cgs if dimension == 2 else galactic,
        boxsize=with_unit(np.ones(dimension), length, 1),
        dimension=dimension,
        scale_factor=1.0,
    )
    writer.gas.coordinates = with_unit(ic_files.padded(state["position"]), length, 1)
    writer.gas.velocities = with_unit(ic_files.padded(state["velocity"]), speed)
    writer.gas.masses = with_unit(state["mass"], mass)
    writer.gas.internal_energy = with_unit(state["internal_energy"], f"({speed})**2", -2)
    writer.gas.generate_smoothing_lengths()
    writer.write(str(path))


if __name__ == "__main__":
    for dimension, path in STORED.items():
        write(path, dimension)
