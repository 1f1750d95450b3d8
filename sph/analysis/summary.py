"""The summary of a run, as figures and as text. `sph.summary` defines each figure."""

import resource
import sys

import numpy as np

from sph import warnings
from sph.analysis import errors, truth
from sph.clock import PLACING
from sph.config import restarts
from sph.summary import Conservation, Cost, Relaxation, Status, Summary
from sph.totals import Baseline
from sph.version import __version__


def of_run(
    simulation, history: dict[str, np.ndarray], status: Status, reason: str | None,
    lineage: tuple[str, ...] = (), relaxation: Relaxation | None = None,
) -> Summary:  # fmt: skip
    """The summary, from the simulation's last state and the whole history.

    status: "done", "stopped" or "failed"; the last two with the reason. Errors are against the
    exact solution; where the configuration names a reference, `reference.errors_against` has them.
    relaxation: how relaxation to a glass ended, if the run began from one.
    """
    scene, particles = simulation.scene, simulation.particles
    inside, outside = scene.described()
    # before the cost, which contains its compilation
    nearest = None if status == "failed" else simulation.nearest()
    result: Summary = {
        "status": status,
        "reason": reason,
        "warnings": [],
        "version": __version__,
        "problem": scene.config.problem.name,
        "dimension": scene.dimension,
        "particles": particles.number,
        "time": simulation.time,
        "steps": simulation.step,
        "lineage": list(lineage),
        "settings_changed": restarts.settings_changed(lineage),
        "errors": None,
        "errors_left_out": None,
        "report": None,
        "conservation": conservation(history, particles, scene, simulation.baseline),
        "momentum_along": _axes(scene),
        "nearest": None,
        "cost": cost(simulation, history),
        "compiled_in": inside,
        "left_out": outside,
    }
    if relaxation is not None:
        result["relaxation"] = relaxation
    if nearest is None:
        result["errors_left_out"] = "the run failed"
    else:
        _judge(result, simulation, history)
        result["nearest"] = {
            "median": float(np.median(nearest)), "smallest": float(nearest.min())
        }  # fmt: skip
        if found := scene.formulation.pieces(particles):
            result["tearing"] = {"bodies": found.bodies, "pieces": found.pieces}
    warn(result, simulation)
    return result


def _judge(result: Summary, simulation, history) -> None:
    """Set the errors and the problem's own figures of a run that has not failed."""
    config, now, particles = simulation.scene.config, simulation.time, simulation.particles
    pressure = simulation.scene.formulation.pressure(particles)
    if not config.report.reference:
        result["errors"] = errors.against_exact(config, now, particles, pressure)
        result["errors_left_out"] = truth.left_out(config, now, particles.position)
    elif result["status"] != "done":
        result["errors_left_out"] = "the run stopped before time.end"
    result["report"] = truth.figures(config, now, particles, pressure, history)


def warn(summary: Summary, simulation) -> None:
    """Set the warnings of a summary that is otherwise complete."""
    found = warnings.of_run(simulation, summary)
    summary["warnings"] = [{"kind": one.kind, "text": one.text} for one in found]


def conservation(history, particles, scene, start: Baseline) -> Conservation:
    """Return how well the run conserved energy, momentum and volume."""
    drift = history["energy_drift"]
    ratio = history.get("volume_ratio")
    return {
        "energy_drift": float(drift[-1]),
        "energy_drift_max": float(np.abs(drift).max()),
        "energy_injected": _relative(history["energy_injected"][-1], start.scale),
        "momentum_change": _momentum_change(history, particles, scene),
        "volume_ratio": None if ratio is None else float(ratio[-1]),
        "volume_ratio_worst": None if ratio is None else float(_farthest_from_one(ratio)),
    }


def _relative(amount: float, scale: float) -> float:
    """Return amount/scale, 0 for no amount: matter may be at rest, without energy."""
    return float(np.divide(amount, scale)) if amount != 0.0 else 0.0


def baseline(history) -> Baseline:
    """The energy that the drift of a run is measured from, by the first row of its history."""
    potential = history["potential_energy"][0] if "potential_energy" in history else 0.0
    return Baseline.of(
        history["kinetic_energy_without_bulk"][0], history["internal_energy"][0], potential
    )


def _axes(scene) -> list[str]:
    return ["xyz"[axis] for axis in np.flatnonzero(scene.keeps_momentum)]


def _momentum_change(history, particles, scene) -> float | None:
    kept = np.flatnonzero(scene.keeps_momentum)
    if kept.size == 0:
        return None
    momentum = np.array([history[f"momentum_{'xyz'[axis]}"] for axis in kept])
    p = particles
    with np.errstate(invalid="ignore"):  # the last state of a run that failed
        bulk = scene.keeps_momentum * (p.velocity @ p.mass) / p.mass.sum()
        sound_speed = scene.formulation.sound_speed(p)
        speed = np.linalg.norm(p.velocity - bulk[:, None], axis=0)
        scale = float(np.sum(p.mass * (speed + sound_speed)))
    return _relative(float(np.abs(momentum - momentum[:, :1]).max()), scale)


def _farthest_from_one(ratio: np.ndarray) -> float:
    return ratio[np.argmax(np.abs(np.log(ratio)))]


def cost(simulation, history) -> Cost:
    """The cost of the run, from its history, and of this session, from the simulation's clock."""
    clock = simulation.clock
    phases = {name: round(seconds, 4) for name, seconds in clock.seconds.items()}
    updates = simulation.updates_here
    of_steps = clock.cpu - clock.seconds.get(PLACING, 0.0)
    return {
        "cpu_seconds": float(history["cpu_seconds"][-1]),
        "wall_seconds": float(history["wall_seconds"][-1]),
        "threads": simulation.team.threads,
        "updates": _updates(history, simulation.particles.number),
        "session": {
            "steps": simulation.steps_here,
            "updates": updates,
            "updates_per_cpu_second": round(updates / of_steps)
            if updates and of_steps > 0
            else None,
            "cpu_seconds": round(clock.cpu, 4),
            "wall_seconds": round(clock.wall, 4),
            "compile_cpu_seconds": round(clock.compiling, 4),
            "phases_cpu_seconds": phases,
            "list_builds": simulation.list_builds,
            "peak_memory_bytes": peak_memory(),
        },
    }


def _updates(history, number: int) -> int:
    """Return the number of updates of a particle in the whole run."""
    if "updates" in history:
        return int(history["updates"].sum())
    return number * int(history["step"][-1])


def peak_memory() -> int:
    """Largest resident memory of this process so far, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def _percent(relative: float | None) -> str:
    """An error relative to the exact field, in brackets; empty where that field is zero."""
    if relative is None:
        return ""
    return f" ({100.0 * relative:.2g} %)" if relative < 1.0 else f" ({relative:.2g} times its size)"


def in_words(summary: Summary) -> str:
    """Return the closing text of a run: its end, warnings, errors, conservation and cost."""
    lines = [
        f"{summary['problem']}: {summary['particles']} particles to t = {summary['time']:.6g} "
        f"in {summary['steps']} steps ({_ending(summary)}).",
        *(f"Warning: {one['text']}" for one in summary["warnings"]),
        *_changes_in_words(summary),
        _errors_in_words(summary),
        *(
            f"  {name.replace('_', ' ')}: {value:.6g}"
            for name, value in (summary["report"] or {}).items()
        ),
        _kept_in_words(summary),
        *_relaxation_in_words(summary),
        _cost_in_words(summary["cost"]),
    ]
    return "\n".join(lines)


def _ending(summary: Summary) -> str:
    count = len(summary["warnings"])
    warned = f", with {count} warning{'s' * (count > 1)}" if count else ""
    return f"{summary['status']}{warned}"


def _changes_in_words(summary: Summary) -> list[str]:
    changed = summary["settings_changed"]
    return [f"Settings changed in restarts: {'; '.join(changed)}."] if changed else []


def _errors_in_words(summary: Summary) -> str:
    errors = summary["errors"]
    if not errors:
        return f"Error: left out, because {summary['errors_left_out']}."
    fields = ", ".join(
        f"{name.replace('_', ' ')} {norm['L1']:.3g}{_percent(norm['relative_L1'])}"
        for name, norm in errors["fields"].items()
    )
    named = errors.get("reference")
    truth = errors["against"] if named is None else f"the run {named}"
    return f"Error (L1 against {truth}, {errors['region']}): {fields}."


def _kept_in_words(summary: Summary) -> str:
    kept = summary["conservation"]
    change, injected, ratio = kept["momentum_change"], kept["energy_injected"], kept["volume_ratio"]
    parts = [f"energy to {kept['energy_drift_max']:.2g}"]
    if injected:
        parts[0] += f" ({injected:.2g} of it to keep internal energies positive)"
    parts.append(
        "momentum is not conserved at walls, by clamps or in an external field"
        if change is None
        else f"momentum{_along(summary)} to {change:.2g}"
    )
    if ratio is not None:
        parts.append(f"at the end sum m/rho is {ratio:.4g} of the volume")
    return f"Conserved, at worst over the run: {'; '.join(parts)}."


def _along(summary: Summary) -> str:
    """The axes that conserve momentum, unless all do."""
    axes = summary.get("momentum_along", [])
    return f" along {' and '.join(axes)}" if 0 < len(axes) < summary["dimension"] else ""


def _relaxation_in_words(summary: Summary) -> list[str]:
    if not (ended := summary.get("relaxation")):
        return []
    return [
        f"Glass, after {ended['iterations']} iterations: density error {ended['density_error']:.2g}"
        f" rms about a mean offset of {ended['mean_offset']:+.2g}; {ended['cpu_seconds']:.3g} CPU "
        "s, which the cost includes and the rate of updates leaves out."
    ]


def _cost_in_words(cost: Cost) -> str:
    session = cost["session"]
    rate = session["updates_per_cpu_second"]
    words = f"; {rate:,} particle updates per CPU-second" if rate else ""
    return (
        f"Cost: elapsed time {session['wall_seconds']:.3g} s, {session['cpu_seconds']:.3g} CPU s "
        f"on {cost['threads']} thread(s), and {session['compile_cpu_seconds']:.2g} CPU s for "
        f"compilation{words}."
    )
