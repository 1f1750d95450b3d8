"""Exact solutions to compare with: one file each, functions of NumPy arrays in code units."""
