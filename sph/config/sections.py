"""The tables beside [problem]: every key once, with its type, bounds, default and help."""

import os
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, model_validator

from sph import registry
from sph.config.choices import Choice, Gamma, ModelChoice
from sph.config.errors import Issue, as_error
from sph.config.restarts import FREE, RECORDED, REFUSED, SAME_KIND
from sph.config.toml_text import value_text
from sph.problems.base import Section

AtLeastZero = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=1)]
# More passes than this converge no further, and a step would never end.
Passes = Annotated[int, Field(ge=1, le=100)]


class AlphaRange(Section):
    """A coefficient per particle that rises in compression and decays behind it."""

    min: AtLeastZero = Field(description="where it decays to")
    max: AtLeastZero = Field(description="where strong compression drives it")
    switch: Annotated[str, Choice("sph.viscosity.switches")] = Field(
        "morris_monaghan", description="what compression drives it by"
    )
    ell: float | None = Field(
        None, gt=0, description="speed of its decay by cullen_dehnen, there 0.05 if not given"
    )

    @model_validator(mode="before")
    @classmethod
    def _parameters_of_the_switch(cls, data: Any) -> Any:
        name = data.get("switch") if isinstance(data, dict) else None
        if name not in registry.names("sph.viscosity.switches"):
            return data
        return registry.model_class("sph.viscosity.switches", name)._field_defaults | data

    @model_validator(mode="after")
    def _in_order(self):
        if self.min > self.max:
            raise as_error([Issue(("min",), f"= {self.min}: expected at most max = {self.max}")])
        if foreign := self.model_fields_set - {"switch", *self._model()._fields}:
            issues = (Issue((key,), f'is no parameter of "{self.switch}"') for key in foreign)
            raise as_error(issues)
        return self

    def _model(self) -> type:
        return registry.model_class("sph.viscosity.switches", self.switch)

    def viscosity(self):
        """The switch with its parameters, a NamedTuple of `sph.viscosity.switches`."""
        model = self._model()
        return model(**{key: getattr(self, key) for key in model._fields})


class Physics(Section):
    """The equations that are solved, in code units."""

    scheme: Annotated[str, Choice("sph.schemes")] = Field(
        "grad_h",
        description="how density and rates are summed over neighbours",
        json_schema_extra=RECORDED,
    )
    kernel: Annotated[Any, ModelChoice("sph.kernels")] = Field(
        "wendland_c2",
        description="smoothing kernel",
        json_schema_extra=RECORDED,
    )
    density: Literal["mass", "number"] = Field(
        "mass",
        description='what a density sums: the "mass" of neighbours, or the "number" of them, which '
        "the particle's own mass then multiplies: for masses that jump, the same where they do not",
        json_schema_extra=RECORDED,
    )
    gamma: Gamma | None = Field(
        1.4,
        description="adiabatic index of an ideal gas, the ratio of specific heats",
        json_schema_extra=REFUSED,
    )
    eos: Annotated[Any, ModelChoice("sph.eos")] | None = Field(
        None,
        description="equation of state, in place of gamma",
        examples=[{"name": "ideal_gas", "gamma": 1.4}],
        json_schema_extra=REFUSED,
    )
    alpha: AtLeastZero | AlphaRange = Field(
        1.0,
        description="artificial viscosity: one coefficient for all, or a range to switch it",
        json_schema_extra=SAME_KIND,
    )
    conductivity: Annotated[Any, ModelChoice("sph.conductivity")] | None = Field(
        None,
        description="artificial conductivity, which smooths contacts, at these only if switched; "
        "none if not given",
        examples=[{"name": "pressure_jump", "strength": 1.0, "switched": True}],
        json_schema_extra=RECORDED,
    )
    external: Annotated[Any, ModelChoice("sph.external")] | None = Field(
        None,
        description="field that pulls the gas from outside, with G = 1; none if not given",
        examples=[{"name": "point_mass", "mass": 1.0}],
        json_schema_extra=REFUSED,
    )
    heating: Annotated[Any, ModelChoice("sph.heating")] | None = Field(
        None,
        description="source of internal energy other than the flow; none if not given",
        examples=[{"name": "relaxation", "energy": 1.0, "time": 0.1}],
        json_schema_extra=SAME_KIND,
    )
    eta: float = Field(
        1.6,
        gt=0,
        description="smoothing length in units of the local particle spacing",
        json_schema_extra=RECORDED,
    )
    allow_pairing: bool = Field(
        False,
        description="run a spline kernel also at an eta at which its particles pair",
        json_schema_extra=RECORDED,
    )
    max_support: float = Field(
        1.0,
        gt=0,
        description="where all axes are open, the widest a kernel may get where particles are too "
        "few to fill it, in units of the longest side of the domain",
        json_schema_extra=RECORDED,
    )
    C: float = Field(
        0.15,
        gt=0,
        description="Courant number: the time step in units of support over signal speed; held "
        "where the leapfrog is stable with physics.alpha and physics.conductivity",
        json_schema_extra=RECORDED,
    )
    balsara: bool = Field(
        True,
        description="less viscosity where the flow shears or rotates; in 1-D, where nothing "
        "rotates, only where |div v| is below 1e-4 c/H",
        json_schema_extra=RECORDED,
    )
    density_passes: Passes | Literal["converged"] = Field(
        2,
        description="passes of the density and smoothing length iteration in a step",
        json_schema_extra=RECORDED,
    )
    energy_limit: bool = Field(
        True,
        description="limit the time step by u / |du/dt| so that heating is resolved",
        json_schema_extra=RECORDED,
    )

    max_energy_drift: float = Field(
        0.005,
        gt=0,
        description="the run stops where total energy is off by more than this part",
        json_schema_extra=FREE,
    )

    @model_validator(mode="before")
    @classmethod
    def _gamma_gives_way(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("eos") is not None:
            return {"gamma": None} | data
        return data

    @model_validator(mode="after")
    def _scheme_takes_the_gas(self):
        from sph import eos, schemes

        scheme = registry.model_class("sph.schemes", self.scheme)
        if schemes.sums_pressure(scheme) and not eos.is_ideal(self.eos_model()):
            gas = value_text(self.eos)
            problem = f'= "{self.scheme}": expected an ideal gas, not {gas}'
            raise as_error([Issue(("scheme",), problem)])
        return self

    def kernel_model(self):
        """The smoothing kernel, a NamedTuple of `sph.kernels`."""
        from sph import kernels

        return kernels.make(**_named(self.kernel))

    def eos_model(self):
        """The equation of state, a NamedTuple of `sph.eos`."""
        from sph import eos

        return eos.make(**_named(self.eos or {"name": "ideal_gas", "gamma": self.gamma}))

    def conductivity_model(self):
        """The artificial conductivity, a NamedTuple of `sph.conductivity`, or None."""
        return _model("sph.conductivity", self.conductivity)

    def external_model(self):
        """The external field, a NamedTuple of `sph.external`, or None."""
        return _model("sph.external", self.external)

    def heating_model(self):
        """The source of internal energy, a NamedTuple of `sph.heating`, or None."""
        return _model("sph.heating", self.heating)

    def viscosity_model(self):
        """The artificial viscosity, a NamedTuple of `sph.viscosity`."""
        from sph.viscosity import constant

        if isinstance(self.alpha, AlphaRange):
            return self.alpha.viscosity()
        return constant.ConstantAlpha(self.alpha)


def _named(model: str | dict[str, Any]) -> dict[str, Any]:
    return {"name": model} if isinstance(model, str) else model


class Time(Section):
    """How long the run goes on, in code units."""

    restart: ClassVar[str | None] = "free"
    end: float = Field(gt=0, description="time at which the run ends; it starts at 0")


class Output(Section):
    """What a run leaves behind."""

    restart: ClassVar[str | None] = "free"
    interval: float = Field(gt=0, description="time between checkpoints, in code units")


def _absolute(path: str) -> str:
    found = path and os.path.abspath(path)
    try:
        found.encode()  # else a configuration, which is UTF-8, could not hold it
    except UnicodeEncodeError:
        raise ValueError(f"{found!a}: expected a path that is UTF-8 text") from None
    if "\0" in found:
        raise ValueError(f"{found!r}: expected a path, which holds no NUL")
    return found


class Report(Section):
    """What a run tells of itself when it has ended."""

    restart: ClassVar[str | None] = "free"
    reference: Annotated[str, AfterValidator(_absolute)] = Field(
        "",
        description="directory of a finer run of the same problem, against which errors are taken "
        "in place of an exact solution, none if empty; one that does not begin with / is looked "
        "for from the current directory at the time it is given",
    )


class Run(Section):
    """How the run is carried out; none of it changes a result."""

    restart: ClassVar[str | None] = "free"
    threads: Count | Literal["all"] = Field(
        "all", description='processor threads; "all" uses every one there is'
    )


def _model(package: str, choice: str | dict[str, Any] | None):
    if choice is None:
        return None
    named = _named(choice)
    model = registry.model_class(package, named["name"])
    return model(**{key: value for key, value in named.items() if key != "name"})


SECTIONS: dict[str, type[Section]] = {
    "physics": Physics,
    "time": Time,
    "output": Output,
    "report": Report,
    "run": Run,
}
