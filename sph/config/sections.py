"""The tables other than [problem]: type, bounds, default, help and restart class of each key."""

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
# The iteration converges in far fewer passes; without a bound a typing error could cost hours.
Passes = Annotated[int, Field(ge=1, le=100)]


class AlphaRange(Section):
    """One viscosity coefficient alpha per particle, which rises in compression and then decays."""

    min: AtLeastZero = Field(description="smallest alpha: each alpha decays to this value")
    max: AtLeastZero = Field(description="largest alpha, approached in strong compression")
    switch: Annotated[str, Choice("sph.viscosity.switches")] = Field(
        "morris_monaghan", description="method that sets alpha from the compression of the gas"
    )
    ell: float | None = Field(
        None,
        gt=0,
        description="cullen_dehnen only: alpha decays in the time H/(2 ell v_sig), with H the "
        "support radius and v_sig the signal speed; 0.05 if not given",
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
            issues = (
                Issue((key,), f'is not a parameter of the switch "{self.switch}"')
                for key in foreign
            )
            raise as_error(issues)
        return self

    def _model(self) -> type:
        return registry.model_class("sph.viscosity.switches", self.switch)

    def viscosity(self):
        """Return the switch with its parameters, a NamedTuple of `sph.viscosity.switches`."""
        model = self._model()
        return model(**{key: getattr(self, key) for key in model._fields})


class Physics(Section):
    """Equations and numerical method. All values are in code units."""

    scheme: Annotated[str, Choice("sph.schemes")] = Field(
        "grad_h",
        description="formulation of SPH: the sums over neighbours for density, force and heating; "
        "`sph list` describes each",
        json_schema_extra=RECORDED,
    )
    kernel: Annotated[Any, ModelChoice("sph.kernels")] = Field(
        "wendland_c2",
        description="smoothing kernel W, zero beyond the support radius H",
        json_schema_extra=RECORDED,
    )
    density: Literal["mass", "number"] = Field(
        "mass",
        description='density estimate of a particle: "mass" sums m_j W over its neighbours; '
        '"number" sums W and multiplies by its own mass, which is better for unequal masses and '
        "identical for equal ones",
        json_schema_extra=RECORDED,
    )
    gamma: Gamma | None = Field(
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
    alpha: AtLeastZero | AlphaRange = Field(
        1.0,
        description="artificial viscosity: one coefficient alpha for all particles, or a table "
        "{ min, max } in which a switch sets alpha for each particle",
        json_schema_extra=SAME_KIND,
    )
    conductivity: Annotated[Any, ModelChoice("sph.conductivity")] | None = Field(
        None,
        description="artificial conductivity: smooths contacts by exchanging internal energy "
        "between neighbours; `switched` limits it to contacts; none if not given",
        examples=[{"name": "pressure_jump", "strength": 1.0, "switched": True}],
        json_schema_extra=RECORDED,
    )
    external: Annotated[Any, ModelChoice("sph.external")] | None = Field(
        None,
        description="external gravitational field, with G = 1; none if not given",
        examples=[{"name": "point_mass", "mass": 1.0}],
        json_schema_extra=REFUSED,
    )
    heating: Annotated[Any, ModelChoice("sph.heating")] | None = Field(
        None,
        description="heating or cooling that is not caused by the flow; none if not given",
        examples=[{"name": "relaxation", "energy": 1.0, "time": 0.1}],
        json_schema_extra=SAME_KIND,
    )
    eta: float = Field(
        1.6,
        gt=0,
        description="smoothing length h divided by the local particle spacing (m/rho)^(1/D), in D "
        "dimensions; larger values give more neighbours",
        json_schema_extra=RECORDED,
    )
    allow_pairing: bool = Field(
        False,
        description="allow a spline kernel at values of eta for which its particles form close "
        "pairs (the pairing instability)",
        json_schema_extra=RECORDED,
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
        "unstable with physics.alpha or physics.conductivity",
        json_schema_extra=RECORDED,
    )
    balsara: bool = Field(
        True,
        description="Balsara factor: reduces artificial viscosity where the flow shears or "
        "rotates; in 1-D, only where |div v| is below about 1e-4 c/H, with c the speed of sound",
        json_schema_extra=RECORDED,
    )
    density_passes: Passes | Literal["converged"] = Field(
        2,
        description="iterations of density and smoothing length in each step, which depend on "
        'each other: a number, or "converged" to iterate until they no longer change',
        json_schema_extra=RECORDED,
    )
    energy_limit: bool = Field(
        True,
        description="limit the time step by C u/|du/dt|, with u the internal energy per unit "
        "mass, so that heating and cooling are resolved",
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
        """Return the smoothing kernel, a NamedTuple of `sph.kernels`."""
        from sph import kernels

        return kernels.make(**_named(self.kernel))

    def eos_model(self):
        """Return the equation of state, a NamedTuple of `sph.eos`."""
        from sph import eos

        return eos.make(**_named(self.eos or {"name": "ideal_gas", "gamma": self.gamma}))

    def conductivity_model(self):
        """Return the artificial conductivity, a NamedTuple of `sph.conductivity`, or None."""
        return _model("sph.conductivity", self.conductivity)

    def external_model(self):
        """Return the external field, a NamedTuple of `sph.external`, or None."""
        return _model("sph.external", self.external)

    def heating_model(self):
        """Return the heating model, a NamedTuple of `sph.heating`, or None."""
        return _model("sph.heating", self.heating)

    def viscosity_model(self):
        """Return the artificial viscosity, a NamedTuple of `sph.viscosity`."""
        from sph.viscosity import constant

        if isinstance(self.alpha, AlphaRange):
            return self.alpha.viscosity()
        return constant.ConstantAlpha(self.alpha)


def _named(model: str | dict[str, Any]) -> dict[str, Any]:
    return {"name": model} if isinstance(model, str) else model


class Time(Section):
    """Length of the run, in code units."""

    restart: ClassVar[str | None] = "free"
    end: float = Field(gt=0, description="time at which the run ends; every run starts at t = 0")


class Output(Section):
    """What the run writes."""

    restart: ClassVar[str | None] = "free"
    interval: float = Field(gt=0, description="time between checkpoints, in code units")


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
    """Resources of the run. No key of this table changes a result."""

    restart: ClassVar[str | None] = "free"
    threads: Count | Literal["all"] = Field(
        "all", description='number of threads; "all" uses every processor that the process may use'
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
