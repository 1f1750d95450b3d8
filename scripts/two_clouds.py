"""Write an initial state of two clouds that collide, in the layout of SWIFT.

python scripts/two_clouds.py [FILE]

Without FILE the sample that ships with the program is replaced: problem.name = "file" reads it if
no path is given. The clouds are those of problem.name = "regions" with its defaults. The file is an
example of the layout, with plain h5py.
"""

import sys

import h5py
import numpy as np

from sph import config
from sph.problems import files


def write(path) -> None:
    """Write the particles of the problem `regions` to an HDF5 file."""
    scene = config.from_text('[problem]\nname = "regions"\n')
    gas = scene.problem.initial(scene.physics.eos_model())
    n = gas.mass.size
    with h5py.File(path, "w") as file:
        header = file.create_group("Header")
        header.attrs["NumPart_ThisFile"] = [n, 0, 0, 0, 0, 0]
        header.attrs["NumPart_Total"] = [n, 0, 0, 0, 0, 0]
        header.attrs["NumFilesPerSnapshot"] = 1
        header.attrs["MassTable"] = np.zeros(6)
        header.attrs["BoxSize"] = 1.0
        header.attrs["Dimension"] = 2
        header.attrs["Flag_Entropy_ICs"] = 0
        group = file.create_group("PartType0")
        flat = np.zeros((1, n))  # coordinates and velocities have three components in 2-D, too
        for name, array in {
            "Coordinates": np.vstack([gas.position, flat]).T,
            "Velocities": np.vstack([gas.velocity, flat]).T,
            "Masses": gas.mass,
            "InternalEnergy": gas.internal_energy,
            "ParticleIDs": np.arange(1, n + 1),
        }.items():
            group.create_dataset(
                name, data=array, compression="gzip", shuffle=True, track_times=False
            )


if __name__ == "__main__":
    write(sys.argv[1] if len(sys.argv) > 1 else files.SAMPLE)
