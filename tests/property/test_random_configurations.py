"""Any configuration at all: it is taken, or refused in words that name what is wrong."""

import copy

import numpy as np
import pytest
import tomli_w
from hypothesis import event, given
from hypothesis import strategies as st

from sph import config as configuration
from sph import registry
from sph.errors import ConfigError, FileError

PROBLEMS = registry.names("sph.problems")

numbers = st.one_of(
    st.integers(-3, 40),
    st.floats(-2.0, 2.0),
    st.sampled_from([0.0, -0.0, 1e-300, 1e300, float("inf"), float("nan"), 2**63 - 1, 10**6]),
)
WORDS = """
open mirror periodic hexagonal bcc random grad_h wendland_c4 cubic_spline converged all approach
cubic stiffened_gas number équilibre
"""
words = st.sampled_from([*WORDS.split(), ""])
scalars = st.one_of(numbers, st.booleans(), words)
values = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(
            st.sampled_from(["name", "min", "max", "density", "velocity", "pressure", "strength"]),
            inner,
            max_size=3,
        ),
    ),
    max_leaves=6,
)


def paths(table, before=()):
    """Every key of a nested table, as a path."""
    for key, value in table.items():
        yield (*before, key)
        if isinstance(value, dict):
            yield from paths(value, (*before, key))


@st.composite
def configurations(draw):
    """The defaults of a problem, with some keys gone, given anew, or unheard of."""
    name = draw(st.sampled_from(PROBLEMS))
    default = configuration.from_text(f'[problem]\nname = "{name}"\n')
    tables = copy.deepcopy(configuration._tables(default))
    tables["problem"]["n"] = draw(st.integers(2, 400))
    for _ in range(draw(st.integers(0, 4))):
        path = draw(st.sampled_from(sorted(paths(tables), key=str)))
        table = tables
        for key in path[:-1]:
            table = table[key]
        change = draw(st.sampled_from(["remove", "replace", "replace", "add"]))
        if change == "remove":
            del table[path[-1]]
        elif change == "replace":
            table[path[-1]] = draw(values)
        else:
            table[draw(st.sampled_from(["n", "colour", "gamma", "eos", "a b", ""]))] = draw(values)
    return tables


@given(tables=configurations())
def test_random_tables_read_back_equal_or_refused(tables):
    try:
        text = tomli_w.dumps(tables)
    except (TypeError, ValueError):  # what TOML has no form for
        return
    try:
        config = configuration.from_text(text, "some.toml")
    except ConfigError as error:
        event("refused")
        lines = str(error).splitlines()
        assert lines
        assert all(line.startswith("some.toml") for line in lines), error
        return
    except FileError:  # of a path that was replaced
        event("no file")
        assert tables["problem"]["name"] == "file"
        return
    event("taken")
    again = configuration.from_text(config.to_toml())
    assert again == config
    if config.problem.n > 2000:
        return
    try:
        state = config.problem.initial(config.physics.eos_model())
    except ConfigError as error:  # what only the built state can tell
        event("refused when built")
        assert "problem." in str(error)
        return
    except FileError:
        event("no file")
        assert config.problem.name == "file"
        return
    dimension, count = state.position.shape
    assert dimension == config.problem.dimension
    assert state.velocity.shape == (dimension, count)
    assert state.mass.shape == state.internal_energy.shape == (count,)
    assert np.isfinite(state.position).all()
    assert (state.mass > 0).all()


@given(text=st.text(max_size=60))
def test_any_text_accepted_or_refused_with_file_name(text):
    try:
        configuration.from_text(f'[problem]\nname = "uniform"\n{text}', "some.toml")
    except ConfigError as error:
        event("refused")
        assert str(error).startswith("some.toml")


@given(override=st.text(max_size=30), value=values)
def test_any_override_accepted_or_refused_with_source(override, value):
    config = configuration.from_text('[problem]\nname = "uniform"\n')
    for text in (override, f"problem.domain={value}", f"physics.{override}={value}"):
        try:
            config.override([text])
        except ConfigError as error:
            assert "--set" in str(error) or "configuration of the run" in str(error)


@pytest.mark.parametrize("problem", PROBLEMS)
def test_default_configuration_reads_back_equal(problem):
    config = configuration.from_text(f'[problem]\nname = "{problem}"\n')
    assert configuration.from_text(config.to_toml()) == config
