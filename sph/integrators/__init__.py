"""Time integration: the leapfrog of the seed and its step."""
