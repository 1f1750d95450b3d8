"""The passes of a step of the continuum formulation."""

from sph.formulations.continuum.clamps import hold
from sph.formulations.continuum.gradients import gradients
from sph.formulations.continuum.material import stresses, yielded
from sph.formulations.continuum.rates import rates
from sph.formulations.continuum.support import supports
from sph.part import Pass

MATTER = ("position", "predicted_velocity", "mass", "predicted_density", "support")
CORRECTION = ("kernel_factor", "kernel_gradient", "kernel_matrix")
STRAIN = ("velocity_gradient", "div_v")


def of(scheme) -> tuple[Pass, ...]:
    """Return the passes, with the fields that a scene has. scheme: its `Continuum`."""
    declared = {field.name for field in scheme.fields}

    def there(*names):
        return tuple(name if name in declared else None for name in names)

    clamps = Pass("constraints", "rates", hold, ("clamped",), updates=("acceleration",))
    return (
        Pass(
            "density",
            "density",
            supports,
            ("support", "mass", "predicted_density"),
            ("support_before",),
            swaps=("support", "support_before"),
            widens=True,
        ),
        Pass(
            "density",
            "density",
            gradients,
            MATTER,
            (*there(*CORRECTION), *STRAIN, "density_rate"),
        ),
        *[_law(one, there) for one in scheme.materials],
        Pass(
            "rates",
            "rates",
            rates,
            (*MATTER, *there("sound_speed", "balsara", "pressure", "stress", *CORRECTION,
                             "tension", "initial_support"), "velocity_gradient"),
            ("acceleration", "energy_rate", "signal_speed"),
        ),
        *[clamps] * scheme.is_clamped,
        *[_plastic_flow(one, there) for one in scheme.materials if one.yields],
    )  # fmt: skip


def _law(material, there) -> Pass:
    """Return the pass of a material's laws."""
    found = there("pressure", "stress", "sound_speed", "balsara", "stress_rate", "tension")
    is_first = material.number == 0.0  # others complete its arrays
    return Pass(
        "gradients",
        "stress",
        stresses,
        ("predicted_density", "predicted_energy", "support", *STRAIN,
         *there("material", "plastic_strain")),
        found if is_first else (),
        there("predicted_stress") if is_first else (*there("predicted_stress"), *found),
        models=material,
    )  # fmt: skip


def _plastic_flow(material, there) -> Pass:
    """Return the pass after the correction of a material that yields."""
    return Pass(
        "correction",
        "stress",
        yielded,
        ("internal_energy", *STRAIN, *there("material")),
        updates=("deviatoric_stress", "plastic_strain"),
        models=material,
        at_start=False,
    )
