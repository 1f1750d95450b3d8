"""One run of PySPH's elastic solids from given particles; the part of peers_solids.py in PySPH.

    python peers_pysph_solids.py JOB.json

The job names one of PySPH's own examples of solids, whose scheme and parameters are kept; only the
particles (an .npz), the step and the end are given, so that both codes begin from the same state.
Writes positions and velocities at equal times and the CPU seconds of the time loop alone.
"""

import importlib
import json
import sys
import tempfile

import numpy as np
from peers_pysph import GIANT, cpu_seconds

MOVING, HELD = 0, 1


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    example = importlib.import_module(f"pysph.examples.solid_mech.{job['example']}")
    app = from_particles(getattr(example, job["application"]), job)()
    with tempfile.TemporaryDirectory() as directory:
        given = {"--timestep": job["step"], "--tf": job["end"], "--pfreq": GIANT, "-d": directory}
        words = (str(word) for pair in given.items() for word in pair)
        # generates and compiles the code, if it is new
        app.setup(["--no-adaptive-timestep", *words])
        started = cpu_seconds()
        app.solver.solve(show_progress=False)
        spent = cpu_seconds() - started
    frames = {name: np.array([one[name] for one in app.frames]) for name in app.frames[0]}
    figures = {"steps": app.solver.count, "cpu_seconds": spent}
    np.savez(job["result"], **frames, **figures, held=app.held)


def from_particles(application, job):
    """A subclass of that example that takes particles and times from the job."""

    class FromParticles(application):
        def create_particles(self):
            from pysph.base.kernels import CubicSpline
            from pysph.sph.solid_mech.basic import get_particle_array_elastic_dynamics

            given = dict(np.load(job["particles"]))
            self.held = given.pop("held") > 0.0
            self.frames = []
            spacing, h = job["spacing"], job["smoothing"] * job["spacing"]
            at_spacing = CubicSpline(dim=2).kernel(rij=spacing, h=h)
            material = {"E": job["youngs"], "nu": job["poisson"], "rho_ref": job["density"]}
            arrays = []
            for name, chosen in zip(job["arrays"], (~self.held, self.held), strict=False):
                fields = {key: value[chosen].copy() for key, value in given.items()}
                constants = {**material, "wdeltap": at_spacing, "n": 4}
                arrays.append(
                    get_particle_array_elastic_dynamics(
                        name=name, h=np.full(chosen.sum(), h), constants=constants, **fields
                    )
                )
            return arrays

        def pre_step(self, solver):
            if solver.t >= len(self.frames) * job["end"] / job["frames"]:
                self.keep(solver.t)

        def keep(self, time):
            moving = self.particles[MOVING]
            fields = {name: moving.get(name).copy() for name in ("x", "y", "u", "v")}
            self.frames.append({"t": time, **fields})

        def post_step(self, solver):
            if solver.t >= job["end"] * (1.0 - 1e-12):
                self.keep(solver.t)

    return FromParticles


if __name__ == "__main__":
    main()
