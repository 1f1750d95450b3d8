"""States of gas for tests, made without a configuration."""

from sph.formulations import gas
from sph.parts.viscosity import ALPHA, ALPHA_RATE
from sph.state import State


def gas_state(
    position, velocity, mass, internal_energy, others=None, alpha=None
) -> State:  # fmt: skip
    """Particles at the start, with nothing computed yet; alpha: one number if it evolves.

    others: what an initial state holds besides, which gas does not need.
    """
    fields = gas.FIELDS if alpha is None else (*gas.FIELDS, ALPHA, ALPHA_RATE)
    state = State.at_start(fields, position, velocity, mass, internal_energy)
    if alpha is not None:
        state.alpha[:] = alpha
    return state


def copy_of(state: State) -> State:
    """The stored fields, in arrays of their own."""
    return State(state.fields, {name: array.copy() for name, array in state.arrays().items()})
