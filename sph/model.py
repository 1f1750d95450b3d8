"""Models: named tuples of parameters whose methods are formulas, such as kernels."""

from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints


class Parameter(NamedTuple):
    """Annotation of a model's parameter: its help text, bounds and a valid value. For example

    strength: Annotated[float, Parameter("1 is the value of the paper", at_least=0.0)] = 1.0
    """

    help: str
    above: float | None = None
    at_least: float | None = None
    example: Any = None  # shown to a user who gives a wrong value


class Model:
    """Base class of all models. Each package of models has a subclass with its own defaults.

    A NamedTuple cannot inherit from another class. The decorator `@model(Base)` therefore copies
    the attributes of `Base` that the NamedTuple does not define.
    """

    name = ""  # the name of the model's file, as in the configuration
    _is_model = True

    @classmethod
    def required(cls) -> tuple[str, ...]:
        """Return the names of methods and parameters that a model of this folder must have."""
        return ()

    def issues(self) -> list[tuple[str, str]]:
        """Return (parameter, message) for values that are valid by themselves but not together."""
        return []


def model(base: type):
    """Return a decorator that makes a NamedTuple a model, with defaults from `base`."""

    def finish(kind):
        for one in base.__mro__[:-1]:
            for key, value in vars(one).items():
                if not key.startswith("__") and not hasattr(kind, key):
                    setattr(kind, key, value)
        kind.name = kind.__module__.rsplit(".", 1)[-1]
        return kind

    return finish


def parameters(kind: Any) -> dict[str, tuple[Any, Parameter]]:
    """Return the type and the `Parameter` of each parameter of a model's class, by name."""
    hints = get_type_hints(kind, include_extras=True)
    return {key: _declared(key, hints[key]) for key in kind._fields}


def _declared(key: str, hint: Any) -> tuple[Any, Parameter]:
    if get_origin(hint) is Annotated:
        plain, *extras = get_args(hint)
        for extra in extras:
            if isinstance(extra, Parameter):
                return plain, extra
        return plain, Parameter(key)
    return hint, Parameter(key)
