"""Restarts that change the scheme and the parts of the physics, as a user does them."""

import pytest

from sph import config, progress, restarting, runner
from sph.output import checkpoint
from sph.output.run_directory import RunDirectory

CONTACTS = 'physics.conductivity={ name = "approach", switched = true }'
CHAIN = [
    "physics.scheme=pressure_energy",
    'physics.alpha={ min = 0.1, max = 1.5, switch = "cullen_dehnen" }',
    CONTACTS,
    "physics.scheme=grad_h",
    'physics.alpha={ min = 0.1, max = 1.5, switch = "morris_monaghan" }',
    "physics.density=number",
]


@pytest.mark.slow
def test_a_chain_of_restarts_through_schemes_switches_and_terms(tmp_path):
    """Each link is then restarted from its own first checkpoint, and gives the same bits."""
    text = (
        '[problem]\nname = "shock_tube"\nn = 60\n[physics]\nalpha = { min = 0.1, max = 1.5 }\n'
        "[time]\nend = 0.004\n[output]\ninterval = 0.002\n"
    )
    last = tmp_path / "0"
    runner.run(config.from_text(text, "the test"), RunDirectory.create(last), progress.suited())
    for link, setting in enumerate(CHAIN, start=1):
        here, again = tmp_path / f"{link}", tmp_path / f"{link} again"
        until = f"time.end={0.004 * (link + 1)}"
        restarting.restart(last, [setting, until], here, progress.suited())
        middle, end = sorted((here / "checkpoints").iterdir())[-2:]
        restarting.restart(middle, [], again, progress.suited())
        one, other = (checkpoint.read(path) for path in (end, again / "checkpoints" / end.name))
        arrays = one.particles.arrays(), other.particles.arrays()
        assert arrays[0].keys() == arrays[1].keys()
        for name, array in arrays[0].items():
            assert array.tobytes() == arrays[1][name].tobytes(), (setting, name)
        assert one.budget == other.budget
        last = here
