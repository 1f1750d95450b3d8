"""The picture that says most about a state."""

from matplotlib.figure import Figure

from sph.analysis.figures import maps, profiles
from sph.analysis.figures.sources import State


def main_picture(state: State) -> Figure:
    """Profiles beside the exact solution where there is one, else a map."""
    return profiles.single(state) if shows_profiles(state) else maps.single(state)


def shows_profiles(state: State) -> bool:
    """Whether profiles say more about a state than a map."""
    return state.dimension == 1 or (state.may_have_exact and state.problem.profiled)
