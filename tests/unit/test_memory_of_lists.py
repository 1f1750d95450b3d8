"""Old candidate lists, the largest arrays of a run, are freed before new ones are built."""

import weakref

from sph import config
from sph.clock import Clock
from sph.neighbours import lists
from sph.scene import Scene
from sph.simulation import Simulation


def test_two_lists_never_exist_at_once(monkeypatch):
    """Both at once would raise the peak of memory by a third in 3-D."""
    text = '[problem]\nname = "shock_tube"\nn = 60\n[time]\nend = 0.1\n'
    simulation = Simulation.start(Scene(config.from_text(text, "the test")), 1, Clock())
    old, alive, build = weakref.ref(simulation.search.lists.candidates), [], lists.build

    def watched(*arguments):
        alive.append(old() is not None)
        return build(*arguments)

    monkeypatch.setattr(lists, "build", watched)
    while not alive:
        simulation.advance(0.1)
    assert alive == [False]
