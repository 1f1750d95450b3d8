"""Switches: how each particle's viscosity coefficient rises in shocks and decays. One file each."""
