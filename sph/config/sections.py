"""The tables other than [problem] and [physics]: type, default and help of each key."""

import os
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from sph.config.restarts import FREE, RECORDED, REFUSED, class_of
from sph.config.units import Units
from sph.problems.base import Section

Count = Annotated[int, Field(ge=1)]


class Time(Section):
    """Length of the run, in code units."""

    restart: ClassVar[str | None] = "free"
    end: float = Field(gt=0, description="time at which the run ends; every run starts at t = 0")
    stepping: Literal["global", "individual"] = Field(
        "global",
        description='time steps: "global", one step for all particles, or "individual", a step for '
        "each particle, which is faster where few particles need short steps; total energy and "
        "momentum are then conserved to the accuracy of the steps, not to round-off",
        json_schema_extra=REFUSED,  # type: ignore[arg-type]
    )


class Output(Section):
    """What the run writes."""

    restart: ClassVar[str | None] = "free"
    interval: float = Field(gt=0, description="time between checkpoints, in code units")
    frames: Annotated[int, Field(ge=2)] | None = Field(
        None,
        description="number of frames for movies, evenly spaced from t = 0 to time.end: small "
        "files with the fields that pictures show, in single precision; none if not given. A frame "
        "shows the end of the step that first reaches its time, so frames change no step; steps "
        "longer than the spacing make fewer frames",
        examples=[100],
    )


def _absolute(path: str) -> str:
    found = path and os.path.abspath(path)
    try:
        found.encode()  # configuration files are UTF-8
    except UnicodeEncodeError:
        raise ValueError(f"{found!a}: expected a path that is UTF-8 text") from None
    if "\0" in found:
        raise ValueError(f"{found!r}: expected a path without NUL characters")
    return found


class Report(Section):
    """Contents of the summary that is written when the run ends."""

    restart: ClassVar[str | None] = "free"
    reference: Annotated[str, AfterValidator(_absolute)] = Field(
        "",
        description="run directory of the same problem at higher resolution: errors are computed "
        "against that run instead of an exact solution; none if empty; a relative path is "
        "resolved against the current directory when the configuration is read",
    )


class Run(Section):
    """Resources and arithmetic of the run."""

    threads: Count | Literal["all"] = Field(
        "all",
        description='number of threads; "all" uses every processor that the process may use. The '
        "number of threads changes no result",
        json_schema_extra=FREE,  # type: ignore[arg-type]
    )
    precision: Literal["double", "single"] = Field(
        "double",
        description='precision of the sums over neighbours: "single" takes less time and changes '
        "results by about 1e-6. The state, and sums over all particles, are in double precision",
        json_schema_extra=RECORDED,  # type: ignore[arg-type]
    )


# Keys of [run] that change no result.
RESOURCES = tuple(key for key in Run.model_fields if class_of(Run, key) == "free")

SECTIONS: dict[str, type[Section]] = {
    "time": Time,
    "output": Output,
    "report": Report,
    "run": Run,
    "units": Units,
}
