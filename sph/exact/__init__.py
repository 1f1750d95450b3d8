"""Exact and reference solutions, one file each: functions of NumPy arrays in code units."""
