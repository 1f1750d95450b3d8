"""How many processes run the tests by default, and the texts of messages that users see."""

import functools
from pathlib import Path

import pytest
from snapshots import Messages, Snapshot

HERE = Path(__file__).parent
SNAPSHOT, TESTS = pytest.StashKey[Snapshot](), pytest.StashKey[set[str]]()


def pytest_addoption(parser):
    parser.addoption("--update-messages", action="store_true", help="rewrite tests/messages.txt")


def pytest_configure(config):
    config.stash[SNAPSHOT] = Snapshot(HERE / "messages.txt", config.option.update_messages)


def pytest_xdist_auto_num_workers(config):
    """One for each core, but 0 where only files are named: one process then starts faster.

    Also 0 where tests/messages.txt is rewritten, which one process must do.
    """
    named = [Path(argument.partition("::")[0]) for argument in config.args]
    alone = config.option.update_messages or all(path.is_file() for path in named)
    return 0 if alone else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """All tests of the files, before any is deselected."""
    config.stash[TESTS] = {id_of(item) for item in items}


def pytest_sessionfinish(session):
    config = session.config
    if config.option.update_messages and TESTS in config.stash:
        config.stash[SNAPSHOT].write(config.stash[TESTS])


def id_of(item) -> str:
    return f"{item.path.relative_to(HERE).as_posix()}::{item.name}"


@pytest.fixture(autouse=True, scope="session")
def every_figure_has_a_meaning():
    """Any test in which a problem returns a column or figure that it does not declare fails."""
    from sph import registry

    with pytest.MonkeyPatch.context() as patch:
        for name in registry.names("sph.problems"):
            problem = registry.load("sph.problems", name).Problem
            for method in ("diagnostics", "report", "compare", "over_time"):
                if method in vars(problem):
                    patch.setattr(problem, method, _declared(vars(problem)[method]))
        yield


def _declared(method):
    from sph.quantity import meaning

    @functools.wraps(method)
    def checked(self, *arguments):
        found = method(self, *arguments)
        missing = [name for name in found if meaning(self.quantities, name) is None]
        assert not missing, f"{type(self).__module__}: quantities lack {missing}"
        return found

    return checked


@pytest.fixture
def messages(request, tmp_path_factory):
    """messages.check(text), or `with messages.raised(ConfigError, "physics.eta"):`."""
    snapshot = request.config.stash[SNAPSHOT]
    return Messages(snapshot, id_of(request.node), tmp_path_factory.getbasetemp())
