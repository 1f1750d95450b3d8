"""Schemes: how density and rates follow from the particles. One file each."""
