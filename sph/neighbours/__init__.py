"""Neighbour search: blocks of particles, a tree of bounding boxes, and candidate lists."""

import math

# Volume of the unit ball in 1-D, 2-D and 3-D.
BALL = (2.0, math.pi, 4 / 3 * math.pi)
