"""An initial state of gas from a file: HDF5 of GADGET or SWIFT, .npz, or a checkpoint."""

import os
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PrivateAttr, field_validator, model_validator

from sph.errors import ConfigError
from sph.problems import base, files
from sph.problems.base import Fault
from sph.problems.files import contents
from sph.problems.files.units import Conversion
from sph.quantity import UNIT_RANGE

_SHARED = base.Problem.model_fields

# What a file states. If these keys are given, as in the configuration of a run, no file is needed.
FILLED_IN = ("sha256", "dimension", "n", "domain", "boundary")


class Problem(base.Problem):
    """Gas whose initial state is in a file. No exact solution is known."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 1.0,
        "output.interval": 0.1,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-3, "error of the leapfrog in any flow"),
    }
    profiled: ClassVar = False
    paths: ClassVar = ("path",)
    filled_in: ClassVar = ("path", *FILLED_IN, "file_units")

    name: Literal["file"] = "file"
    path: str = Field(
        default="",
        description="HDF5 file in the layout of GADGET or SWIFT, an .npz file, or a checkpoint of "
        "a run; a relative path begins at the directory of the configuration file, one of --set at "
        "the current directory; a sample of two clouds that collide if not given",
        examples=["ic.hdf5"],
    )
    sha256: str = Field(
        default="",
        pattern="^([0-9a-f]{64})?$",
        description="SHA-256 of the file in hexadecimal digits; checked if given, that of the file "
        "otherwise, so that a run and its checkpoints tell from which file the run began",
        examples=["0" * 64],
    )
    file_units: list[Annotated[float, Field(ge=UNIT_RANGE[0], le=UNIT_RANGE[1])]] | None = Field(
        default=None,
        description="units of length, mass and time of the numbers in the file, in cm, g and s: "
        "those that the file states if not given, [] if it states none; with [units], numbers are "
        "converted to these, otherwise they are taken as they are",
        examples=[[3.0857e21, 1.9884e43, 3.0857e16]],
    )
    dimension: Annotated[int, _SHARED["dimension"]] = Field(
        default=2,
        description="number of space dimensions; if not given, Dimension of /HydroScheme or "
        "/Header, or the number of columns of the coordinates",
        examples=[3],
    )
    n: int = Field(
        default=1,
        ge=1,
        le=100_000_000,
        description="number of particles; that of the file if not given",
        examples=[10000],
    )
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[0.0, 1.0],
        description="ends of the box: [lo, hi] for all axes, or a list with one [lo, hi] per axis; "
        "the box of the file if not given, or the extent of the particles if the file has none",
        examples=[[0.0, 1.0]],
    )
    boundary: Annotated[base.Boundary | list[base.Boundary], _SHARED["boundary"]] = Field(
        default="periodic",
        description='"periodic", "mirror" (reflecting wall) or "open" (vacuum outside) for all '
        "axes, or a list with one per axis; if not given, that of a checkpoint, periodic if the "
        "file has a box, otherwise open",
        examples=["periodic"],
    )

    _conversion: Conversion = PrivateAttr(default=Conversion())

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, keys: Any) -> Any:
        if not isinstance(keys, dict):
            return keys
        keys, faults = cls.filled(keys)
        if faults:
            raise base.refused(faults)
        return keys

    @classmethod
    def filled(
        cls, keys: dict[str, Any], units: base.Units | None = None
    ) -> tuple[dict[str, Any], list[Fault]]:
        """Return the keys with those that the file states, and faults of keys that contradict it.

        Raises FileError if the file cannot be used. Does not read the file if all keys are given.
        """
        path, dimension = keys.get("path") or str(files.SAMPLE), keys.get("dimension")
        if not isinstance(path, str) or dimension not in (None, 1, 2, 3):
            return keys, []  # reported by the check of types
        path = os.path.abspath(path)
        if not path.isprintable():
            return keys, [Fault(("path",), f"= {path!a}: expected printable UTF-8 text")]
        if all(keys.get(name) for name in FILLED_IN):
            return keys, []
        found = files.read(path, dimension, Conversion(_given(keys.get("file_units")), units))
        dimension = len(found.position)
        box = contents.extent(found.position) if found.box is None else found.box
        stated = {
            "sha256": found.sha256,
            "dimension": dimension,
            "n": found.mass.size,
            "domain": box.tolist(),
            "boundary": found.boundary,
            "file_units": list(found.units or ()),
        }
        given = {name: value for name, value in keys.items() if value not in ("", None)}
        if given.get("file_units") == []:
            del given["file_units"]
        return stated | given | {"path": path}, _contradictions(given, stated)

    @field_validator("file_units")
    @classmethod
    def _three_or_none(cls, given: list[float] | None) -> list[float] | None:
        if given is not None and len(given) not in (0, 3):
            raise ValueError("expected three numbers, the units of length, mass and time")
        return given

    def in_units(self, units: base.Units | None) -> "Problem":
        """Return the problem with the units of the run.

        Raises FileError if a particle is outside the box, where the file has just been read.
        """
        found = self.model_copy()
        found._conversion = Conversion(_given(self.file_units), units)
        kept = files.kept(self.path, self.sha256, self.dimension, found._conversion)
        if kept is not None and self.box.shape == (len(self.boundaries), 2):
            contents.check_inside(kept, self.box, self.boundaries)
        return found

    def remarks(self) -> list[str]:
        """Return what becomes of the units of the file; nothing if none are stated anywhere."""
        of_file, of_run = self._conversion
        if of_file is None:
            text = "states no units: its numbers are taken as they are, in the units of [units]."
            return [f"{self.path} {text}"] if of_run and self.file_units is not None else []
        words = "length {:.6g} cm, mass {:.6g} g, time {:.6g} s".format(*of_file)
        if of_run is not None:
            if of_file == of_run:
                return [f"{self.path} is in the units of [units]."]
            return [f"{self.path}: numbers are converted from its units ({words}) to [units]."]
        return [
            f"{self.path} states units: {words}. Its numbers are taken as they are, and the output "
            "states no units, because the configuration has no [units].\nTry, to keep these units: "
            "[units] with length = {!r}, mass = {!r}, time = {!r}".format(*of_file)
        ]

    def fills_box(self, eos) -> bool:
        """Return False: positions are arbitrary."""
        return False

    def initial(self, eos) -> base.InitialState:
        """Return the particles of the file, in the order of their IDs if the file has some."""
        found = files.take(self.path, self.sha256, self.dimension, self._conversion)
        stated = {"sha256": found.sha256, "n": found.mass.size}
        if faults := _contradictions(self.model_dump(), stated):
            raise ConfigError("\n".join(f"problem.{one.path[0]} {one.text}" for one in faults))
        contents.check_inside(found, self.box, self.boundaries)
        return base.InitialState(
            found.position, found.velocity, found.mass, found.internal_energy, found.others
        )


def _contradictions(given: dict[str, Any], stated: dict[str, Any]) -> list[Fault]:
    """Return faults of the SHA-256 and the number of particles that differ from the file's."""
    found = []
    if given.get("sha256", stated["sha256"]) != stated["sha256"]:
        text = (
            f'= "{given["sha256"]}": the file has changed, or is another one: its SHA-256 is '
            f"{stated['sha256']}. Try: the original file, or leave sha256 out"
        )
        found.append(Fault(("sha256",), text))
    if given.get("n", stated["n"]) != stated["n"]:
        text = f"= {given['n']}: expected {stated['n']}, the number of particles in the file"
        found.append(Fault(("n",), f"{text}. Try: leave n out"))
    return found


def _given(units: Any) -> base.Units | None:
    """Return the key `file_units` as a tuple; None if not given, or wrong, as types tell later."""
    if not isinstance(units, list) or len(units) != 3:
        return None
    numbers = all(isinstance(one, int | float) and one > 0.0 for one in units)
    return (float(units[0]), float(units[1]), float(units[2])) if numbers else None
