"""Files that a run writes: checkpoints, the history of all steps, and the run directory."""
