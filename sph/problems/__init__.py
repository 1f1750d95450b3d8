"""Problems, one file each: a class `Problem` with keys, initial state and exact solution."""
