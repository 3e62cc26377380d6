"""Surface meshes, their generators, readers and checks, and the contact zone."""

from meeframe.mesh.axes import FrictionAxes
from meeframe.mesh.checks import check_mesh, merge_points, orient_outward
from meeframe.mesh.generators import Grading, block_mesh, box_mesh, half_space_mesh, sphere_mesh
from meeframe.mesh.measures import area, volume
from meeframe.mesh.reader import read_mesh
from meeframe.mesh.recipes import MeshRecipe, block, file, half_space
from meeframe.mesh.supports import check_supports
from meeframe.mesh.zone import ContactZone, check_contact_zone, find_contact_zone, local_frames

__all__ = [
    "ContactZone",
    "FrictionAxes",
    "Grading",
    "MeshRecipe",
    "area",
    "block",
    "block_mesh",
    "box_mesh",
    "check_contact_zone",
    "check_mesh",
    "check_supports",
    "file",
    "find_contact_zone",
    "half_space",
    "half_space_mesh",
    "local_frames",
    "merge_points",
    "orient_outward",
    "read_mesh",
    "sphere_mesh",
    "volume",
]
