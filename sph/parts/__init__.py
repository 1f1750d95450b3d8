"""Optional physics, one folder for each part (see `sph.part`).

The `__init__.py` of a folder defines one subclass of `Part`. The keys that the subclass declares
become keys of [physics].
"""

import functools

from sph import declarations, registry
from sph.part import Part

BASE = Part


@functools.cache
def classes(formulation: str) -> tuple[type[Part], ...]:
    """Return the parts that can be used with a formulation, in order of their names.

    Raises DeclarationError.
    """
    found = [
        registry.part_class("sph.parts", name) for name in registry.names("sph.parts", folders=True)
    ]
    known = registry.names("sph.formulations", folders=True)
    for kind in found:
        declarations.check_formulations(kind, known)
    return tuple(
        kind for kind in found if not kind.formulations or formulation in kind.formulations
    )
