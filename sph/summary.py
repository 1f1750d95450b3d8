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
    Annotated,
    Any,
    Literal,
    NotRequired,
    TypedDict,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from sph import quantity
from sph.clock import STARTING
from sph.quantity import Quantity

# JSON has no such numbers: summary.json holds them as these strings.
NON_FINITE = ("nan", "inf", "-inf")


Status = Literal["done", "stopped", "failed"]

FIELD = "unit of the field"


class AbsoluteNorms(TypedDict):
    """Norms of the error of a field, in the units of the field (`sph.analysis.errors.norms`)."""

    L1: Annotated[float, Quantity("mean |error|, weighted by volume", FIELD)]
    L2: Annotated[float, Quantity("root mean square error, weighted by volume", FIELD)]
    Linf: Annotated[float, Quantity("largest |error|", FIELD)]


class Norms(AbsoluteNorms):
    """With L1 relative to the exact field (`sph.analysis.errors.by_field`)."""

    relative_L1: Annotated[
        float | None,
        Quantity("L1 over the mean |exact field|; none where the exact field is zero everywhere"),
    ]


class Errors(TypedDict):
    """Errors at the end of the run, over some of the particles."""

    against: NotRequired[Annotated[str, Quantity("the exact solution, in words, or else:")]]
    reference: NotRequired[
        Annotated[str, Quantity("the run directory that the errors are against")]
    ]
    region: Annotated[str, Quantity("where errors are taken, in words")]
    particles: Annotated[int, Quantity("number of particles in that region")]
    fields: Annotated[
        dict[str, Norms],
        Quantity("by field: density, velocity, pressure, internal_energy, stress"),
    ]


class Conservation(TypedDict):
    """What the run conserved, over its whole history."""

    energy_drift: Annotated[
        float,
        Quantity(
            "change of energy since the start over the energy at the start, without bulk motion "
            "and without the energy that sources added; at the end"
        ),
    ]
    energy_drift_max: Annotated[float, Quantity("largest |energy drift| at any step")]
    energy_injected: Annotated[
        float,
        Quantity(
            "energy that kept internal energies positive, a part of the drift, over the energy at "
            "the start"
        ),
    ]
    momentum_change: Annotated[
        float | None,
        Quantity(
            "largest |P - P_0| at any step over the sum of m (|v - v_bulk| + c_s) of the last "
            "state, along axes that conserve momentum; none where no axis does"
        ),
    ]
    volume_ratio: Annotated[
        float | None,
        Quantity(
            "sum of m/rho over the volume of the box, at the end; none where gas does not fill a "
            "closed box"
        ),
    ]
    volume_ratio_worst: Annotated[
        float | None, Quantity("volume_ratio at the step where it is farthest from 1")
    ]


class Nearest(TypedDict):
    """Distance to the nearest neighbour at the end of the run, in particle spacings."""

    median: Annotated[float, Quantity("median over the particles, in particle spacings")]
    smallest: Annotated[float, Quantity("smallest of all particles, in particle spacings")]


class Tearing(TypedDict):
    """Solid bodies, and their connected pieces at the end of the run (eq 454)."""

    bodies: Annotated[int, Quantity("number of solid bodies")]
    pieces: Annotated[int, Quantity("number of their connected pieces at the end, eq 454")]


class Relaxation(TypedDict):
    """How relaxation of the particles to a glass ended, before the first step (eqs 460-463)."""

    iterations: Annotated[int, Quantity("number of iterations")]
    density_error: Annotated[
        float,
        Quantity("rms scatter of the density sums about their mean, over that mean, eq 461"),
    ]
    mean_offset: Annotated[
        float,
        Quantity(
            "mean of the density sums over the density of the problem, minus 1: an error of the "
            "kernel sum, which lattices have as well"
        ),
    ]
    cpu_seconds: Annotated[
        float,
        Quantity(
            "CPU time of placing and relaxing the particles, a part of cost.cpu_seconds",
            quantity.CPU_SECONDS,
        ),
    ]


class Session(TypedDict):
    """Cost of the last session, that is of one call of `sph run` or `sph restart`."""

    steps: Annotated[int, Quantity("number of steps")]
    updates: Annotated[
        int,
        Quantity(
            "number of updates of a particle: particles times steps, unless steps are individual"
        ),
    ]
    updates_per_cpu_second: Annotated[
        int | None,
        Quantity(
            "updates over cpu_seconds without those of the initial state; none without steps",
            "(CPU s)^-1",
        ),
    ]
    cpu_seconds: Annotated[
        float,
        Quantity("CPU time, without compilation and the start of Numba", quantity.CPU_SECONDS),
    ]
    wall_seconds: Annotated[float, Quantity("elapsed time, with compilation", quantity.SECONDS)]
    compile_cpu_seconds: Annotated[float, Quantity("CPU time of compilation", quantity.CPU_SECONDS)]
    phases_cpu_seconds: Annotated[
        dict[str, float],
        Quantity(
            "CPU time by phase of a step, without compilation; also the start of Numba, which "
            "cpu_seconds leaves out",
            quantity.CPU_SECONDS,
        ),
    ]
    list_builds: Annotated[int, Quantity("number of times that neighbour lists were built")]
    peak_memory_bytes: Annotated[int, Quantity("largest resident memory of the process", "bytes")]


class Cost(TypedDict):
    """Cost of the run: of all its sessions, and of the last one."""

    cpu_seconds: Annotated[
        float, Quantity("CPU time of all sessions, without compilation", quantity.CPU_SECONDS)
    ]
    wall_seconds: Annotated[
        float, Quantity("elapsed time of all sessions, with compilation", quantity.SECONDS)
    ]
    threads: Annotated[int, Quantity("number of threads of the last session")]
    # not in summaries of earlier versions
    updates: NotRequired[Annotated[int, Quantity("number of updates of a particle")]]
    session: Annotated[Session, Quantity("cost of the last session")]


class Warned(TypedDict):
    """A warning that the run ended with (`sph.warnings`)."""

    kind: Annotated[str, Quantity("short name, see docs/warnings.md")]
    text: Annotated[str, Quantity("the warning, in words")]


class Summary(TypedDict):
    """A run that has ended."""

    status: Annotated[Status, Quantity('"done", "stopped" or "failed"')]
    reason: Annotated[str | None, Quantity("why the run stopped or failed; none if done")]
    warnings: Annotated[list[Warned], Quantity("assumptions of the result that do not hold")]
    version: Annotated[str, Quantity("version of sph that ended the run")]
    problem: Annotated[str, Quantity("name of the problem")]
    dimension: Annotated[int, Quantity("number of space dimensions")]
    particles: Annotated[int, Quantity("number of particles")]
    time: Annotated[float, Quantity("time that the run reached", quantity.TIME)]
    steps: Annotated[int, Quantity("number of steps of all sessions")]
    lineage: Annotated[list[str], Quantity("a sentence for each restart")]
    settings_changed: Annotated[list[str], Quantity("settings that restarts changed")]
    errors: Annotated[
        Errors | None, Quantity("errors of the last state; none where they are left out")
    ]
    errors_left_out: Annotated[str | None, Quantity("why there are no errors")]
    report: Annotated[
        dict[str, float] | None,
        Quantity("figures of the problem, listed with it; none where the run failed"),
    ]
    conservation: Annotated[Conservation, Quantity("what the run conserved, at any step")]
    # not in summaries of earlier versions
    momentum_along: NotRequired[
        Annotated[list[str], Quantity("axes along which nothing changes the momentum")]
    ]
    nearest: Annotated[
        Nearest | None,
        Quantity("distance to the nearest neighbour at the end; none where the run failed"),
    ]
    # not without solid bodies, nor where the run failed
    tearing: NotRequired[
        Annotated[Tearing, Quantity("pieces of solid bodies; only of runs with solids")]
    ]
    relaxation: NotRequired[
        Annotated[Relaxation, Quantity("relaxation to a glass; only of runs that begin from one")]
    ]
    cost: Annotated[Cost, Quantity("cost of all sessions, and of the last one")]
    compiled_in: Annotated[list[str], Quantity("physics that the run computed")]
    left_out: Annotated[list[str], Quantity("physics that the run left out, and why")]


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
