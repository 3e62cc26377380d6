"""Reduction of the collocated system to the contact zone, by one factorisation."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg.lapack import dlange

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.formulations.dense_bem.assembly import System
from meeframe.formulations.dense_bem.elimination import all_unknowns, eliminate, inverse_norm, last_unknowns
from meeframe.formulations.dense_bem.layout import Layout, Units, boundary_fields
from meeframe.mesh.surface import SurfaceMesh
from meeframe.system.reduced import NodalFields

MIN_RECIPROCAL_CONDITION: Final = 1e-14
"""Reciprocal condition number, in Frobenius norms, below which the system is singular to round-off.

The regular system of a rod 10,000 times as long as wide has 2e-13. Undetermined fields are found by check_supports.
"""


@dataclass(frozen=True, eq=False)
class BoundarySolution:
    """The eliminated system, which gives the unknowns for any load on the contact zone.

    Attributes
    ----------
    factors : Array
        Result of `eliminate`, (u, u + f n + 1): the matrix, the columns of unit loads on the n nodes of the zone, whose
        values are the last unknowns, and the prescribed data, all in units of the system.
    layout : Layout
        Numbers of the unknowns.
    units : Units
        Units of the system.
    mesh : SurfaceMesh
        The mesh [m].
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
    """Eliminate the unknowns of a system in place and return the factors of BoundarySolution, (u, u + f n + 1).

    Raises
    ------
    CaseError
        If the matrix is singular to working precision or not finite.
    """
    norm = dlange("F", system.matrix)
    if not np.isfinite(norm):
        raise CaseError(
            "the boundary element system has coefficients that are not finite: "
            "elements may be degenerate, or touch others without sharing their nodes"
        )
    inner = len(system.columns) - system.load_matrix.shape[1]
    eliminate(system.columns, inner)
    inverse = inverse_norm(system.columns, inner)
    reciprocal = 1.0 / (norm * inverse) if np.isfinite(inverse) else 0.0
    if not reciprocal > MIN_RECIPROCAL_CONDITION:
        raise CaseError(
            f"the boundary element system is singular to round-off (reciprocal condition {reciprocal:.1e}; "
            f"allowed: above {MIN_RECIPROCAL_CONDITION:g}): the body is very slender, or elements coincide"
        )
    return system.columns


def zone_relation(solution: BoundarySolution) -> tuple[Array, Array]:
    """Return the relation of values to fluxes in the contact zone, in SI units and global axes.

    Returns
    -------
    Array
        Values without loads on the zone, (n, fields).
    Array
        Compliance, (n, fields, n, fields).
    """
    layout, units = solution.layout, solution.units
    n, n_fields = len(layout.zone), layout.value_column.shape[1]
    values = last_unknowns(solution.factors, layout.n_unknowns - n_fields * n, solution.factors[:, layout.n_unknowns :])
    offset = units.values_si(values[:, -1].reshape(n, n_fields))
    to_values = units.values_si(np.ones(n_fields))
    to_loads = units.fluxes(np.ones(n_fields))
    matrix = values[:, :-1].reshape(n, n_fields, n, n_fields)
    compliance: Array = matrix * to_values[None, :, None, None] * to_loads
    return offset, compliance
