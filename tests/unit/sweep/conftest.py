"""A sweep command, and a sweep whose worker and parent process were killed."""

import pytest
from sweeps import Killed, Program


@pytest.fixture
def program(tmp_path):
    return Program(tmp_path)


@pytest.fixture(scope="session")
def killed(tmp_path_factory):
    return Killed(tmp_path_factory.mktemp("killed"))
