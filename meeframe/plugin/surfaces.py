"""Building blocks for formulations on surface meshes: meshes, elements and quadrature."""

from meeframe.elements.base import Reference, SurfaceElement, shape_derivatives, shape_functions
from meeframe.elements.lagrange import Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.quadrature import element_extents, gauss_table, shape_table
from meeframe.mesh.checks import check_mesh
from meeframe.mesh.generators import geometric_fractions
from meeframe.mesh.measures import VOLUME_ORDER, area, gauss_rule, normal_vectors
from meeframe.mesh.reader import read_any
from meeframe.mesh.slenderness import bending_warnings
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.mesh.zone import ContactZone, check_contact_zone, find_contact_zone, local_frames

__all__ = [
    "VOLUME_ORDER",
    "ContactZone",
    "ElementBlock",
    "Quad4",
    "Quad8",
    "Quad9",
    "Reference",
    "SurfaceElement",
    "SurfaceMesh",
    "Tri3",
    "Tri6",
    "area",
    "bending_warnings",
    "check_contact_zone",
    "check_mesh",
    "element_extents",
    "find_contact_zone",
    "gauss_rule",
    "gauss_table",
    "geometric_fractions",
    "local_frames",
    "normal_vectors",
    "read_any",
    "shape_derivatives",
    "shape_functions",
    "shape_table",
]
