"""Problems: one file each, its `Problem` the keys of [problem], the initial and the exact state."""
