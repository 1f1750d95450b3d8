"""Viscosity switches, one file each: alpha of a particle rises in shocks and decays later."""
