"""Models: named tuples of parameters whose methods are formulas, such as kernels."""

from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints


class Parameter(NamedTuple):
    """Annotation of a model's parameter: its help text and bounds.

    strength: Annotated[float, Parameter("1 is the value of the paper", at_least=0.0)] = 1.0
    """

    help: str
    above: float | None = None
    at_least: float | None = None


class Model:
    """Base of all models. Packages of models extend it with defaults for theirs.

    A NamedTuple cannot inherit, so `@model(Base)` copies what the class does not define.
    """

    name = ""  # of the file, as in the configuration

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
    """Return type and declaration of each parameter of a model's class."""
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
