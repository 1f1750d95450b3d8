"""Fields of the continuum formulation, and their integration in time."""

from sph.formulations.continuum import pieces
from sph.integrators.leapfrog import DENSITY, STRAIGHT
from sph.part import Evolved
from sph.state import COMMON, Field, Public

STRESS = Public(
    "StressTensors", -1, 1, -2, -5,
    "Stress tensor, positive in tension: columns xx, yy, zz, xy, xz, yz",
)  # fmt: skip
PLASTIC_STRAIN = Field(
    "plastic_strain",
    at_least=0.0,
    public=Public("PlasticStrains", 0, 0, 0, 0, "Equivalent plastic strain"),
)
MATERIAL = Field(
    "material",
    at_least=0.0,
    public=Public("Materials", 0, 0, 0, 0, "Number of the material in the configuration, from 0"),
)
CLAMPED = Field(
    "clamped",
    at_least=0.0,
    public=Public("Clamped", 0, 0, 0, 0, "1 for particles that no force moves, otherwise 0"),
)


def of(scheme) -> tuple[Field, ...]:
    """Return the fields of a scene. scheme: the `Continuum` of the scene, without fields."""
    # elastic energy released in tension may exceed the heat
    found = [
        field._replace(at_least=None) if field.name == "internal_energy" else field
        for field in COMMON
    ]
    found += [Field("density_rate"), Field("predicted_density", stored=False)]
    found += [Field("div_v", stored=False), Field("velocity_gradient", rank=2, stored=False)]
    found += [Field("kernel_factor", stored=False)] * (scheme.order == 0)
    found += [Field("kernel_gradient", rank=1, stored=False)] * (scheme.order >= 0)
    found += [Field("kernel_matrix", rank=2, stored=False)] * (scheme.order == 1)
    found += [Field("balsara", stored=False)] * scheme.has_balsara
    found += [MATERIAL] * (len(scheme.materials) > 1)
    found += [CLAMPED] * scheme.is_clamped
    if not scheme.is_solid:
        return (*found, Field("pressure", stored=False))
    # no public name: the stress tensor and the pressure tell it, in all three directions
    found += [Field("deviatoric_stress", rank=2), pieces.BODY]
    found += [Field("stress", rank=2, stored=False)]
    found += [PLASTIC_STRAIN] * scheme.yields
    if scheme.corrects_tension:
        found += [Field("initial_support", remade=True, above=0.0)]
        found += [Field("tension", rank=2, stored=False)]
    return tuple(found)


def evolved(scheme) -> tuple[Evolved, ...]:
    """Return the quantities that are integrated in time."""
    return (
        Evolved("internal_energy", "energy_rate", "predicted_energy", STRAIGHT),
        Evolved("density", "density_rate", "predicted_density", DENSITY),
    )
