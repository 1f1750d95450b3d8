"""Neighbours: order the particles into blocks, box the blocks into a tree, list candidates a block."""
