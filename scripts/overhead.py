"""What a step of a small scene costs, by phase, in CPU microseconds; and a checkpoint.

    python scripts/overhead.py                           this source tree, N = 400 and 1000
    python scripts/overhead.py --baseline CHECKOUT       beside another tree, runs alternating
    python scripts/overhead.py 100 --repeats 20          other sizes, more repeats

The scene is configs/sod.toml on one thread with history and checkpoints, as `sph run` makes them.
Each tree runs in a process of its own, warm: the first run of each size is not counted. CPU time
is user + system of the process. Every figure is the minimum and the median over the repeats.
"""

import argparse
import contextlib
import importlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TREE = Path(__file__).resolve().parent.parent

# Phases that the program's clock does not have: the function that is one.
FUNCTIONS = {
    "watchdog": ("sph.watchdog", "Watchdog", "check"),
    "history": ("sph.runner", "Runner", "_record"),
    "history, flush": ("sph.output.history", "History", "flush"),
    "checkpoint": ("sph.output.checkpoint", None, "write"),
}
# Phases that others are part of, and are shown without.
INSIDE = {
    "watchdog": "step size, sums",
    "history, flush": "output",
    "checkpoint": "output",
    "diagnostics": "history",
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sizes", nargs="*", type=int, default=[400, 1000], help="particles")
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--baseline", type=Path, help="a checkout to compare with")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        serve()
        return
    trees = [TREE, *([options.baseline] if options.baseline else [])]
    with contextlib.ExitStack() as stack:
        children = [stack.enter_context(child(tree)) for tree in trees]
        for size in options.sizes:
            for one in children:
                measured(one, size)
            runs = [
                [measured(one, size) for one in children] for _ in range(options.repeats)
            ]  # alternating, so that what else the machine does meets all trees alike
            report(size, trees, list(zip(*runs, strict=True)))


def report(size: int, trees: list[Path], runs) -> None:
    """Print a table; runs: for each tree what every repeat has measured."""
    steps = runs[0][0]["steps"]
    print(f"\nN = {size}, {steps} steps, {runs[0][0]['checkpoints']} checkpoints: CPU us a step")
    print(f"{'':20}" + "".join(f"{tree.resolve().name[-20:]:>22}" for tree in trees))
    print(f"{'':20}" + f"{'min':>11}{'median':>11}" * len(trees))
    names = dict.fromkeys(name for tree in runs for run in tree for name in run["phases"])
    for name in sorted(names, key=lambda name: -runs[0][0]["phases"].get(name, 0.0)):
        figures = ""
        for tree in runs:
            values = [run["phases"].get(name, 0.0) for run in tree]
            figures += f"{min(values):11.1f}{statistics.median(values):11.1f}"
        print(f"{name:20}{figures}")


@contextlib.contextmanager
def child(tree: Path):
    """A process that runs the source tree `tree`: a size in, a line of JSON out."""
    environment = os.environ | {"PYTHONPATH": str(tree.resolve())}
    with subprocess.Popen(
        [sys.executable, __file__, "--child"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        yield process
        process.stdin.close()


def measured(process, size: int) -> dict:
    process.stdin.write(f"{size}\n")
    process.stdin.flush()
    line = process.stdout.readline()
    if not line:
        sys.exit(f"a child process ended with {process.wait()}")
    return json.loads(line)


# --- in the child process ---


def serve():
    spent = {}  # CPU seconds and calls of each of FUNCTIONS
    for name, (module, owner, function) in FUNCTIONS.items():
        with contextlib.suppress(ImportError, AttributeError):  # an older tree may have another
            place = importlib.import_module(module)
            timed(getattr(place, owner) if owner else place, function, name, spent)
    for line in sys.stdin:
        print(json.dumps(run(int(line), spent)), flush=True)


def timed(owner, function: str, name: str, spent: dict) -> None:
    """Let owner.function add its CPU seconds and calls to spent[name]."""
    plain = getattr(owner, function)
    spent[name] = 0.0, 0

    def timed_function(*arguments):
        begin = time.process_time()
        result = plain(*arguments)
        seconds, calls = spent[name]
        spent[name] = seconds + time.process_time() - begin, calls + 1
        return result

    setattr(owner, function, timed_function)


class Progress:
    """Shows nothing; looks at the clocks after the first step and after each checkpoint."""

    each_step = False

    def __init__(self, spent):
        self.spent, self.first, self.last = spent, None, None

    def step(self, simulation):
        self.first = self.first or self.look(simulation)

    def wrote(self, path, simulation):
        self.last = self.look(simulation)

    def look(self, simulation) -> dict[str, float]:
        seconds = {name: seconds for name, (seconds, _) in self.spent.items()}
        return {
            "whole": time.process_time(), "steps": simulation.step,
            "checkpoints": self.spent["checkpoint"][1], **simulation.clock.seconds, **seconds
        }  # fmt: skip

    def note(self, text): ...
    def start(self, begin, end): ...
    def close(self): ...


def run(size: int, spent: dict) -> dict:
    """CPU microseconds a step, by phase, of the scene with `size` particles."""
    from sph import config as configuration
    from sph import runner
    from sph.output.run_directory import RunDirectory

    text = (TREE / "configs" / "sod.toml").read_text()
    config = configuration.from_text(text).override([f"problem.n={size}", "run.threads=1"])
    progress = Progress(spent)
    with tempfile.TemporaryDirectory() as home:
        runner.run(config, RunDirectory.create(Path(home) / "run"), progress)
    took = {name: end - progress.first.get(name, 0.0) for name, end in progress.last.items()}
    steps, checkpoints, whole = (took.pop(name) for name in ("steps", "checkpoints", "whole"))
    checkpoint = took["checkpoint"]
    for part, phase in INSIDE.items():
        if part in took and phase in took:
            took[phase] -= took[part]
    took["other"] = whole - sum(took.values())
    phases = {name: 1e6 * seconds / steps for name, seconds in took.items() if seconds}
    phases["all"] = 1e6 * whole / steps
    phases["all but checkpoints"] = 1e6 * (whole - checkpoint) / steps
    phases["(one checkpoint)"] = 1e6 * checkpoint / checkpoints
    return {"steps": steps, "checkpoints": checkpoints, "phases": phases}


if __name__ == "__main__":
    main()
