"""Runs of shipped configurations, each made once a session."""

import pytest
from outcome import CONFIGS, Outcome, simulate

from sph import config as configuration


@pytest.fixture(scope="session")
def run():
    """run(stem, *overrides, max_steps=None): a shipped configuration, run once a session."""
    kept: dict[tuple, Outcome] = {}

    def once(stem, *overrides, max_steps=None) -> Outcome:
        key = (stem, *overrides, max_steps)
        if key not in kept:
            config = configuration.load(CONFIGS / f"{stem}.toml", overrides)
            kept[key] = simulate(config, max_steps)
        return kept[key]

    return once
