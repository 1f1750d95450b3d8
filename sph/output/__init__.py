"""What a run leaves on disk: checkpoints, the history of every step, the run directory."""
