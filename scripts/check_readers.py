"""Open checkpoints with yt, pynbody and swiftsimio; compare what they see with what was written.

    pip install '.[readers]'
    python scripts/check_readers.py

One made-up state each in one, two and three dimensions. Exits with 1 if a reader sees another.
"""

import sys
import tempfile
import traceback
import warnings
from pathlib import Path

import numpy as np

from sph import config, kernels
from sph.formulations import gas
from sph.output import checkpoint
from sph.parts.viscosity import ALPHA, ALPHA_RATE
from sph.state import State

# Lattice cells along each axis, and the boundary, by dimension. In 1-D the gas is a line of the
# smoothing length's width, so few cells: it must be wider than a pixel of the slice.
CASES = {1: (100, "open"), 2: (40, "periodic"), 3: (16, "mirror")}
# of the gas in one dimension, a liquid; those in two and three are ideal
P_INF = {1: 0.1, 2: 0.0, 3: 0.0}
# neither a cube nor beginning at 0
DOMAIN = [[-0.5, 0.5], [0.25, 0.75], [-1.0, 1.0]]
PARAMETERS = """
[problem]
name = "shock_tube"
dimension = {dimension}
domain = {domain}
boundary = {boundary}
[physics]
eos = {eos}
alpha = {{ min = 0.1, max = 2.0 }}
"""


def made_up(dimension: int) -> checkpoint.Checkpoint:
    """Cells of a lattice, their density rising along x; memory order other than that of the IDs."""
    cells, boundary = CASES[dimension]
    domain = np.array(DOMAIN[:dimension])
    axes = [low + (high - low) * (np.arange(cells) + 0.5) / cells for low, high in domain]
    position = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")])
    number = position.shape[1]
    if boundary == "open":
        position[0, 0] -= 0.125  # one that has left the domain
    p_inf = P_INF[dimension]
    liquid = f'{{ name = "stiffened_gas", gamma = 1.4, p_inf = {p_inf} }}'
    settings = PARAMETERS.format(
        dimension=dimension, domain=domain.tolist(), boundary=[boundary] * dimension,
        eos=liquid if p_inf else '{ name = "ideal_gas", gamma = 1.4 }',
    )  # fmt: skip
    density = 1.0 + (position[0] - position[0].min())
    volume = np.prod(domain[:, 1] - domain[:, 0]) / number
    random = np.random.default_rng(dimension)
    particles = State.at_start(
        (*gas.FIELDS, ALPHA, ALPHA_RATE),
        position=position,
        velocity=random.normal(size=position.shape),
        mass=density * volume,
        internal_energy=1.0 + random.random(number),
    )
    particles.alpha[:] = 0.1
    particles.density[:] = density
    particles.omega[:] = 1.0
    state = checkpoint.Checkpoint(
        particles=particles,
        time=0.25,
        step=3,
        next_step=1e-3,
        list_position=position,
        list_support=particles.support,
        list_skin=0.1,
        config=config.from_text(settings, "this script"),
        lineage=(),
    )
    kernel = state.config.physics.kernel_model()
    ratio = kernels.support_ratio(kernel, dimension)
    particles.support[:] = ratio * 1.6 * ((domain[:, 1] - domain[:, 0]) / cells).max()
    order = random.permutation(number)
    state.particles = particles.subset(order)
    return state


def expected(state: checkpoint.Checkpoint) -> dict[str, np.ndarray]:
    """What a reader must see, in the order of the IDs, in centimetres, grams and seconds."""
    gas, dimension = state.particles.by_id(), state.particles.dimension
    ratio = kernels.support_ratio(state.config.physics.kernel_model(), dimension)
    velocity = np.zeros((gas.number, 3))
    velocity[:, :dimension] = gas.velocity.T
    return {
        "velocity": velocity,
        "mass": gas.mass,
        "density": gas.density,
        "internal energy": gas.internal_energy,
        "smoothing length": gas.support / ratio,
        "pressure": (1.4 - 1) * gas.density * gas.internal_energy - 1.4 * P_INF[dimension],
        "id": gas.id,
        "position": None,  # compared by `same_positions`, for the box is the file's own
    }


def by_yt(path: Path) -> dict:
    import yt

    yt.set_log_level("error")
    units = {
        "UnitLength_in_cm": 1.0,
        "UnitMass_in_g": 1.0,
        "UnitVelocity_in_cm_per_s": 1.0,
        "UnitEnergy_in_cgs": 1.0,
    }
    data = yt.load(str(path), unit_base=units)
    gas = data.all_data()

    def field(name, unit):
        return gas["PartType0", name].to_value(unit)

    side = data.domain_width.to_value("cm")
    middle = data.slice("z", data.domain_center[2])
    image = middle.to_frb(data.domain_width[0], 64, center=data.domain_center)["gas", "density"]
    return {
        "velocity": field("Velocities", "cm/s"),
        "mass": field("Masses", "g"),
        "density": field("Density", "g/cm**3"),
        "internal energy": field("InternalEnergy", "erg/g"),
        "smoothing length": field("SmoothingLength", "cm"),
        # yt knows no unit for this name and leaves it in the file's own
        "pressure": np.asarray(gas["PartType0", "Pressures"]),
        "id": field("ParticleIDs", ""),
        "position": field("Coordinates", "cm"),
        "box": side,
        "time": data.current_time.to_value("s"),
        "slice": np.asarray(image),
    }


def by_pynbody(path: Path) -> dict:
    import pynbody

    gas = pynbody.load(str(path)).gas
    fields = {
        "velocity": ("vel", "cm s**-1"),
        "mass": ("mass", "g"),
        "density": ("rho", "g cm**-3"),
        "internal energy": ("u", "erg g**-1"),
        "smoothing length": ("smooth", "cm"),
        "pressure": ("p", "g cm**-1 s**-2"),
        "position": ("pos", "cm"),
    }
    seen = {what: np.asarray(gas[name].in_units(unit)) for what, (name, unit) in fields.items()}
    time = float(gas.properties["time"].in_units("s"))
    return {**seen, "id": np.asarray(gas["iord"]), "time": time}


def by_swiftsimio(path: Path) -> dict:
    import swiftsimio

    data = swiftsimio.load(str(path))
    fields = {
        "velocity": ("velocities", "cm/s"),
        "mass": ("masses", "g"),
        "density": ("densities", "g/cm**3"),
        "internal energy": ("internal_energies", "erg/g"),
        "smoothing length": ("smoothing_lengths", "cm"),
        "pressure": ("pressures", "dyn/cm**2"),
        "id": ("particle_ids", "dimensionless"),
        "position": ("coordinates", "cm"),
    }
    seen = {
        what: getattr(data.gas, name).to_physical_value(unit)
        for what, (name, unit) in fields.items()
    }
    box = data.metadata.boxsize.to_physical_value("cm")
    time = float(data.metadata.time.to_value("s"))
    gamma = np.asarray(data.metadata.gas_gamma).item()
    return {**seen, "box": box, "time": time, "adiabatic index": gamma}


def problems(state: checkpoint.Checkpoint, seen: dict) -> list[str]:
    """What a reader saw that is not as written."""
    found = []
    order = np.argsort(seen["id"])
    for what, right in expected(state).items():
        wrong = not (
            same_positions(state, seen["position"][order])
            if what == "position"
            # a few roundings in H/h, the pressure and factors of 1 between units
            else np.allclose(seen[what][order], right, rtol=1e-14, atol=0)
        )
        if wrong:
            found.append(what)
    if seen["time"] != state.time:
        found.append("time")
    if seen.get("adiabatic index", 1.4) != 1.4:
        found.append("adiabatic index")
    return found + problems_of_box(state, seen) + problems_of_slice(state, seen)


def same_positions(state: checkpoint.Checkpoint, position: np.ndarray) -> bool:
    """Differences along used axes as in the state, unused axes in one plane."""
    true = state.particles.by_id().position.T
    used = true.shape[1]
    moved = position[:, :used] - position[0, :used] - (true - true[0])
    # four roundings of numbers up to 2
    return np.abs(moved).max() < 1e-15 and np.ptp(position[:, used:], axis=0).sum() == 0


def problems_of_box(state: checkpoint.Checkpoint, seen: dict) -> list[str]:
    inside = "box" not in seen or np.all(
        (seen["position"] >= 0) & (seen["position"] <= seen["box"])
    )
    return [] if inside else ["box"]


def problems_of_slice(state: checkpoint.Checkpoint, seen: dict) -> list[str]:
    """The middle plane must show gas, rising along x as it was made to."""
    if "slice" not in seen:
        return []
    image = np.where(np.isfinite(seen["slice"]), seen["slice"], 0.0)
    shown = image[image > 0]
    along_x = image.max(axis=0)
    gas = along_x[along_x > 0]
    rises = gas.size > 10 and gas[-10:].mean() > gas[:10].mean()
    return [] if shown.size and rises else ["slice"]


READERS = {"yt": by_yt, "pynbody": by_pynbody, "swiftsimio": by_swiftsimio}


def verdict(reader, state: checkpoint.Checkpoint, path: Path) -> str:
    try:
        wrong = problems(state, reader(path))
    except Exception:
        traceback.print_exc()
        return "cannot open it"
    return f"WRONG: {', '.join(wrong)}" if wrong else "as written"


def main() -> int:
    warnings.filterwarnings("ignore")
    good = True
    print(f"{'reader':<12}{'1-D':<16}{'2-D':<16}{'3-D':<16}")
    with tempfile.TemporaryDirectory() as directory:
        states = {dimension: made_up(dimension) for dimension in CASES}
        for dimension, state in states.items():
            checkpoint.write(Path(directory) / f"{dimension}.h5", state)
        for name, reader in READERS.items():
            verdicts = [
                verdict(reader, state, Path(directory) / f"{dimension}.h5")
                for dimension, state in states.items()
            ]
            good &= all(each == "as written" for each in verdicts)
            print(f"{name:<12}" + "".join(f"{each:<16}" for each in verdicts), flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
