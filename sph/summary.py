"""The figures of a run in summary.json: the only definition of each name and unit.

Code units unless a unit is given. `sph.analysis.summary` computes the figures; every reader of
summary.json takes `of_json` and these names.

Times have one meaning in summary.json, history.csv, reports and tables (`sph.clock` measures them):

CPU seconds         user + system time of all threads, without compilation and without the start of
                    Numba, which do not grow with the work
wall-clock seconds  elapsed time, with compilation and the start of Numba
"""

import json
from collections.abc import Mapping
from types import UnionType
from typing import (
    Any,
    Literal,
    NotRequired,
    TypedDict,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from sph.clock import STARTING

# JSON has no such numbers: summary.json holds them as these strings.
NON_FINITE = ("nan", "inf", "-inf")


Status = Literal["done", "stopped", "failed"]


class AbsoluteNorms(TypedDict):
    """Norms of the error of a field, in the units of the field (`sph.analysis.errors.norms`)."""

    L1: float
    L2: float
    Linf: float


class Norms(AbsoluteNorms):
    """With L1 relative to the exact field (`sph.analysis.errors.by_field`)."""

    relative_L1: float | None  # None where the exact field is zero everywhere


class Errors(TypedDict):
    """Errors at the end of the run, over some of the particles."""

    against: NotRequired[str]  # the exact solution, in words, or else:
    reference: NotRequired[str]  # the run directory that the errors are against
    region: str  # where errors are taken, in words
    particles: int  # in that region
    fields: dict[str, Norms]  # by density, velocity, pressure, internal_energy, stress


class Conservation(TypedDict):
    """What the run conserved, over its whole history."""

    # Change of energy over the energy at the start (`sph.totals.Baseline`): without bulk motion and
    # without what sources added. At the end, and its largest modulus at any step.
    energy_drift: float
    energy_drift_max: float
    # Energy that kept internal energies positive: a part of the drift, over the same scale.
    energy_injected: float
    # Largest |P - P_0| at any step over sum m (|v - v_bulk| + c_s) of the last state, along the
    # axes that conserve momentum; None where no axis does (walls, an outer force).
    momentum_change: float | None
    # Sum m/rho over the volume of the box, at the end and at the step where it is farthest from 1;
    # None where gas does not fill a closed box.
    volume_ratio: float | None
    volume_ratio_worst: float | None


class Nearest(TypedDict):
    """Distance to the nearest neighbour at the end of the run, in particle spacings."""

    median: float
    smallest: float


class Tearing(TypedDict):
    """Solid bodies, and their connected pieces at the end of the run (eq 454)."""

    bodies: int
    pieces: int


class Session(TypedDict):
    """Cost of the last session, that is of one call of `sph run` or `sph restart`."""

    steps: int
    updates: int  # of a particle: particles times steps, unless steps are individual
    updates_per_cpu_second: int | None
    cpu_seconds: float
    wall_seconds: float
    compile_cpu_seconds: float  # CPU time of compilation, which `cpu_seconds` leaves out
    phases_cpu_seconds: dict[str, float]  # by phase; also STARTING, which `cpu_seconds` leaves out
    list_builds: int  # of the neighbour lists
    peak_memory_bytes: int


class Cost(TypedDict):
    """Cost of the run: of all its sessions, and of the last one."""

    cpu_seconds: float
    wall_seconds: float
    threads: int  # of the last session
    updates: NotRequired[int]  # of a particle; not in summaries of earlier versions
    session: Session


class Warned(TypedDict):
    """A warning that the run ended with (`sph.warnings`)."""

    kind: str
    text: str


class Summary(TypedDict):
    """A run that has ended."""

    status: Status
    reason: str | None  # why the run stopped or failed
    warnings: list[Warned]
    version: str  # of sph
    problem: str
    dimension: int
    particles: int
    time: float  # reached
    steps: int  # of all sessions
    lineage: list[str]  # a sentence for each restart
    settings_changed: list[str]  # by restarts
    errors: Errors | None
    errors_left_out: str | None  # why there are no errors
    report: dict[str, float] | None  # the problem's own figures; None where the run failed
    conservation: Conservation
    nearest: Nearest | None  # None where the run failed
    tearing: NotRequired[Tearing]  # not without solid bodies, nor where the run failed
    cost: Cost
    compiled_in: list[str]  # parts of the scene
    left_out: list[str]  # parts that the scene does without


def of_json(text: str) -> Summary:
    """The summary in the text of a summary.json, NaN and infinities as floats.

    Raises ValueError, which names the figure, where one is missing or is of another type.
    """
    return _read(json.loads(text), Summary, "")


def lookup(table: Mapping[str, Any], name: str) -> Any:
    """The figure of a summary, or a table of one, such as conservation.energy_drift; or None."""
    found: Any = table
    for step in name.split("."):
        found = found.get(step) if isinstance(found, dict) else None
    return found


def figure(summary: Summary, name: str) -> float | None:
    """The figure that a problem's limit of that name holds; None where a run has no such figure.

    "energy_drift" is the largest at any step, "l1.FIELD" the L1 error of a field, and any other
    name one of `report` or `conservation`.
    """
    if name.startswith("l1."):
        return lookup(summary, f"errors.fields.{name.removeprefix('l1.')}.L1")
    if name == "energy_drift":
        return summary["conservation"]["energy_drift_max"]
    table = "report" if name in (summary["report"] or {}) else "conservation"
    return lookup(summary, f"{table}.{name}")


def wall_without_start(cost: Cost) -> float:
    """Wall-clock seconds without compilation and the start of Numba, both the work of one thread.

    These two are known of the last session alone: those of earlier sessions stay in.
    """
    session = cost["session"]
    start = session["phases_cpu_seconds"].get(STARTING, 0.0)
    return cost["wall_seconds"] - session["compile_cpu_seconds"] - start


def _read(value: Any, hint: Any, where: str) -> Any:
    """`value` as `hint` has it. Raises ValueError."""
    if get_origin(hint) is UnionType:
        return None if value is None else _read(value, get_args(hint)[0], where)
    if hint is float and value in NON_FINITE:
        return float(value)
    if is_typeddict(hint) and isinstance(value, dict):
        return value | _read_table(value, hint, where)
    if get_origin(hint) is dict and isinstance(value, dict):
        of_each = get_args(hint)[1]
        return {key: _read(one, of_each, f"{where}.{key}") for key, one in value.items()}
    if get_origin(hint) is list and isinstance(value, list):
        (of_each,) = get_args(hint)
        return [_read(one, of_each, f"{where}.{i}") for i, one in enumerate(value)]
    if get_origin(hint) is Literal and value in get_args(hint):
        return value
    is_plain = hint in (str, int, float)
    if is_plain and isinstance(value, int | float if hint is float else hint):
        return value
    raise ValueError(f"{where.lstrip('.') or 'the file'} is {value!r}")


def _read_table(table: dict, hint: Any, where: str) -> dict:
    hints = get_type_hints(hint)
    for name in hints:
        if name in hint.__required_keys__ and name not in table:
            raise ValueError(f"{f'{where}.{name}'.lstrip('.')} is missing")
    return {
        name: _read(table[name], hints[name], f"{where}.{name}") for name in hints if name in table
    }
