"""The passes of a step of the continuum formulation."""

from sph.formulations.continuum.clamps import hold
from sph.formulations.continuum.gradients import gradients
from sph.formulations.continuum.material import stresses
from sph.formulations.continuum.rates import rates
from sph.formulations.continuum.support import supports
from sph.part import Pass

MATTER = ("mass", "predicted_density", "support")
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
            ("position", "velocity", *MATTER, "density"),
            (*there(*CORRECTION), *STRAIN, "density_rate"),
            takes_step=True,
        ),
        *[_law(one, there) for one in scheme.materials],
        Pass(
            "rates",
            "rates",
            rates,
            ("position", "predicted_velocity", *MATTER,
             *there("sound_speed", "balsara", "pressure", "stress", *CORRECTION, "tension",
                    "initial_support")),
            ("acceleration", "energy_rate", "signal_speed"),
        ),
        *[clamps] * scheme.is_clamped,
    )  # fmt: skip


def _law(material, there) -> Pass:
    """Return the pass of a material's laws."""
    found = there("pressure", "stress", "sound_speed", "balsara", "tension")
    evolved = there("deviatoric_stress", "plastic_strain")
    is_first = material.number == 0.0  # others complete its arrays
    return Pass(
        "gradients",
        "stress",
        stresses,
        ("density", "density_rate", "predicted_energy", "support", *STRAIN, *there("material")),
        found if is_first else (),
        evolved if is_first else (*evolved, *found),
        models=material,
        takes_step=True,
    )  # fmt: skip
