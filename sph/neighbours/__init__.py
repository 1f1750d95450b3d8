"""Neighbours: particles in blocks, a tree of their boxes, and each block's list of candidates."""
