"""Types of keys whose value names a file in a package: a scheme, a kernel, an equation of state."""

from typing import Annotated, Any, get_type_hints

from pydantic import Field, ValidationError, create_model
from pydantic_core import core_schema

from sph import registry
from sph.config.errors import Issue, as_error, explain, wrong_value
from sph.problems.base import Section

Gamma = Annotated[float, Field(gt=1)]

# Bounds of the models' parameters: a NamedTuple declares type and default, but no bounds.
_PARAMETERS = {
    "gamma": Gamma,
    "p_inf": Annotated[float, Field(ge=0)],
    "strength": Annotated[float, Field(ge=0)],
    "mass": Annotated[float, Field(ge=0)],
    "softening": Annotated[float, Field(ge=0)],
    "energy": Annotated[float, Field(gt=0)],
    "time": Annotated[float, Field(gt=0)],
}


class Choice:
    """Annotates a key whose value is the name of a file in `package`, such as "sph.kernels"."""

    def __init__(self, package: str):
        self.package = package

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.check)

    def valid_names(self) -> list[str]:
        return registry.names(self.package)

    def describe(self) -> str:
        return "one of " + ", ".join(f'"{name}"' for name in self.valid_names())

    def check(self, value: Any) -> Any:
        """Return the resolved value. Raises a PydanticCustomError that holds the issues found."""
        if not isinstance(value, str) or value not in self.valid_names():
            raise as_error([wrong_value((), value, Annotated[Any, self])])
        return value


class ModelChoice(Choice):
    """Annotates a key whose value is a name, or a table { name, parameters of that model }.

    The resolved value is the name alone for a model without parameters, otherwise a table with the
    name and every parameter.
    """

    def describe(self) -> str:
        return super().describe() + ", or a table { name, parameters }"

    def parameters(self, name: str) -> type[Section]:
        """Return a Section class with one key for each parameter of the model `name`."""
        model = registry.model_class(self.package, name)
        fields = {
            key: (_PARAMETERS.get(key, kind), model._field_defaults.get(key, ...))
            for key, kind in get_type_hints(model).items()
            if key in model._fields
        }
        return create_model(name, __base__=Section, **fields)

    def check(self, value: Any) -> Any:
        if not isinstance(value, dict):
            value = {"name": super().check(value)}
        if "name" not in value:
            raise as_error([Issue(("name",), f"is missing: expected {super().describe()}")])
        name = value["name"]
        if not isinstance(name, str) or name not in self.valid_names():
            raise as_error([wrong_value(("name",), name, Annotated[Any, Choice(self.package)])])
        given = {key: entry for key, entry in value.items() if key != "name"}
        found = self._validated(self.parameters(name), given).model_dump()
        return {"name": name, **found} if found else name

    def _validated(self, table: type[Section], given: dict[str, Any]) -> Section:
        try:
            return table.model_validate(given)
        except ValidationError as error:
            issues = explain(table, given, error.errors(include_url=False), table.__name__, {})
            raise as_error([one._replace(path=one.path[1:]) for one in issues]) from None
