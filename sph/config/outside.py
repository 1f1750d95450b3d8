"""Problems from outside the package: in a Python file, or in an installed distribution.

The class found is extended by the keys that record where it came from. Exceptions in its methods
become errors that name file and line (`sph.config.reporting`).
"""

import difflib
import functools
import hashlib
import importlib.metadata
import os
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from inspect import getattr_static
from types import FunctionType, ModuleType
from typing import Any, ClassVar, Literal, TypeGuard

from pydantic import Field, create_model

from sph import registry
from sph.config.reporting import check_signature, definition, reported, reporting
from sph.config.restarts import RECORDED
from sph.config.sections import SECTIONS
from sph.errors import DeclarationError
from sph.problems import base
from sph.quantity import FIELDS, Quantity

PACKAGE = "sph.problems"
GROUP = "sph.problems"  # of entry points: NAME = "module" or "module:Class"

# Keys that record the sources of a problem. A restart finds them anew and says what has changed.
SOURCES = ("file_sha256", "package")

# Likeness of names from which one is the other, misspelt: `exakt` of `exact` has 0.8. Helpers of
# the problems of sph have at most 0.77, `units` of `in_units`.
SIMILAR = 0.8


class Outside(base.Problem):
    """Base of the classes that `of_file` and `of_package` return.

    origin: path of the source file; source: its content, of a file; package: name and version of
    the distribution, of a package.
    """

    origin: ClassVar[str]
    source: ClassVar[bytes] = b""
    filled_in: ClassVar[tuple[str, ...]] = SOURCES


def names() -> list[str]:
    """Return the names of all problems, those of sph first. Raises DeclarationError."""
    return [*registry.names(PACKAGE), *_entries()]


def problem_class(name: str) -> type[base.Problem] | None:
    """Return the class of a problem of sph or of a package, None if there is none of that name.

    Raises DeclarationError for a class that cannot be used.
    """
    if name in registry.names(PACKAGE):
        module = registry.load(PACKAGE, name)
        return _class_in(module, module.__file__ or name)
    return of_package(name) if name in _entries() else None


def of_packages() -> dict[str, type[Outside]]:
    """Return the class of each problem of other packages, by name. Raises DeclarationError."""
    return {name: of_package(name) for name in sorted(_entries())}


@functools.cache
def of_package(name: str) -> type[Outside]:
    """Return the class of the entry point `name`, with the key `package`. Raises DeclarationError.

    The key holds name and version of the distribution.
    """
    entry = _entries()[name]
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.module
    where = f"the entry point {name} of {package}"
    with reported(where):
        found = entry.load()
    origin = getattr(sys.modules.get(entry.module), "__file__", None) or where
    found = _class_in(found, origin) if isinstance(found, ModuleType) else _checked(found, where)
    key = Field(
        default=package,
        description="distribution that brings the problem, and its version; filled in",
        json_schema_extra=RECORDED,  # type: ignore[arg-type]
    )
    return _extended(found, origin, name=_fixed(name), package=(str, key))


def of_file(path: str) -> tuple[type[Outside], str]:
    """Return the class `Problem` in a Python file, with its keys, and the SHA-256 of the file.

    path: absolute. Equal contents give the same class. Raises DeclarationError, which names the
    line, if the file cannot be read or executed, or has no such class.
    """
    if not os.path.exists(path):
        raise DeclarationError(f"{path}: file not found")
    if not os.path.isfile(path) or not path.endswith(".py"):
        raise DeclarationError(f"{path}: expected a Python file, NAME.py")
    try:
        with open(path, "rb") as file:
            source = file.read()
    except OSError as error:
        raise DeclarationError(f"{path}: cannot be read ({error.strerror})") from None
    return _of_source(path, source), hashlib.sha256(source).hexdigest()


def has_changed(problem: base.Problem) -> TypeGuard[Outside]:
    """Return whether a problem was read from another file than the one whose SHA-256 it records."""
    if not isinstance(problem, Outside) or not problem.source:
        return False
    return hashlib.sha256(problem.source).hexdigest() != problem.model_dump()["file_sha256"]


@functools.cache
def _of_source(path: str, source: bytes) -> type[Outside]:
    stem = os.path.splitext(os.path.basename(path))[0]
    # not a name that another module has: pydantic resolves annotations in sys.modules
    module = ModuleType(f"{stem}_{hashlib.sha256(path.encode() + source).hexdigest()[:16]}")
    module.__file__ = path
    sys.modules[module.__name__] = module
    try:
        with reported(path):
            exec(compile(source, path, "exec", dont_inherit=True), vars(module))
        found = _class_in(module, path)
    except DeclarationError:
        del sys.modules[module.__name__]
        raise
    file = Field(
        default=path,
        description="Python file with the class of the problem, in place of name; a relative path "
        "begins at the directory of the configuration file, one of --set at the current directory",
    )
    digest = Field(
        default="",
        pattern="^([0-9a-f]{64})?$",
        description="SHA-256 of the file; checked if given, otherwise filled in, so that a run "
        "and its checkpoints tell which file computed them",
        json_schema_extra=RECORDED,  # type: ignore[arg-type]
    )
    name = {"name": _fixed(stem)} if found.model_fields["name"].is_required() else {}
    made = _extended(found, path, **name, file=(str, file), file_sha256=(str, digest))
    made.source, made.paths = source, ("file", *found.paths)
    return made


def _fixed(name: str) -> tuple[Any, str]:
    """Return type and default of a key `name` that has one value."""
    literal: Any = Literal
    return literal[name], name


def _extended(found: type[base.Problem], origin: str, **keys: Any) -> type[Outside]:
    """Return a subclass with more keys, whose methods report errors (`reported`)."""
    _check_defaults(found, origin)
    _check_attributes(found, origin)
    _check_methods(found, origin)
    made: Any = create_model("Problem", __base__=(found, Outside), __doc__=found.__doc__, **keys)
    made.origin, made.filled_in = origin, (*found.filled_in, *SOURCES)
    for name, ours in vars(base.Problem).items():
        own = getattr_static(found, name)
        if name.startswith("_") or own is ours:
            continue
        if isinstance(own, FunctionType):
            check_signature(own, ours, origin)
            setattr(made, name, reporting(own, origin))
        elif isinstance(own, classmethod):
            setattr(made, name, classmethod(reporting(own.__func__, origin)))
        elif isinstance(own, property) and own.fget:
            setattr(made, name, property(reporting(own.fget, origin)))
    return made


def _check_attributes(found: type[base.Problem], origin: str) -> None:
    """Raise DeclarationError for class attributes that only figures and the summary read."""
    known = FIELDS.keys() - {"x", "r", "velocity_phi", "column_density"}
    unknown = [name for name in found.profiles if name not in known]
    if unknown or len(found.profiles) != 4:
        raise DeclarationError(
            f"{origin}: profiles = {found.profiles!r}; expected four of {', '.join(sorted(known))}"
        )
    for attribute, kind in (
        ("limits", base.Limit), ("swamped", base.Limit), ("quantities", Quantity)
    ):  # fmt: skip
        given = getattr(found, attribute)
        for name, value in given.items() if isinstance(given, Mapping) else [("", given)]:
            if not isinstance(value, kind):
                raise DeclarationError(
                    f"{origin}: {attribute} has {name!r}: {value!r}; expected a dictionary of "
                    f"{kind.__module__}.{kind.__name__} by name"
                )


def _check_methods(found: type[base.Problem], origin: str) -> None:
    """Raise DeclarationError for a method whose name is a misspelt one of `base.Problem`.

    Nothing would call it. Other methods are helpers.
    """
    kinds = (FunctionType, classmethod, staticmethod, property)
    known = [name for name, one in vars(base.Problem).items() if isinstance(one, kinds)]
    known = [name for name in known if not name.startswith("_")]
    parent = next(one for one in found.__mro__ if one.__module__.startswith(f"{PACKAGE}."))
    for name in sorted(set(dir(found)) - set(dir(parent))):
        own = getattr_static(found, name)
        if name.startswith("_") or not isinstance(own, kinds):
            continue
        if close := difflib.get_close_matches(name.lower(), known, n=1, cutoff=SIMILAR):
            raise DeclarationError(
                f"{definition(own, origin)}: Problem has a method `{name}`, which no problem "
                f"has: did you mean {close[0]}?\n"
                f"Try: {close[0]}, or _{name} for a function of your own."
            )


def validating(model: type) -> AbstractContextManager:
    """Return the context in which keys of that class are validated: validators may be a user's."""
    return reported(model.origin) if issubclass(model, Outside) else nullcontext()


def _check_defaults(found: type[base.Problem], origin: str) -> None:
    """Raise DeclarationError for a default of another table than those of the configuration."""
    tables = ("physics", *SECTIONS)
    for key in found.defaults:
        table, _, name = key.partition(".")
        known = SECTIONS[table].model_fields if table in SECTIONS else ()
        if table not in tables or not name or (known and name not in known):
            raise DeclarationError(
                f"{origin}: defaults has {key!r}, which is not a key; expected TABLE.KEY of "
                f"[{'], ['.join(tables)}]"
            )


def _class_in(module: ModuleType, where: str) -> type[base.Problem]:
    if not hasattr(module, "Problem"):
        others = [name for name, one in vars(module).items() if _is_problem(one)]
        instead = f", but it has {', '.join(others)}" if others else ""
        raise DeclarationError(f"{where}: expected a class Problem{instead}")
    return _checked(module.Problem, where)


def _is_problem(found: Any) -> bool:
    return isinstance(found, type) and issubclass(found, base.Problem)


def _checked(found: Any, where: str) -> type[base.Problem]:
    if not _is_problem(found):
        raise DeclarationError(
            f"{where}: Problem is not a subclass of sph.problems.base.Problem, as it must be.\n"
            "Try: `from sph.problems import base`, and class Problem(base.Problem)."
        )
    if found is base.Problem or found.initial is base.Problem.initial:
        raise DeclarationError(f"{where}: expected a class Problem with a method initial")
    return found


@functools.cache
def _entries() -> dict[str, importlib.metadata.EntryPoint]:
    """Return the entry points of other packages by name. Raises DeclarationError for equal names.

    Reading the metadata of all distributions takes time, so only names that sph does not have
    cause it.
    """
    found: dict[str, importlib.metadata.EntryPoint] = {}
    for one in importlib.metadata.entry_points(group=GROUP):
        other = found.setdefault(one.name, one)
        if other.value != one.value or one.name in registry.names(PACKAGE):
            raise DeclarationError(
                f"the entry point {one.name} = {one.value} of the group {GROUP}: there is another "
                "problem of this name; expected another name"
            )
    return found
