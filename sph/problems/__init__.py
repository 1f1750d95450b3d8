"""Problems, one file each: its class `Problem` gives the keys, initial state and exact solution."""
