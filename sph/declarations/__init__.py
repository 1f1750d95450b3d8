"""Checks of what parts and models declare: errors name the class and say what is expected.

A declaration is checked once: that of a class when its file is read, that of a part and the methods
of models when a scene is put together, and what methods of parts return at the start of a run or
restart.
"""

from sph.declarations.models import check_model, only_class
from sph.declarations.parts import (
    check_formulations,
    check_keys,
    check_part,
    check_part_class,
    check_together,
)
from sph.declarations.returned import check_arrays, check_issues, check_returned
from sph.declarations.trial import check_on_vectors

__all__ = [
    "check_arrays", "check_formulations", "check_issues",
    "check_keys", "check_model", "check_on_vectors", "check_part", "check_part_class",
    "check_returned", "check_together", "only_class",
]  # fmt: skip
