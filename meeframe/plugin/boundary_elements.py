"""Building blocks of boundary elements: unknowns, collocation and adaptive quadrature, as used by dense-bem.

`lay_out` and `Units` serve any formulation that numbers the unknowns of a surface mesh. The other names are for
formulations that assemble the same integrals in another way; kernels are compiled functions for compiled callers.
"""

from meeframe.elements._kernels.quadrature import BUFFER_TOO_SMALL, element_rule, rectangular_rule, shape_degree
from meeframe.elements._kernels.quadrature_order import max_points_per_direction, order_for, required_orders
from meeframe.elements._kernels.shape import map_rule
from meeframe.elements.anisotropy import anisotropy
from meeframe.formulations.dense_bem._kernels.assembly import Accuracy
from meeframe.formulations.dense_bem.collocation import Sources, collocate
from meeframe.formulations.dense_bem.fundamental import bind_body, check_material
from meeframe.formulations.dense_bem.half_space import exterior_terms
from meeframe.formulations.dense_bem.interior import InteriorRepresentation
from meeframe.formulations.dense_bem.layout import NONE, Layout, boundary_fields, lay_out
from meeframe.formulations.dense_bem.patches import find_patches
from meeframe.formulations.dense_bem.units import Units, characteristic_length, check_expansion
from meeframe.greens import Tabulated

__all__ = [
    "BUFFER_TOO_SMALL",
    "NONE",
    "Accuracy",
    "InteriorRepresentation",
    "Layout",
    "Sources",
    "Tabulated",
    "Units",
    "anisotropy",
    "bind_body",
    "boundary_fields",
    "characteristic_length",
    "check_expansion",
    "check_material",
    "collocate",
    "element_rule",
    "exterior_terms",
    "find_patches",
    "lay_out",
    "map_rule",
    "max_points_per_direction",
    "order_for",
    "rectangular_rule",
    "required_orders",
    "shape_degree",
]
