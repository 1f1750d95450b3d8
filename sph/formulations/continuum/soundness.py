"""Check of the state: a speed of sound and a finite stress of every particle."""

import numpy as np

from sph import faults

SMALLER_STEPS = "smaller steps (physics.C), more viscosity (physics.q_a, physics.q_b)"


def check(simulation, materials) -> None:
    """Raise NumericalError if the speed of sound or the stress of a particle is not a number.

    materials: those of the scene, in order.
    """
    p = simulation.particles
    if not np.isfinite(p.sound_speed).all():
        raise _without_sound(simulation, materials)
    deviator = p.get("deviatoric_stress")
    if deviator is not None and not np.isfinite(deviator).all():
        i = int(np.flatnonzero(~np.isfinite(deviator).all(axis=(0, 1)))[0])
        what = f"the stress of particle {p.id[i]} is not finite: {_state(p.density, p, i)}"
        raise faults.fault(simulation, what, SMALLER_STEPS, int(p.id[i]))


def _without_sound(simulation, materials):
    """Return the error for the particle where NaNs began, as far as this is known."""
    p = simulation.particles
    wrong = ~np.isfinite(p.sound_speed)
    # within a step NaNs spread to neighbours, but not to the predictions that they came from
    rho, u = p.predicted_density, p.predicted_energy
    first = wrong & np.isfinite(rho) & np.isfinite(u)
    i = int(np.flatnonzero(first if first.any() else wrong)[0])
    number = 0 if p.get("material") is None else int(p.material[i])
    eos = materials[number].eos
    what, remedy = "has no speed of sound", SMALLER_STEPS
    if first.any():
        pressure = float(eos.pressure(rho[i], u[i]))
        if np.isfinite(pressure):
            what = f"is under more tension than {eos.name} allows: pressure {pressure:.6g}"
            remedy = f"{SMALLER_STEPS}, or a weaker rarefaction"
        else:
            what = f"is compressed beyond the densest state of {eos.name}"
            remedy = f"{SMALLER_STEPS}, a weaker impact, or another equation of state"
    if not simulation.step:
        remedy = "an initial state with another density or internal energy of this particle"
    what = f"particle {p.id[i]} {what}; {_state(rho, p, i)}"
    return faults.fault(simulation, what, remedy, int(p.id[i]))


def _state(density, p, i: int) -> str:
    energy = p.predicted_energy if density is p.predicted_density else p.internal_energy
    return f"density {density[i]:.6g}, internal energy {energy[i]:.6g}"
