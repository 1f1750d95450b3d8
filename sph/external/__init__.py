"""External fields: forces on the gas from what is not gas. One file each, a NamedTuple with

    acceleration(position)    (D, N) at positions (D, N)
    potential(position)       (N,) per unit mass, zero at infinity or wherever the file says

Both are called from Python, once a step, by scenes that name a field and by no others.
"""
