"""Constitutive laws, once per particle: stress and sound speed from density and strain.

Each material of a scene has its own pass, which leaves the particles of other materials alone.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import overload

from sph.arrays import empty
from sph.compiled import COMPILED, INLINED
from sph.eos import pressure as pressure_of
from sph.eos import sound_speed as sound_speed_of
from sph.formulations.continuum.radial_return import equivalent_stress, returned
from sph.formulations.continuum.rotation import advance
from sph.formulations.continuum.tension import tensile
from sph.integrators.leapfrog import stepped_density
from sph.neighbours.order import BLOCK

# Softening of the viscosity's switch, in units of c/d (eq 410).
SOFTENING = 1e-4


class Material(NamedTuple):
    """A material: its number in the scene, its laws, and the tensile correction's epsilon."""

    number: float
    eos: Any
    strength: Any  # None for a fluid
    tensile_correction: float

    @property
    def yields(self) -> bool:
        return self.strength is not None and self.strength.yields


# Unsigned indices: Numba counts negative ones from the end of an array, so that with signed ones
# LLVM compares the end of each array with the beginnings of others. For arrays that lie close
# together in memory it then runs another version of the loop, which rounds differently.


@njit(**COMPILED)
def stresses(
    first, last, dim, models, neighbours, density, density_rate, energy, support, velocity_gradient,
    div_v, number, deviatoric_stress, plastic_strain, pressure, stress, sound_speed, balsara,
    tension, dt,
):  # fmt: skip
    """Pass over superblocks [first, last): eqs 410, 415, 430-435 and those of the material's laws.

    Reads the density (N,) at the start of the step and its rate in the middle, the predicted energy
    (N,), support (N,), velocity_gradient (D, D, N) and div_v (N,) in the middle, and number (N,) of
    each particle's material. Advances deviatoric_stress (D, D, N) and plastic_strain (N,) by the
    step dt. Writes pressure (N,) where the scene has no strength, otherwise stress (D, D, N);
    sound_speed, balsara (N,); tension (D, D, N). An array is None if the scene does not need it.
    """
    D, lists, eos, strength = len(dim), neighbours.lists, models.eos, models.strength
    i_end = min(lists.first[last] * BLOCK, density.size)
    axes = empty((2, 3, 3), np.float64)  # scratch
    for i in range(np.uint64(lists.first[first] * BLOCK), np.uint64(i_end)):
        if number is not None and number[i] != models.number:
            continue
        rho, u = stepped_density(density[i], density_rate[i] * dt), energy[i]
        P = pressure_of(eos, rho, u)
        c = sound_speed_of(eos, rho, P)
        G = shear_modulus(strength)
        if G > 0.0:
            c = np.sqrt(c * c + 4.0 / 3.0 * G / rho)  # eq 415
        sound_speed[i] = c
        if balsara is not None:
            size, curl = abs(div_v[i]), _curl(dim, velocity_gradient, i)
            # the support is 2 d; cold matter at rest has nothing to switch
            whole = size + curl + 2.0 * SOFTENING * c / support[i]
            balsara[i] = size / whole if whole != 0.0 else 0.0
        if pressure is not None:
            pressure[i] = P
        if stress is not None:
            if G > 0.0:
                advance(dim, deviatoric_stress, velocity_gradient, div_v, 2.0 * G, dt, i)
            _return(
                strength, dim, deviatoric_stress, velocity_gradient, div_v, plastic_strain, u, i
            )
            for a in range(D):
                for b in range(D):
                    stress[a, b, i] = deviatoric_stress[a, b, i] - (P if a == b else 0.0)
            if tension is not None:
                tensile(dim, models.tensile_correction, stress, i, axes, tension)


def shear_modulus(strength):
    """Return G, 0 for a fluid."""


@overload(shear_modulus, jit_options=INLINED)  # type: ignore[arg-type]
def _shear_modulus(strength):
    if _is_none(strength):
        return lambda strength: 0.0
    return lambda strength: strength.shear_modulus


def _return(strength, dim, S, velocity_gradient, div_v, plastic_strain, u, i):
    """Move S (D, D, N) of particle i to the yield surface (eqs 434-435); add its plastic strain."""


@overload(_return, jit_options=INLINED)  # type: ignore[arg-type]
def _radial_return(strength, dim, S, velocity_gradient, div_v, plastic_strain, u, i):
    def nothing(strength, dim, S, velocity_gradient, div_v, plastic_strain, u, i):
        return

    def by_radius(strength, dim, S, velocity_gradient, div_v, plastic_strain, u, i):
        rate = _strain_rate(dim, velocity_gradient, div_v[i], i)
        size = equivalent_stress(dim, S, i)
        factor, more = returned(strength, size, plastic_strain[i], rate, u)
        for a in range(len(dim)):
            for b in range(len(dim)):
                S[a, b, i] *= factor
        plastic_strain[i] += more

    return by_radius if not _is_none(strength) and strength.instance_class.yields else nothing


def _is_none(kind) -> bool:
    return isinstance(kind, types.NoneType | types.Omitted)


@njit(**INLINED)
def _strain_rate(dim, velocity_gradient, divergence, i):
    """Return the equivalent rate of strain (2/3 e : e)^1/2, e the deviator of the rate of strain.

    The directions that the scene lacks are not strained.
    """
    D = len(dim)
    squares = (3 - D) * (divergence / 3.0) ** 2
    for a in range(D):
        for b in range(D):
            rate = 0.5 * (velocity_gradient[a, b, i] + velocity_gradient[b, a, i])
            rate -= divergence / 3.0 if a == b else 0.0
            squares += rate * rate
    return np.sqrt(2.0 / 3.0 * squares)


@njit(**INLINED)
def _curl(dim, velocity_gradient, i):
    """Return the modulus of the curl of the velocity."""
    squares = 0.0
    for a in range(len(dim)):
        for b in range(a):
            squares += (velocity_gradient[a, b, i] - velocity_gradient[b, a, i]) ** 2
    return np.sqrt(squares)
