"""One run of PySPH from given particles; the part of peers.py that runs where PySPH is installed.

    python peers_pysph.py JOB.json

The job names one of PySPH's own gas-dynamics examples and one of its schemes, whose parameters are
kept; only the particles (an .npz), the domain, the step and the end are ours, so that both codes
begin from the same state. Writes the last particles and the CPU seconds of the time loop alone.
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
    app = from_particles(getattr(example, job["application"]), job)()
    with tempfile.TemporaryDirectory() as directory:
        app.setup_run(directory)
        started = cpu_seconds()
        app.solver.solve(show_progress=False)
        spent = cpu_seconds() - started
    fluid = app.particles[0]
    fields = {name: fluid.get(name) for name in ("x", "y", "u", "v", "m", "rho", "e")}
    figures = {"time": app.solver.t, "steps": app.solver.count, "cpu_seconds": spent}
    np.savez(job["result"], **fields, **figures)


def cpu_seconds() -> float:
    """User and system seconds of this process so far."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


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

        def setup_run(self, directory):
            """All of Application.run up to the time loop: code is generated and compiled here."""
            step, end = str(job["step"]), str(job["end"])
            self.args = ["--scheme", job["scheme"], "--timestep", step, "--tf", end]
            self.args += ["--pfreq", str(GIANT), "-d", directory, "--no-adaptive-timestep"]
            self.setup(self.args)

        def setup(self, argv):
            self.run_setup(argv)

    return FromParticles


if __name__ == "__main__":
    main()
