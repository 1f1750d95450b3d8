"""Optional physics, one folder for each part (see `sph.part`).

The `__init__.py` of a folder defines one subclass of `Part`, whose keys appear in [physics].
"""

import functools

from sph import registry
from sph.part import Part


@functools.cache
def classes(formulation: str) -> tuple[type[Part], ...]:
    """Return the parts that can be used with a formulation, in order of their names."""
    found = (
        registry.part_class("sph.parts", name) for name in registry.names("sph.parts", folders=True)
    )
    return tuple(
        kind for kind in found if not kind.formulations or formulation in kind.formulations
    )
