"""Impact of two elastic-plastic plates: an elastic precursor, and a slower plastic shock.

Material between the two fronts is at the Hugoniot elastic limit (eqs 442-444). The problem is that
of `flyer_plate` with strength and at lower speed.
"""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from sph.problems import base, flyer_plate
from sph.problems.support import uniaxial


class Problem(flyer_plate.Problem):
    """Two elastic-plastic steel plates that collide at 100 m/s each (SI units)."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.correction": 1,
        "physics.eos": uniaxial.STEEL,
        "physics.strength": {
            "name": "elastic_plastic",
            "shear_modulus": uniaxial.SHEAR_MODULUS,
            "yield_stress": uniaxial.YIELD_STRESS,
        },
        "time.end": 8e-6,
        "output.interval": 2e-6,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-4, "measured: 3.6e-5, in the first steps of the impact"),
        "elastic_limit_error": base.Limit(
            0.02, "measured: 0.0016; 0.019 with 300 particles, where the two fronts overlap"
        ),
        "precursor_speed_error": base.Limit(0.02, "measured: 3.2e-4 with 600 particles"),
        "shock_speed_error": base.Limit(0.02, "measured: 3.2e-4 with 600 particles"),
        "shock_stress_error": base.Limit(0.02, "measured: 3.1e-4 with 600 particles"),
    }
    title: ClassVar = "elastic-plastic shock"

    name: Literal["elastic_plastic_shock"] = "elastic_plastic_shock"  # type: ignore[assignment]
    n: Annotated[int, base.Problem.model_fields["n"]] = 600
    speed: float = Field(default=100.0, gt=0.0, description="speed of each plate")
