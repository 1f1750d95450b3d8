"""What the benchmark measures: the configurations, and the figures of each."""

import math
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmark_runs import Measurement, Spent, Tree, process, run

CONFIGS = Path(__file__).resolve().parent.parent / "configs"

UNIFORM = """
[problem]
name = "uniform"
dimension = {dimension}
n = {n}
noise = 0.2
seed = 1
[physics]
gamma = 1.6666666666666667
eta = {eta}
balsara = {balsara}
alpha = {alpha}
[time]
end = {end}
[output]
interval = {end}
"""
TUBE = '[problem]\nname = "shock_tube"\nn = {n}\n[time]\nend = {end}\n[output]\ninterval = {end}\n'
BLOCKS = """
[problem]
name = "bodies"
dimension = 3
n = {n}
domain = [-1.5, 1.5]
[[problem.body]]
shape = "box"
low = [-1.02, -0.5, -0.5]
high = [-0.02, 0.5, 0.5]
velocity = [0.05, 0.0, 0.0]
[[problem.body]]
shape = "box"
low = [0.02, -0.5, -0.5]
high = [1.02, 0.5, 0.5]
velocity = [-0.05, 0.0, 0.0]
[physics]
formulation = "continuum"
correction = {order}
tensile_correction = {tensile}
eos = {{ name = "tait", rho_0 = 1.0, c_0 = 1.0 }}
strength = {{ name = "elastic", shear_modulus = 0.5 }}
[time]
end = {end}
[output]
interval = {end}
"""
SINGLE = '[run]\nprecision = "single"\n'

STEP = 0.0045 * 64  # of the noisy 3-D lattice times n per axis, by the signal-speed criterion
BLOCK_STEP = 0.1156  # of the elastic blocks over their spacing, by the signal-speed criterion
ETA = 1.6  # 125 neighbours in 3-D: 4 pi/3 (1.936 eta)^3, with H/h = 1.936 of Wendland's C2 kernel
CONSTANT, SWITCHED = "1.0", "{ min = 0.1, max = 2.0 }"
# Phases of the program's clock that are not part of a step.
NOT_OF_A_STEP = ("start of Numba", "initial state", "diagnostics", "output")


def uniform(
    dimension=3, n=64**3, balsara="true", alpha=CONSTANT, steps=12, neighbours=125,
    precision="double",
) -> str:  # fmt: skip
    """A lattice with noise, periodic, for about `steps` steps; neighbours: as in 3-D."""
    eta = ETA * (neighbours / 125) ** (1 / 3)
    end = steps * STEP / n ** (1 / dimension) * (eta / ETA)
    text = UNIFORM.format(dimension=dimension, n=n, eta=eta, balsara=balsara, alpha=alpha, end=end)
    return text + (SINGLE if precision == "single" else "")


def tube(n=400, end=0.2) -> str:
    return TUBE.format(n=n, end=end)


def blocks(n=32**3, steps=20, order=0, tensile=0.0) -> str:
    """Two elastic cubes that collide, for about `steps` steps; 57 neighbours inside."""
    end = steps * BLOCK_STEP * (2.0 / n) ** (1 / 3)
    return BLOCKS.format(n=n, order=order, tensile=tensile, end=end)


def of_updates(cost: dict, less: dict | None = None) -> dict[str, float]:
    """CPU µs per particle update and by phase; of what a run has beyond a shorter one, `less`."""
    updates = cost["updates"] - (less["updates"] if less else 0)
    before = less["phases_cpu_seconds"] if less else {}
    phases = {
        name: 1e6 * (seconds - before.get(name, 0.0)) / updates
        for name, seconds in cost["phases_cpu_seconds"].items()
        if name not in NOT_OF_A_STEP
    }
    return {"update": math.fsum(phases.values()), **phases}


def of_process(spent: Spent) -> dict[str, float]:
    return {"process": spent.cpu, "process, wall": spent.wall}


def engine(quick: bool):
    """3-D lattice with noise: CPU time per particle update, by phase; memory per particle."""
    for precision in ("double", "single"):
        cases = [(32, 1, 125), (32, 1, 57), (64, 1, 125)]
        if not quick:
            cases += [(64, 1, 57), (100, 1, 125), (32, 2, 125), (64, 2, 125), (100, 2, 125)]
        for case in cases:
            yield engine_case(*case, precision)
        yield _memory(32, 64 if quick else 100, precision)


def engine_case(per_axis: int, threads: int, neighbours: int, precision: str) -> Measurement:
    def text(steps, n=per_axis**3):
        return uniform(n=n, steps=steps, neighbours=neighbours, precision=precision)

    def once(tree: Tree) -> dict[str, float]:
        long, short = (run(tree, text(steps), threads) for steps in (20, 4))
        updates = long["updates"] - short["updates"]
        steps = long["steps"] - short["steps"]
        return {
            "whole run, update": 1e6 * long["cpu_seconds"] / long["updates"],
            "peak memory": long["peak_memory_bytes"] / 1e6,
            **of_updates(long, short),
            "update, wall": 1e6 * (long["wall_seconds"] - short["wall_seconds"]) / updates,
            "list builds per step": (long["list_builds"] - short["list_builds"]) / steps,
        }

    threads_text = f"{threads} thread" + ("s" if threads > 1 else "")
    scene = f"{per_axis}³, {neighbours} neighbours, {precision}, {threads_text}"
    return Measurement("engine", scene, once, text(3, 4096), precision)


def _memory(small: int, large: int, precision: str) -> Measurement:
    def once(tree: Tree) -> dict[str, float]:
        peaks = [
            run(tree, uniform(n=per_axis**3, steps=3, precision=precision))["peak_memory_bytes"]
            for per_axis in (small, large)
        ]
        return {"memory per particle": (peaks[1] - peaks[0]) / (large**3 - small**3)}

    scene = f"{small}³ to {large}³, {precision}, 1 thread"
    warm = uniform(n=4096, steps=3, precision=precision)
    return Measurement("engine", scene, once, warm, precision)


def small(_quick: bool):
    """Small scenes: CPU time of a further step, with history, without checkpoints."""
    for scene, text, ends in (
        ("Sod 1-D, N = 400", tube, (0.2, 6.0)),
        ("uniform 2-D, 64²", lambda end: uniform(2, 64**2, steps=end), (20, 520)),
    ):
        yield Measurement("small", scene, _step_cost(text, ends), text(end=ends[0]))


def _step_cost(text: Callable[..., str], ends: tuple[float, float]):
    """The difference of two runs, which leaves out the start and the checkpoint at the end."""

    def once(tree: Tree) -> dict[str, float]:
        short, long = (run(tree, text(end=end)) for end in ends)
        seconds = long["cpu_seconds"] - short["cpu_seconds"]
        return {"step": 1e6 * seconds / (long["steps"] - short["steps"])}

    return once


def whole(_quick: bool):
    """Whole processes with compiled code in the cache: tubes to t = 0.2."""

    def once_1d(tree: Tree) -> dict[str, float]:
        return of_process(run(tree, tube(1000))["process"])

    yield Measurement("whole", "Sod 1-D, N = 1000", once_1d, tube(1000))
    sod_3d = (CONFIGS / "sod_3d.toml").read_text(encoding="utf-8")
    for precision, more in (("double", ""), ("single", SINGLE)):
        warm = sod_3d.replace("98784", "6000") + more
        scene = "configs/sod_3d.toml" + (", single" if more else "")
        yield Measurement("whole", scene, _whole_cost(sod_3d + more), warm, precision)


def _whole_cost(text: str):
    def once(tree: Tree) -> dict[str, float]:
        cost = run(tree, text)
        return {**of_process(cost["process"]), **of_updates(cost)}

    return once


def start(_quick: bool):
    """Start: `sph --help`, a run of one step, and compilation from an empty cache."""

    def helped(tree: Tree) -> dict[str, float]:
        return of_process(process(tree, ["--help"]))

    def first_step(tree: Tree) -> dict[str, float]:
        return of_process(run(tree, tube(end=1e-6))["process"])

    yield Measurement("start", "sph --help", helped)
    yield Measurement("start", "one step, Sod 1-D, N = 400", first_step, tube(end=1e-6))
    for scene, text in (
        ("empty cache, Sod 1-D, N = 1000", tube(1000)),
        ("empty cache, 3-D, 16³", uniform(n=16**3, steps=3)),
    ):
        yield Measurement("start", scene, _cold(text))


def _cold(text: str):
    def once(tree: Tree) -> dict[str, float]:
        with tempfile.TemporaryDirectory() as cache:
            cost = run(tree, text, cache=Path(cache))
        return {"compilation": cost["compile_cpu_seconds"], **of_process(cost["process"])}

    return once


def scenes(quick: bool):
    """Scenes by dimension and viscosity: what a scene does not need costs nothing."""
    if quick:
        return
    for dimension, n, steps in ((1, 20_000, 40), (2, 160**2, 40), (3, 40**3, 20)):
        for alpha, kind in ((CONSTANT, "constant"), (SWITCHED, "switched")):
            for balsara in ("false", "true"):
                text = uniform(dimension, n, balsara, alpha, steps)
                scene = f"{dimension}-D, alpha {kind}, balsara {balsara}"
                yield Measurement("scenes", scene, _scene_cost(text), text)


def _scene_cost(text: str):
    def once(tree: Tree) -> dict[str, float]:
        cold = _cold(text)(tree)["compilation"]
        return {"compilation": cold, **of_updates(run(tree, text))}

    return once


def solids(quick: bool):
    """3-D elastic blocks that collide: CPU time per particle update, by phase."""
    for order, tensile in ((0, 0.0),) if quick else ((0, 0.0), (0, 0.3), (1, 0.0)):
        for per_axis in (32,) if quick else (32, 64):
            scene = f"{per_axis}³, order {order}" + ", tensile correction" * (tensile > 0.0)
            warm = blocks(4096, 3, order, tensile)
            yield Measurement("solids", scene, _blocks_cost(per_axis**3, order, tensile), warm)


def _blocks_cost(n: int, order: int, tensile: float):
    """The difference of two runs, which leaves out the start and the checkpoint at the end."""

    def once(tree: Tree) -> dict[str, float]:
        long, short = (run(tree, blocks(n, steps, order, tensile)) for steps in (20, 4))
        return of_updates(long, short)

    return once


PARTS = {
    "engine": engine,
    "small": small,
    "whole": whole,
    "start": start,
    "scenes": scenes,
    "solids": solids,
}
