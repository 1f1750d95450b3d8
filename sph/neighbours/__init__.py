"""Neighbours: particles in blocks, a tree of their boxes, and each block's list of candidates."""

import math

# Volume of the ball of radius 1 in one, two and three dimensions.
BALL = (2.0, math.pi, 4 / 3 * math.pi)
