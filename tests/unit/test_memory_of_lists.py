"""Old candidate lists are freed before new ones are built."""

import weakref

from sph import config
from sph.clock import Clock
from sph.neighbours import lists
from sph.scene import Scene
from sph.simulation import Simulation


def test_two_lists_never_exist_at_once(monkeypatch):
    text = '[problem]\nname = "shock_tube"\nn = 60\n[time]\nend = 0.1\n'
    simulation = Simulation.start(Scene(config.from_text(text, "the test")), 1, Clock())
    old, alive, build = weakref.ref(simulation.search.lists.entries), [], lists.Builder.all

    def watched(*arguments):
        alive.append(old() is not None)
        return build(*arguments)

    monkeypatch.setattr(lists.Builder, "all", watched)
    while not alive:
        simulation.advance(0.1)
    assert alive == [False]
