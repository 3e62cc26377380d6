"""Reduction of the collocated system: one factorisation, then relations of contact size."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg.lapack import dlange

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.formulations.dense_bem.assembly import System
from meeframe.formulations.dense_bem.elimination import all_unknowns, eliminate, inverse_norm, last_unknowns
from meeframe.formulations.dense_bem.layout import Layout, Units, boundary_fields
from meeframe.mesh.body import Body
from meeframe.mesh.surface import SurfaceMesh
from meeframe.system.reduced import NodalFields

SINGULAR: Final = 1e-14
"""Reciprocal condition number, in Frobenius norms, below which the system is singular to round-off.

A sound one of a rod 10,000 times as long as wide has 2e-13: free fields are no matter of numbers, check_supports finds
them."""


@dataclass(frozen=True, eq=False)
class BoundarySolution:
    """Unknowns for any load on the contact zone, all in units of the system.

    factors: (u, u + fields n + 1), what the elimination left of the matrix, of the columns of unit loads on the n nodes
    of the zone, whose values are the last unknowns, and of the prescribed data.
    """

    factors: Array
    layout: Layout
    units: Units
    mesh: SurfaceMesh

    def fields(self, load: Array) -> NodalFields:
        """Return the fields on the boundary for a load (n, fields) in SI units and global axes."""
        layout, units = self.layout, self.units
        loads = units.fluxes(load).ravel()
        right = self.factors[:, layout.n_unknowns : -1] @ loads + self.factors[:, -1]
        unknowns = all_unknowns(self.factors, layout.n_unknowns - loads.size, right[:, None])[:, 0]
        return boundary_fields(layout, units, self.mesh, unknowns, unknowns, loads)


def factorise(system: System) -> Array:
    """Return the factors of BoundarySolution, (u, u + fields n + 1), in the place of the system.

    Raises CaseError if the matrix is singular to working precision, or not finite.
    """
    norm = dlange("F", system.matrix)
    if not np.isfinite(norm):
        raise CaseError(
            "the boundary element system has coefficients that are not finite: "
            "elements may be degenerate, or touch others whose nodes they do not share"
        )
    inner = len(system.columns) - system.load_matrix.shape[1]
    eliminate(system.columns, inner)
    inverse = inverse_norm(system.columns, inner)
    reciprocal = 1.0 / (norm * inverse) if np.isfinite(inverse) else 0.0
    if not reciprocal > SINGULAR:
        raise CaseError(
            f"the boundary element system is singular to round-off (reciprocal condition {reciprocal:.1e}; "
            f"allowed: above {SINGULAR:g}): a very slender body, or elements that coincide"
        )
    return system.columns


def zone_relation(solution: BoundarySolution) -> tuple[Array, Array]:
    """Return offset (n, fields) and compliance (n, fields, n, fields) of values on fluxes in the contact zone, SI
    units, global axes."""
    layout, units = solution.layout, solution.units
    n, n_fields = len(layout.zone), layout.value_column.shape[1]
    values = last_unknowns(solution.factors, layout.n_unknowns - n_fields * n, solution.factors[:, layout.n_unknowns :])
    offset = units.values_si(values[:, -1].reshape(n, n_fields))
    to_values = units.values_si(np.ones(n_fields))
    to_loads = units.fluxes(np.ones(n_fields))
    matrix = values[:, :-1].reshape(n, n_fields, n, n_fields)
    compliance: Array = matrix * to_values[None, :, None, None] * to_loads
    return offset, compliance


def characteristic_length(body: Body) -> float:
    """Return the size of the contact zone, or of the body where there is none [m]: the unit of length of the system."""
    group = body.contact_group
    points = body.mesh.points if group is None else body.mesh.points[body.mesh.group_points(group)]
    return float(np.linalg.norm(np.ptp(points, axis=0)))
