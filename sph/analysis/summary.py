"""The summary of a run: how wrong it is, what it kept, and what it cost; as data and in words."""

import resource
import sys

import numpy as np

from sph.analysis import errors, pairing
from sph.version import __version__


def of_run(simulation, history: dict[str, np.ndarray], status: str, reason: str | None) -> dict:
    """The summary as a dictionary, from the simulation's last state and the whole history.

    status: "done", "stopped" or "failed", then with the reason. Errors are those against the exact
    solution; where the configuration names a reference they are left to `reference.errors_against`.
    """
    scene, particles = simulation.scene, simulation.particles
    problem, eos = scene.config.problem, scene.eos
    pressure = particles.pressure_by(eos)
    inside, outside = scene.parts()
    result = {
        "status": status,
        "reason": reason,
        "version": __version__,
        "problem": problem.name,
        "dimension": scene.dimension,
        "particles": particles.number,
        "time": simulation.time,
        "steps": simulation.step,
        "errors": None,
        "report": None,
        "conservation": conservation(history, particles, eos, pressure, problem.boundaries),
        "nearest": None,
        "cost": cost(simulation, history),
        "compiled_in": inside,
        "left_out": outside,
    }
    if status != "failed":
        result["nearest"] = pairing.figures(simulation.nearest())
        if not scene.config.report.reference:
            exact = errors.against_exact(problem, eos, simulation.time, particles, pressure)
            result["errors"] = exact
        report = problem.report(eos, simulation.time, particles, pressure)
        result["report"] = report | problem.over_time(eos, history)
    return result


def conservation(history, particles, eos, pressure, boundaries) -> dict[str, float | None]:
    """Drift of energy and momentum over the history.

    energy_drift: (E - E_0)/|E_0| at the end, where E leaves out what heating added, and
    energy_drift_max its largest modulus at any step; energy_injected: what keeping internal
    energies positive cost, a part of the drift and as it relative to |E_0|, or to the kinetic and
    internal energy at the start where that is more;
    momentum_change: |P - P_0| over sum m (|v| + c_s) of the last state, the largest of the axes
    without walls, which take momentum up; None where there is no such axis.
    """
    energy = history["total_energy"] - history.get("energy_added", 0.0)
    # potential energy may cancel the others, which are then what an error is measured by
    scale_of_energy = max(
        abs(energy[0]), history["kinetic_energy"][0] + history["internal_energy"][0]
    )
    drift = (energy - energy[0]) / scale_of_energy
    with np.errstate(invalid="ignore"):  # the last state of a run that failed
        sound_speed = eos.sound_speed(particles.density, pressure)
        speed = np.linalg.norm(particles.velocity, axis=0)
        scale = float(np.sum(particles.mass * (speed + sound_speed)))
    axes = (axis for axis, kind in zip("xyz", boundaries, strict=False) if kind != "mirror")
    momentum = [history[f"momentum_{axis}"] for axis in axes]
    return {
        "energy_drift": float(drift[-1]),
        "energy_drift_max": float(np.abs(drift).max()),
        "energy_injected": float(history["energy_injected"][-1] / scale_of_energy),
        "momentum_change": max((float(abs(p[-1] - p[0])) / scale for p in momentum), default=None),
    }


def cost(simulation, history) -> dict:
    """CPU and wall seconds of all sessions of the run; phases and updates of this one."""
    clock = simulation.clock
    phases = {name: round(seconds, 4) for name, seconds in clock.seconds.items()}
    computing = clock.cpu - clock.compiling
    updates = simulation.particles.number * simulation.steps_here
    return {
        "cpu_seconds": float(history["cpu_seconds"][-1]),
        "wall_seconds": float(history["wall_seconds"][-1]),
        "threads": simulation.team.threads,
        "session": {
            "steps": simulation.steps_here,
            "updates": updates,
            "updates_per_cpu_second": round(updates / computing) if computing > 0 else None,
            "cpu_seconds": round(clock.cpu, 4),
            "wall_seconds": round(clock.wall, 4),
            "compile_cpu_seconds": round(clock.compiling, 4),
            "phases_cpu_seconds": phases,
            "list_builds": simulation.list_builds,
            "peak_memory_bytes": peak_memory(),
        },
    }


def peak_memory() -> int:
    """Largest resident memory of this process so far, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def in_words(summary: dict) -> str:
    """The closing words of a run."""
    cost, kept = summary["cost"], summary["conservation"]
    session = cost["session"]
    rate = session["updates_per_cpu_second"] or 0
    lines = [
        f"{summary['problem']}: {summary['particles']} particles to t = {summary['time']:.6g} "
        f"in {summary['steps']} steps ({summary['status']}).",
    ]
    if summary["errors"]:
        fields = ", ".join(
            f"{name.replace('_', ' ')} {norm['L1']:.3g}"
            for name, norm in summary["errors"]["fields"].items()
        )
        named = summary["errors"].get("reference")
        truth = "the exact solution" if named is None else f"the run {named}"
        lines.append(f"Error (L1 against {truth}, {summary['errors']['region']}): {fields}.")
    else:
        lines.append("Error: this problem has no exact solution here.")
    for name, value in (summary["report"] or {}).items():
        lines.append(f"  {name.replace('_', ' ')}: {value:.6g}")
    change = kept["momentum_change"]
    momentum = "walls take momentum up" if change is None else f"momentum to {change:.2g}"
    injected = kept["energy_injected"]
    kept_positive = f" (of it {injected:.2g} keeps energies positive)" if injected else ""
    lines.append(
        f"Kept: energy to {kept['energy_drift_max']:.2g} at worst{kept_positive}; {momentum}."
    )
    lines.append(
        f"Cost: {session['wall_seconds']:.3g} s, {session['cpu_seconds']:.3g} CPU s on "
        f"{cost['threads']} thread(s), of which {session['compile_cpu_seconds']:.2g} s compiling; "
        f"{rate / 1000:.3g} thousand updates per CPU-second."
    )
    return "\n".join(lines)
