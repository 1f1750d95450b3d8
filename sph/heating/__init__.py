"""Heating and cooling: sources of internal energy other than the flow. One file each, a NamedTuple
with

    heated(internal_energy, dt)    (N,) u after dt of heating alone, from (N,) u: exact or implicit

so that however stiff a source is, it never shortens the step: a step has half of it at either end
(Strang 1968, SIAM J. Numer. Anal. 5, 506). What it adds is counted in the history and taken out of
the energy drift. Called from Python, by scenes that name a source and by no others.
"""
