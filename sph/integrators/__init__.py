"""Time integration: the leapfrog and its time step."""
