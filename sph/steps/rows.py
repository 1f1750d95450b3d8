"""Rows of the history, as columns: from a simulation, or from a table of compiled steps."""

from typing import Any

import numpy as np

from sph.integrators.step_size import CRITERIA, StepLimit
from sph.scene import Scene
from sph.steps import driver

Columns = dict[str, list]


def of_simulation(simulation: Any) -> Columns:
    """Return the row of the present state, and the next step allowed. Raises NumericalError."""
    s, totals, limit = simulation, simulation.totals, simulation.limit
    momentum = zip("xyz", totals.momentum.tolist(), strict=False)
    row = {
        "step": s.step,
        "t": s.time,
        "dt": limit.dt,
        "limiter_particle": limit.particle,
        "limiter": limit.criterion,
        "kinetic_energy": totals.kinetic_energy,
        "kinetic_energy_without_bulk": totals.kinetic_energy_without_bulk,
        "internal_energy": totals.internal_energy,
        "total_energy": totals.energy,
        "energy_drift": s.energy_drift,
        "energy_injected": s.energy_injected,
        **{f"momentum_{axis}": component for axis, component in momentum},
        "min_density": totals.min_density,
        "max_density": totals.max_density,
        "min_internal_energy": totals.min_internal_energy,
        "max_internal_energy": totals.max_internal_energy,
        "wall_seconds": s.clock.wall,
        "cpu_seconds": s.clock.cpu,
        **s.columns(),
    }
    return {name: [value] for name, value in row.items()}


def of_table(scene: Scene, table: np.ndarray, first: int) -> Columns:
    """Return the rows of steps from the number `first`; `table` has the rows of `driver`."""
    columns = table.T
    axes = "xyz"[: scene.dimension]
    found = {
        "t": columns[driver.TIME],
        "dt": columns[driver.STEP_LIMIT],
        "limiter_particle": columns[driver.LIMITER].astype(np.int64),
        "kinetic_energy": columns[driver.KINETIC],
        "kinetic_energy_without_bulk": columns[driver.RELATIVE],
        "internal_energy": columns[driver.INTERNAL],
        "total_energy": columns[driver.KINETIC] + columns[driver.INTERNAL],
        "energy_drift": columns[driver.DRIFT],
        "energy_injected": columns[driver.INJECTED],
        **{f"momentum_{axis}": columns[driver.MOMENTUM + d] for d, axis in enumerate(axes)},
        "min_density": columns[driver.MIN_DENSITY],
        "max_density": columns[driver.MAX_DENSITY],
        "min_internal_energy": columns[driver.MIN_ENERGY],
        "max_internal_energy": columns[driver.MAX_ENERGY],
        "wall_seconds": columns[driver.WALL],
        "cpu_seconds": columns[driver.CPU],
    }
    if "held_supports" in scene.columns:
        found["held_supports"] = columns[driver.HELD].astype(np.int64)
    if "volume_ratio" in scene.columns:
        found["volume_ratio"] = columns[driver.VOLUME] / scene.domain.volume
    lists = {name: column.tolist() for name, column in found.items()}
    lists["step"] = list(range(first, first + len(table)))
    criteria = _criteria(scene)
    lists["limiter"] = [criteria[int(index)] for index in columns[driver.CRITERION]]
    return lists


def limit_of(scene: Scene, row: list[float]) -> StepLimit:
    """Return the limit of the next step from a row of `driver`."""
    criterion = _criteria(scene)[int(row[driver.CRITERION])]
    return StepLimit(row[driver.STEP_LIMIT], int(row[driver.LIMITER]), criterion)


def set_limit(row: np.ndarray, limit: StepLimit) -> None:
    """Write the limit of the next step, reduced by `step_size.before_contact`, to a row."""
    row[driver.STEP_LIMIT], row[driver.LIMITER] = limit.dt, limit.particle
    if limit.criterion == "approach":
        row[driver.CRITERION] = CRITERIA.index(limit.criterion)


def _criteria(scene: Scene) -> tuple[str, ...]:
    return scene.step_bounds.criterion, *CRITERIA[1:]
