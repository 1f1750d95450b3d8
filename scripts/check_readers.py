"""Open checkpoints with yt, pynbody and swiftsimio; compare what they see with what was written.

    pip install '.[readers]'
    python scripts/check_readers.py

One made-up state each of gas in one, two and three dimensions, and one of a solid and a liquid in
plane strain. Exits with 1 if a reader sees another.
"""

import sys
import tempfile
import traceback
import warnings
from pathlib import Path

import numpy as np
from check_readers_states import GASES, expected, is_solid, made_up_gas, made_up_solid

from sph.output import checkpoint

# Fields that solids have besides, as the file and yt name them.
OF_SOLIDS = {
    "stress": "StressTensors",
    "plastic strain": "PlasticStrains",
    "body": "Bodies",
    "material": "Materials",
    "clamped": "Clamped",
}


def by_yt(path: Path, solid: bool) -> dict:
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
    # yt knows no unit for these names and leaves them in the file's own
    names = {"pressure": "Pressures", **(OF_SOLIDS if solid else {})}
    own = {what: np.asarray(gas["PartType0", name]) for what, name in names.items()}
    return {
        **own,
        "velocity": field("Velocities", "cm/s"),
        "mass": field("Masses", "g"),
        "density": field("Density", "g/cm**3"),
        "internal energy": field("InternalEnergy", "erg/g"),
        "smoothing length": field("SmoothingLength", "cm"),
        "id": field("ParticleIDs", ""),
        "position": field("Coordinates", "cm"),
        "box": side,
        "time": data.current_time.to_value("s"),
        "slice": np.asarray(image),
    }


def by_pynbody(path: Path, solid: bool) -> dict:
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
    if solid:
        fields |= {what: (name, "1") for what, name in OF_SOLIDS.items()}
        fields["stress"] = ("StressTensors", "g cm**-1 s**-2")
    seen = {what: np.asarray(gas[name].in_units(unit)) for what, (name, unit) in fields.items()}
    time = float(gas.properties["time"].in_units("s"))
    return {**seen, "id": np.asarray(gas["iord"]), "time": time}


def by_swiftsimio(path: Path, solid: bool) -> dict:
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
    if solid:
        fields |= {
            "stress": ("stress_tensors", "dyn/cm**2"),
            "plastic strain": ("plastic_strains", "dimensionless"),
            "body": ("bodies", "dimensionless"),
            "material": ("materials", "dimensionless"),
            "clamped": ("clamped", "dimensionless"),
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
            else equal(seen[what][order], right)
        )
        if wrong:
            found.append(what)
    if seen["time"] != state.time:
        found.append("time")
    if not is_solid(state) and seen.get("adiabatic index", 1.4) != 1.4:
        found.append("adiabatic index")
    return found + problems_of_box(state, seen) + problems_of_slice(state, seen)


def equal(seen: np.ndarray, right: np.ndarray) -> bool:
    """But for a few roundings in H/h, the pressure and factors of 1 between units."""
    roundings = 1e-15 * np.abs(right).max()
    return seen.shape == right.shape and np.allclose(seen, right, rtol=1e-14, atol=roundings)


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
        wrong = problems(state, reader(path, is_solid(state)))
    except Exception:
        traceback.print_exc()
        return "cannot open it"
    return f"WRONG: {', '.join(wrong)}" if wrong else "as written"


def main() -> int:
    warnings.filterwarnings("ignore")
    good = True
    states = {f"{dimension}-D": made_up_gas(dimension) for dimension in GASES}
    states["solid"] = made_up_solid()
    print(f"{'reader':<12}" + "".join(f"{name:<16}" for name in states))
    with tempfile.TemporaryDirectory() as directory:
        for name, state in states.items():
            checkpoint.write(Path(directory) / f"{name}.h5", state)
        for reader, read in READERS.items():
            verdicts = [
                verdict(read, state, Path(directory) / f"{name}.h5")
                for name, state in states.items()
            ]
            good &= all(each == "as written" for each in verdicts)
            print(f"{reader:<12}" + "".join(f"{each:<16}" for each in verdicts), flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
