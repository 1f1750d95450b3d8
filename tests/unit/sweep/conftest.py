"""A sweep command, and a sweep whose worker and parent process were killed."""

import pytest
from sweeps import KilledSweep, Program


@pytest.fixture
def program(tmp_path):
    return Program(tmp_path)


@pytest.fixture(scope="session")
def killed_sweep(tmp_path_factory):
    return KilledSweep(tmp_path_factory.mktemp("killed"))
