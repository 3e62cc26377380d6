"""Meshes and their generators, readers and checks; the contact zone; indenters and the gap to them."""

from meeframe.geometry.axes import FrictionAxes
from meeframe.geometry.checks import check_mesh, merge_points, orient_outward
from meeframe.geometry.generators import Grading, block_mesh, box_mesh, half_space_mesh, sphere_mesh
from meeframe.geometry.heights import Heights, SampledHeights
from meeframe.geometry.indenters import Cone, Cylinder, FlatPunch, Paraboloid, RectangularPunch, Sphere
from meeframe.geometry.measures import area, volume
from meeframe.geometry.placement import Placement, initial_gap
from meeframe.geometry.reader import read_mesh
from meeframe.geometry.rim import find_rim, longest_side
from meeframe.geometry.supports import check_supports
from meeframe.geometry.zone import ContactZone, check_contact_zone, frames_of, zone_frames

__all__ = [
    "Cone",
    "ContactZone",
    "Cylinder",
    "FlatPunch",
    "FrictionAxes",
    "Grading",
    "Heights",
    "Paraboloid",
    "Placement",
    "RectangularPunch",
    "SampledHeights",
    "Sphere",
    "area",
    "block_mesh",
    "box_mesh",
    "check_contact_zone",
    "check_mesh",
    "check_supports",
    "find_rim",
    "frames_of",
    "half_space_mesh",
    "initial_gap",
    "longest_side",
    "merge_points",
    "orient_outward",
    "read_mesh",
    "sphere_mesh",
    "volume",
    "zone_frames",
]
