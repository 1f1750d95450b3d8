"""Open exports of `sph export --vtk` with VTK and pyvista; compare with the checkpoints.

    pip install '.[vtk]'
    python scripts/check_vtk.py

States of check_readers_states.py. Exits with 1 if VTK reads other numbers.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from check_readers_states import GASES, made_up_gas, made_up_solid

from sph.analysis.export import fields, vtk


def opened(path: Path, step: int):
    """The grid of a time step, as pyvista sees it, and its time; None if the file has one step."""
    import pyvista
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    reader.SetStep(step)
    reader.Update()
    return pyvista.wrap(reader.GetOutput()), times[step] if times else None


def faults(states, path: Path) -> list[str]:
    """What VTK reads from the export of `states` and is not what they hold."""
    vtk.write(iter(states), path)
    found = []
    for step, state in enumerate(states):
        grid, time = opened(path, step)
        D = state.particles.dimension
        seen = {
            "time": state.time if time is None else time,
            "position": grid.points[:, :D],
            "cells": grid.n_cells,
        }
        expected = {
            "time": state.time, "position": fields.position(state), "cells": grid.n_points
        }  # fmt: skip
        for one in fields.of(state):
            values = one.values.reshape(len(one.values), -1) if one.values.ndim > 2 else one.values
            seen[one.name] = grid.point_data[one.name]
            if values.ndim == 2:
                seen[one.name] = seen[one.name][:, : values.shape[1]]
            expected[one.name] = values
        found += [
            f"step {step}: {name}"
            for name in expected
            if not np.array_equal(seen[name], expected[name])
        ]
    return found


def main() -> int:
    cases = {f"gas in {D}-D": [made_up_gas(D)] for D in GASES}
    cases["solid"] = [made_up_solid()]
    later = made_up_gas(2)
    later.time += 1.0
    later.particles.density *= 2.0
    cases["two steps"] = [made_up_gas(2), later]
    failed = False
    for name, states in cases.items():
        with tempfile.TemporaryDirectory() as directory:
            found = faults(states, Path(directory) / "particles.vtkhdf")
        failed |= bool(found)
        print(f"{name}: {', '.join(found) or 'VTK reads what was written'}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
