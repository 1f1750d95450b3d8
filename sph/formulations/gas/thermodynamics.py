"""Quantities of a block from density and energy: EOS, Balsara factor, rate of alpha.

The density pass calls these functions after its sums; the pair loops of the rate pass use only
their results. Arrays are (N,).
"""

from numba import njit

from sph.compiled import COMPILED, INLINED
from sph.eos import pressure as pressure_of
from sph.eos import sound_speed as sound_speed_of
from sph.formulations.gas.schemes import summed_terms
from sph.formulations.gas.terms import alpha_rate as alpha_rate_of
from sph.formulations.gas.terms import balsara_factor
from sph.neighbours.order import BLOCK
from sph.passes.active import where_active
from sph.passes.gather import read, write
from sph.simd import block_width


@njit(**COMPILED)
def predict(
    first, last, dim, models, neighbours, energy, support, rho, Omega, div_v, curl_v, pressure,
    pressure_term, sound_speed, balsara,
):  # fmt: skip
    """With individual steps, do so for superblocks [first, last) from predicted values.

    Active particles receive final values in the density pass.
    """
    lists = neighbours.lists
    for block in range(lists.first[first], lists.first[last]):
        thermodynamics(
            neighbours.lanes, models, block, energy, support, rho, Omega, div_v, curl_v, None,
            None, pressure, pressure_term, sound_speed, balsara, None, None,
        )  # fmt: skip


@njit(**INLINED)
def thermodynamics(
    lanes, models, block, energy, support, rho, Omega, div_v, curl_v, alpha, energy_shift, pressure,
    pressure_term, sound_speed, balsara, alpha_rate, active,
):  # fmt: skip
    """Set sound speed, pressure, P/(Omega rho^2), Balsara factor and rate of alpha of a block.

    That is, those of them that the scene has: an array may be None. A scheme that sums its pressure
    (energy_shift is not None) sets pressure and P/(Omega rho^2) itself, by `summed`. The rate of
    alpha is that of active particles only.
    """
    for lane in range(0, BLOCK, block_width(lanes)):
        rho_i = read(lanes, rho, block, lane, 1.0)
        P = pressure_of(models.eos, rho_i, read(lanes, energy, block, lane, 1.0))
        c = sound_speed_of(models.eos, rho_i, P)
        write(sound_speed, block, lane, c)
        if energy_shift is None:
            Omega_i = read(lanes, Omega, block, lane, 1.0)
            write(pressure_term, block, lane, P / (Omega_i * rho_i * rho_i))
            if pressure is not None:
                write(pressure, block, lane, P)
        if div_v is not None:  # eqs 21, 27-28
            H = read(lanes, support, block, lane, 1.0)
            div = read(lanes, div_v, block, lane, 0.0)
            if balsara is not None:
                curl = 0.0 * div
                if curl_v is not None:
                    curl = read(lanes, curl_v, block, lane, 0.0)
                write(balsara, block, lane, balsara_factor(models.balsara, div, curl, c, H))
            if alpha is not None:
                alpha_i = read(lanes, alpha, block, lane, 0.0)
                h = H / models.support_ratio
                rate = alpha_rate_of(models.viscosity, alpha_i, h, c, div)
                rate = where_active(active, lanes, alpha_rate, block, lane, rate)
                write(alpha_rate, block, lane, rate)


@njit(**INLINED)
def summed(i, models, energy, energy_density, slope, pressure, pressure_term, energy_shift):
    """Set the pressure terms of particle i in a scheme that sums its pressure.

    energy_density: the sum of m_j u_j W_ij; slope: see `sph.formulations.gas.schemes`.
    """
    pressure[i], pressure_term[i], energy_shift[i] = summed_terms(
        models.scheme, models.eos, energy[i], energy_density, slope
    )
