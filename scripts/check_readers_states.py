"""Made-up states for check_readers.py, and what a reader must see of them."""

import dataclasses

import numpy as np

from sph import config, kernels
from sph.output import checkpoint
from sph.scene import Scene
from sph.state import State

# Lattice cells along each axis, and the boundary, by dimension. In 1-D the gas is a line of the
# smoothing length's width, so few cells: it must be wider than a pixel of the slice.
GASES = {1: (100, "open"), 2: (40, "periodic"), 3: (16, "mirror")}
# of the gas in one dimension, a liquid; those in two and three are ideal
P_INF = {1: 0.1, 2: 0.0, 3: 0.0}
# neither a cube nor beginning at 0
DOMAIN = [[-0.5, 0.5], [0.25, 0.75], [-1.0, 1.0]]
GAS = """
[problem]
name = "shock_tube"
dimension = {dimension}
domain = {domain}
boundary = {boundary}
[physics]
eos = {eos}
alpha = {{ min = 0.1, max = 2.0 }}
"""
# every density is below the metal's rho_0, where its pressure is linear in density and energy
UNITS = """
[units]
length = "pc"
mass = "M_sun"
time = "Myr"
"""
SOLID = """
[problem]
name = "bodies"
dimension = 2
domain = [[-0.5, 0.5], [0.25, 0.75]]
boundary = "open"
[[problem.body]]
shape = "box"
low = [-0.5, 0.25]
high = [0.0, 0.75]
material = "metal"
clamped = true
[[problem.body]]
shape = "box"
low = [0.0, 0.25]
high = [0.5, 0.75]
material = "water"
[physics]
formulation = "continuum"
[physics.materials.metal]
eos = { name = "mie_gruneisen", rho_0 = 2.0, c_0 = 2.0, slope = 1.5, gruneisen = 1.5 }
strength = { name = "elastic_plastic", shear_modulus = 3.0, yield_stress = 0.5 }
[physics.materials.water]
eos = { name = "tait", rho_0 = 0.5, c_0 = 1.5 }
"""


def made_up() -> dict[str, checkpoint.Checkpoint]:
    """Return gas in one, two and three dimensions, in units of its own, and a solid, by name."""
    found = {f"{dimension}-D": made_up_gas(dimension) for dimension in GASES}
    return found | {"units": made_up_gas(3, UNITS), "solid": made_up_solid()}


def earlier(state: checkpoint.Checkpoint) -> checkpoint.Checkpoint:
    """Return another state of the same run."""
    particles = state.particles.subset(np.arange(state.particles.number))
    particles.density *= 0.5
    return dataclasses.replace(state, particles=particles, time=0.125)


def made_up_gas(dimension: int, units: str = "") -> checkpoint.Checkpoint:
    cells, boundary = GASES[dimension]
    p_inf = P_INF[dimension]
    liquid = f'{{ name = "stiffened_gas", gamma = 1.4, p_inf = {p_inf} }}'
    settings = GAS.format(
        dimension=dimension, domain=DOMAIN[:dimension], boundary=[boundary] * dimension,
        eos=liquid if p_inf else '{ name = "ideal_gas", gamma = 1.4 }',
    )  # fmt: skip
    position = lattice(dimension, cells)
    if boundary == "open":
        position[0, 0] -= 0.125  # one that has left the domain
    return state_of(settings + units, position, cells, alpha=0.1, omega=1.0)


def made_up_solid() -> checkpoint.Checkpoint:
    """A clamped metal on the left, with stress and plastic strain, and water on the right."""
    position = lattice(2, 40)
    metal = position[0] < 0.0
    xx, yy, xy = metal * np.random.default_rng(4).normal(size=(3, metal.size))
    return state_of(
        SOLID, position, 40, material=~metal, clamped=metal, body=metal,
        deviatoric_stress=np.array([[xx, xy], [xy, yy]]), plastic_strain=metal * (1.0 + xx * xx),
    )  # fmt: skip


def lattice(dimension: int, cells: int) -> np.ndarray:
    """(D, N) centres of the cells of the domain, with so many along each axis."""
    centres = (np.arange(cells) + 0.5) / cells
    axes = [low + (high - low) * centres for low, high in DOMAIN[:dimension]]
    return np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")])


def state_of(settings: str, position: np.ndarray, cells: int, **others) -> checkpoint.Checkpoint:
    """A density rising along x; memory order other than that of the IDs. others: further fields."""
    dimension, number = position.shape
    sides = np.ptp(np.array(DOMAIN[:dimension]), axis=1)
    density = 1.0 + (position[0] - position[0].min())
    random = np.random.default_rng(dimension)
    configured = config.from_text(settings, "this script")
    particles = State.at_start(
        Scene(configured).fields,
        position=position,
        velocity=random.normal(size=position.shape),
        mass=density * np.prod(sides) / number,
        internal_energy=1.0 + random.random(number),
    )
    ratio = kernels.support_ratio(configured.physics.kernel_model(), dimension)
    others |= {"density": density, "support": ratio * 1.6 * (sides / cells).max()}
    for name, values in others.items():
        getattr(particles, name)[:] = values
    return checkpoint.Checkpoint(
        particles=particles.subset(random.permutation(number)),
        time=0.25,
        step=3,
        next_step=1e-3,
        list_position=position,
        list_support=particles.support,
        list_skin=0.1,
        config=configured,
        lineage=(),
    )


def expected(state: checkpoint.Checkpoint) -> dict[str, np.ndarray]:
    """What a reader must see, in the order of the IDs, in code units; not the position."""
    gas, dimension = state.particles.by_id(), state.particles.dimension
    ratio = kernels.support_ratio(state.config.physics.kernel_model(), dimension)
    velocity = np.zeros((gas.number, 3))
    velocity[:, :dimension] = gas.velocity.T
    known = {
        "velocity": velocity,
        "mass": gas.mass,
        "density": gas.density,
        "internal_energy": gas.internal_energy,
        "h": gas.support / ratio,
        "id": gas.id,
    }
    if state.config.physics.formulation == "continuum":
        return known | expected_of_solid(gas)
    pressure = (1.4 - 1) * gas.density * gas.internal_energy - 1.4 * P_INF[dimension]
    return known | {"pressure": pressure, "alpha": gas.alpha}


def expected_of_solid(solid: State) -> dict[str, np.ndarray]:
    metal = solid.material == 0.0
    in_metal = 2.0**2 * (solid.density - 2.0) + 1.5 * 2.0 * solid.internal_energy
    pressure = np.where(metal, in_metal, 1.5**2 * (solid.density - 0.5))
    (xx, xy), (_, yy) = solid.deviatoric_stress
    zero = np.zeros(solid.number)
    stress = [xx - pressure, yy - pressure, -xx - yy - pressure, xy, zero, zero]
    return {
        "pressure": pressure,
        "stress": np.stack(stress, axis=1),
        "plastic_strain": solid.plastic_strain,
        "body": metal,
        "material": ~metal,
        "clamped": metal,
    }
