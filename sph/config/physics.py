"""The table [physics]: the keys of every formulation, and those that parts declare."""

import functools
import re
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field, create_model, model_validator
from pydantic.fields import FieldInfo

from sph import declarations, parts, registry
from sph.config.choices import Choice, LabelledTable, ModelChoice, labelled_table, plain
from sph.config.restarts import CLASSES, FREE, RECORDED, REFUSED
from sph.config.toml_text import value_text
from sph.errors import DeclarationError
from sph.part import Key, Part
from sph.problems.base import Section

FORMULATIONS = "sph.formulations"
DEFAULT = "gas"
STRENGTHS = "sph.formulations.continuum.strength"


class Material(Section):
    """The laws of one of several materials."""

    eos: Annotated[Any, ModelChoice("sph.eos")] = Field(description="equation of state")
    strength: Annotated[Any, ModelChoice(STRENGTHS)] | None = Field(
        None, description="law for the deviatoric stress; a fluid if not given"
    )


class Physics(Section):
    """Equations and numerical method, in code units. "In a restart" says how `sph restart --set`
    may change the key: see the classes in docs/configuration.md.
    """

    # The formulation and every part that can join it.
    kinds: ClassVar[tuple[type[Part], ...]] = ()

    if TYPE_CHECKING:  # the keys that parts declare

        def __getattr__(self, name: str) -> Any: ...

    formulation: Annotated[str, Choice(FORMULATIONS, folders=True)] = Field(
        DEFAULT,
        description="kind of matter and its equations for density and rates of change",
        json_schema_extra=REFUSED,
    )
    kernel: Annotated[Any, ModelChoice("sph.kernels")] = Field(
        "wendland_c2",
        description="smoothing kernel W, zero beyond the support radius H",
        json_schema_extra=RECORDED,
    )
    gamma: Annotated[float, Field(gt=1)] | None = Field(
        1.4,
        description="adiabatic index of an ideal gas, the ratio of specific heats",
        json_schema_extra=REFUSED,
    )
    eos: Annotated[Any, ModelChoice("sph.eos")] | None = Field(
        None,
        description="equation of state, given instead of gamma; an ideal gas with gamma if not "
        "given",
        examples=[{"name": "ideal_gas", "gamma": 1.4}],
        json_schema_extra=REFUSED,
    )
    materials: dict[str, Material] | None = Field(
        None,
        description="the materials of a scene with several bodies by name, in place of gamma, eos "
        'and strength; formulation "continuum" only',
        examples=[{"water": {"eos": {"name": "tait", "rho_0": 1000.0, "c_0": 30.0}}}],
        json_schema_extra=REFUSED,
    )
    max_support: float = Field(
        1.0,
        gt=0,
        description="upper limit of the support radius, in units of the longest side of the "
        "domain; acts only where all axes are open, on particles with too few neighbours",
        json_schema_extra=RECORDED,
    )
    C: float = Field(
        0.15,
        gt=0,
        description="Courant number: the time step is C 2H/v_sig or less, with H the support "
        "radius and v_sig the signal speed; reduced automatically where the leapfrog would be "
        "unstable with the viscosity and the other dissipation of the run",
        json_schema_extra=RECORDED,
    )
    energy_limit: bool = Field(
        True,
        description="limit the time step by C u/|du/dt|, with u the internal energy per unit "
        "mass, so that the steps resolve fast changes of u",
        json_schema_extra=RECORDED,
    )
    max_energy_drift: float = Field(
        0.005,
        gt=0,
        description="largest relative error of total energy (energy drift); a run that exceeds it "
        "stops with an error",
        json_schema_extra=FREE,
    )

    @model_validator(mode="before")
    @classmethod
    def _gamma_gives_way(cls, data: Any) -> Any:
        if isinstance(data, dict) and (data.get("eos") or data.get("materials")):
            return {"gamma": None} | data
        return data

    def kernel_model(self):
        """Return the smoothing kernel, a NamedTuple of `sph.kernels`."""
        return registry.model("sph.kernels", self.kernel)

    def eos_model(self):
        """Return the equation of state, a NamedTuple of `sph.eos`; of several, the first."""
        if self.materials:
            return next(iter(self.materials_models().values()))[0]
        return registry.model("sph.eos", self.eos or {"name": "ideal_gas", "gamma": self.gamma})

    def strength_model(self):
        """Return the strength of a solid, a NamedTuple, or None; of several, the first."""
        return next(iter(self.materials_models().values()))[1]

    def materials_models(self) -> dict[str, tuple[Any, Any]]:
        """Return the equation of state and the strength (or None) of each material, by name."""
        if not self.materials:
            strength = getattr(self, "strength", None)  # a key of one formulation
            return {"": (self.eos_model(), registry.model(STRENGTHS, strength))}
        return {
            name: (registry.model("sph.eos", one.eos), registry.model(STRENGTHS, one.strength))
            for name, one in self.materials.items()
        }

    def given(self, **attributes: bool) -> list[str]:
        """Return the first key of each part that is given and has these class attributes."""
        return [
            kind.keys[0].name
            for kind in self.kinds[1:]
            if kind.keys
            and getattr(self, kind.keys[0].name) is not None
            and all(getattr(kind, name) == value for name, value in attributes.items())
        ]

    def shown(self, key: str) -> str:
        """Return the value of a key that is given as TOML."""
        value = getattr(self, key)
        if isinstance(value, LabelledTable):
            return value_text(value.choice())
        return value_text(self.model_dump(include={key}, exclude_none=True)[key])


@functools.cache
def table(formulation: str) -> type[Physics]:
    """Return the class of [physics] for that formulation: its keys and those of its parts."""
    kinds = (registry.part_class(FORMULATIONS, formulation), *parts.classes(formulation))
    declarations.check_keys(kinds, dir(Physics) + list(Physics.model_fields), CLASSES)
    fields = {key.name: _field(key) for kind in kinds for key in kind.keys}
    for name, default in kinds[0].defaults.items():
        shared = Physics.model_fields[name]
        own = FieldInfo.merge_field_infos(shared, default=default)
        fields[name] = (shared.rebuild_annotation(), own)
    found = create_model("Physics", __base__=Physics, __doc__=Physics.__doc__, **fields)
    found.kinds = kinds
    return found


def chosen(raw: dict[str, Any]) -> type[Physics]:
    """Return the class of [physics] for a raw table; an unknown formulation counts as default."""
    name = raw.get("formulation", DEFAULT)
    known = registry.names(FORMULATIONS, folders=True)
    return table(name if name in known else DEFAULT)


def keys_of_other_formulations(raw: dict[str, Any]) -> dict[str, str]:
    """Return which formulations have a key that the formulation of a raw table lacks, in words."""
    own, found = chosen(raw), {}
    for name in registry.names(FORMULATIONS, folders=True):
        for key in table(name).model_fields.keys() - own.model_fields.keys():
            of = f'to physics.formulation = "{name}"'
            found[key] = f"{found[key]} or {of}" if key in found else of
    return found


def every_key() -> set[str]:
    """Return the keys that [physics] has under any formulation."""
    known = registry.names(FORMULATIONS, folders=True)
    return {key for name in known for key in table(name).model_fields}


def model_folders() -> dict[str, str]:
    """Return the folder of models of each key, e.g. "sph.parts.heating", with its short name."""
    known = registry.names(FORMULATIONS, folders=True)
    keys = [key for name in known for kind in table(name).kinds for key in kind.keys]
    folders = [key.models for key in keys if key.models]
    return {one: re.sub(r"sph\.(parts|formulations\.\w+)\.", "", one) for one in folders}


def _field(key: Key) -> tuple[Any, Any]:
    """Return type and pydantic field of a part's key."""
    found = None
    if key.kind is not None:
        found = plain(key.kind, key.above, key.at_least, key.at_most)
    if key.models:
        known = registry.names(key.models)
        if not known or (key.default_model and key.default_model not in known):
            raise DeclarationError(
                f"key {key.name!r}: expected models, a folder with files, and default_model, one "
                f"of these; {key.models} has {', '.join(known) or 'none'}"
            )
        choice = (
            labelled_table(key.models, key.label, key.default_model, key.label_help)
            if key.default_model
            else Annotated[Any, ModelChoice(key.models)]
        )
        found = choice if found is None else found | choice
    if key.default is None:
        found = found | None
    return found, Field(
        key.default,
        description=key.help,
        examples=[key.example] if key.example is not None else None,
        json_schema_extra={"restart": key.restart},
    )
