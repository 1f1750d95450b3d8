"""One run of PySPH from given particles; the part of peers.py that runs where PySPH is installed.

    python peers_pysph.py JOB.json

The job names one of PySPH's own gas-dynamics examples and one of its schemes, whose parameters are
kept; only the particles (an .npz), the domain, the step and the end are ours, so that both codes
begin from the same state. A job "as_shipped" runs the example untouched. Writes the last particles
and the CPU seconds of the time loop alone.
"""

import importlib
import json
import resource
import sys
import tempfile

import numpy as np

GIANT = 10**9  # steps between outputs: only the last state is wanted


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    example = importlib.import_module(f"pysph.examples.gas_dynamics.{job['example']}")
    application = getattr(example, job["application"])
    app = application() if job["as_shipped"] else from_particles(application, job)()
    with tempfile.TemporaryDirectory() as directory:
        app.setup(arguments(job, directory))  # generates and compiles the code, if it is new
        before = energy(app.particles[0])
        started = cpu_seconds()
        app.solver.solve(show_progress=False)
        spent = cpu_seconds() - started
    fluid = app.particles[0]
    fields = {name: fluid.get(name) for name in ("x", "y", "u", "v", "m", "rho", "e")}
    figures = {"energy_ratio": energy(fluid) / before}
    figures |= {"time": app.solver.t, "steps": app.solver.count, "cpu_seconds": spent}
    np.savez(job["result"], **fields, **figures)


def cpu_seconds() -> float:
    """User and system seconds of this process so far."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def energy(fluid) -> float:
    """Total energy: kinetic and internal."""
    return float((fluid.m * (0.5 * (fluid.u**2 + fluid.v**2) + fluid.e)).sum())


def arguments(job, directory) -> list[str]:
    """Command line of the example: the scheme alone as shipped, else with fixed steps."""
    if job["as_shipped"]:
        return ["--scheme", job["scheme"], "-d", directory]
    given = {"--scheme": job["scheme"], "--timestep": job["step"], "--tf": job["end"]}
    given |= {"--pfreq": GIANT, "-d": directory}
    return ["--no-adaptive-timestep", *(str(word) for pair in given.items() for word in pair)]


def from_particles(application, job):
    """A subclass of that example that takes particles, domain and times from the job."""

    class FromParticles(application):
        def create_particles(self):
            from pysph.base.utils import get_particle_array

            given = dict(np.load(job["particles"]))
            spacing = (given["m"] / given["rho"]) ** (1.0 / job["dimension"])
            smoothing = job["smoothing"] * (
                np.full(spacing.size, spacing.max()) if job["one_smoothing"] else spacing
            )
            fluid = get_particle_array(
                name="fluid", **given, h=smoothing, h0=smoothing.copy(), wij=np.ones(spacing.size)
            )
            self.scheme.setup_properties([fluid])
            return [fluid]

        def create_domain(self):
            from pysph.base.nnps import DomainManager

            return DomainManager(**job["domain"]) if job["domain"] else None

    return FromParticles


if __name__ == "__main__":
    main()
