"""External fields: forces on the gas from what is not gas. One file each, a NamedTuple with

    acceleration(position)    (D, N) at positions (D, N)
    potential(position)       (N,) per unit mass, zero at infinity or wherever the file says
    misfit(boundaries)        why it cannot act in a box of these boundaries (a name for each
                              axis) and what to try; None if it can

The first two are called from Python, once a step, by scenes that name a field and by no others; the
last when a configuration is read. A mirror suits every field: no particle jumps in its potential.
"""
