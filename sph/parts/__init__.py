"""Optional physics: one folder a part, which a scene has or leaves out (`sph.part`).

The folder's `__init__.py` defines one subclass of `Part`. Its keys appear in [physics].
"""

import functools

from sph import registry
from sph.part import Part


@functools.cache
def classes(formulation: str) -> tuple[type[Part], ...]:
    """The parts that can join that formulation, in the order of their names."""
    found = (
        registry.part_class("sph.parts", name) for name in registry.names("sph.parts", folders=True)
    )
    return tuple(
        kind for kind in found if not kind.formulations or formulation in kind.formulations
    )
