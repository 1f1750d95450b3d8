"""Types of keys whose value names a file in a package, such as a scheme or a kernel."""

import functools
import types
import typing
from typing import Annotated, Any, ClassVar

from pydantic import Field, ValidationError, create_model, model_validator
from pydantic_core import core_schema

from sph import registry
from sph.config.errors import Issue, as_error, explain, wrong_value
from sph.model import parameters
from sph.problems.base import Section


class Choice:
    """Annotates a key whose value is the name of a file in `package`, such as "sph.kernels"."""

    def __init__(self, package: str, folders: bool = False):
        self.package, self.folders = package, folders

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.check)

    def valid_names(self) -> list[str]:
        return registry.names(self.package, self.folders)

    def describe(self) -> str:
        return "one of " + ", ".join(f'"{name}"' for name in self.valid_names())

    def check(self, value: Any) -> Any:
        """Return the resolved value. Raises a PydanticCustomError that holds the issues found."""
        if not isinstance(value, str) or value not in self.valid_names():
            raise as_error([wrong_value((), value, Annotated[Any, self])])
        return value


class ModelChoice(Choice):
    """Annotates a key whose value is a name, or a table { name, parameters of that model }.

    The resolved value is the name alone if the model has no parameters, otherwise a table with the
    name and every parameter.
    """

    def describe(self) -> str:
        classes = (registry.model_class(self.package, name) for name in self.valid_names())
        table = ", or a table { name, parameters }" if any(one._fields for one in classes) else ""
        return super().describe() + table

    def parameters(self, name: str) -> type[Section]:
        """Return a Section class with one key for each parameter of the model `name`."""
        return create_model(name, __base__=Section, **_fields(self.package, name))

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
        _check_together(registry.model_class(self.package, name)(**found))
        return {"name": name, **found} if found else name

    def _validated(self, table: type[Section], given: dict[str, Any]) -> Section:
        try:
            return table.model_validate(given)
        except ValidationError as error:
            issues = explain(table, given, error.errors(include_url=False), table.__name__, {})
            raise as_error([one._replace(path=one.path[1:]) for one in issues]) from None


class LabelledTable(Section):
    """A table of a model's parameters that also names the model, under the key `label`.

    Its keys are those of every model in the package, see `labelled_table`.
    """

    package: ClassVar[str]
    label: ClassVar[str]

    def choice(self) -> dict[str, Any]:
        """Return the name and the parameters of the model, as `sph.registry.model` takes them."""
        keys = (self.label, *self._model()._fields)
        return {key: getattr(self, key) for key in keys}

    def _model(self) -> type:
        return registry.model_class(self.package, getattr(self, self.label))

    @model_validator(mode="before")
    @classmethod
    def _defaults_of_the_model(cls, data: Any) -> Any:
        name = data.get(cls.label) if isinstance(data, dict) else None
        if name not in registry.names(cls.package):
            return data
        return registry.model_class(cls.package, name)._field_defaults | data

    @model_validator(mode="after")
    def _parameters_of_the_model(self):
        known = {self.label, *self._model()._fields}
        if missing := [key for key in self._model()._fields if getattr(self, key) is None]:
            raise as_error(Issue((key,), "is missing: expected a number") for key in missing)
        _check_together(registry.model(self.package, self.choice(), self.label))
        if foreign := self.model_fields_set - known:
            name = getattr(self, self.label)
            raise as_error(
                Issue((key,), f'is not a parameter of the {self.label} "{name}"') for key in foreign
            )
        return self


@functools.cache
def labelled_table(package: str, label: str, default: str, help_of_label: str) -> type[Section]:
    """Return the table class for the models in `package`, `default` if the table names none."""
    every = {name: _fields(package, name) for name in registry.names(package)}
    shared = set.intersection(*(set(fields) for fields in every.values()))
    fields = {key: one for key, one in every[default].items() if key in shared}
    fields[label] = (Annotated[str, Choice(package)], Field(default, description=help_of_label))
    for name, own in every.items():
        for key, (kind, field) in own.items():
            if key not in fields:
                given = "" if field.is_required() else f"; {field.default} if not given"
                described = Field(None, description=f"{name} only: {field.description}{given}")
                fields[key] = (kind | None, described)
    table = create_model("Table", __base__=LabelledTable, **fields)
    table.package, table.label = package, label
    return table


def plain(kind: Any, above: float | None, at_least: float | None, at_most: float | None) -> Any:
    """Return the type with these bounds on its numbers; a union is bounded in its numbers."""
    bounds = {"gt": above, "ge": at_least, "le": at_most}
    bounds = {name: bound for name, bound in bounds.items() if bound is not None}
    if not bounds:
        return kind
    is_union = typing.get_origin(kind) in (types.UnionType, typing.Union)
    branches = typing.get_args(kind) if is_union else (kind,)
    bounded = (Annotated[one, Field(**bounds)] if one in (int, float) else one for one in branches)
    return typing.Union[tuple(bounded)]  # noqa: UP007 (a tuple of types)


def _fields(package: str, name: str) -> dict[str, tuple[Any, Any]]:
    """Return type and pydantic field of each parameter of a model."""
    model = registry.model_class(package, name)
    return {
        key: (
            plain(kind, said.above, said.at_least, None),
            Field(
                model._field_defaults.get(key, ...),
                description=said.help,
                examples=None if said.example is None else [said.example],
            ),
        )
        for key, (kind, said) in parameters(model).items()
    }


def _check_together(model: Any) -> None:
    """Raise the issues that the model has with its parameters together."""
    if found := model.issues():
        raise as_error(Issue((key,), text) for key, text in found)
