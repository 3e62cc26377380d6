"""Rigid indenters: shapes, heights, placement and edges."""

from meeframe.indenters.border import find_indenter_edge, longest_side
from meeframe.indenters.heights import Heights, SampledHeights
from meeframe.indenters.placement import Placement, initial_gap
from meeframe.indenters.shapes import Cone, Cylinder, FlatPunch, Paraboloid, RectangularPunch, Sphere

__all__ = [
    "Cone",
    "Cylinder",
    "FlatPunch",
    "Heights",
    "Paraboloid",
    "Placement",
    "RectangularPunch",
    "SampledHeights",
    "Sphere",
    "find_indenter_edge",
    "initial_gap",
    "longest_side",
]
