"""From the collocated system to the reduced system: one factorisation, then contact-size relations."""

import warnings
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import LinAlgWarning, lu_factor, lu_solve
from scipy.linalg.lapack import dgecon, dlange

from meeframe.core.body import Body
from meeframe.core.errors import CaseError
from meeframe.core.fields import N_FIELDS, Array
from meeframe.core.formulation import NodalFields
from meeframe.core.mesh import Indices, SurfaceMesh
from meeframe.formulations.dense_bem.assembly import System
from meeframe.formulations.dense_bem.layout import NONE, Layout, Units

SINGULAR: Final = 1e-11
"""Reciprocal condition number below which the system counts as singular.

A free part leaves 1e-13, the round-off of its constant fields; a block a thousand times larger than its zone 1e-7."""


@dataclass(frozen=True, eq=False)
class BoundarySolution:
    """unknowns = constant + response @ load; load flattened (n * 5,), all in units of the system.

    constant: (u,); response: (u, 5 n).
    """

    constant: Array
    response: Array
    layout: Layout
    units: Units
    mesh: SurfaceMesh

    def fields(self, load: Array) -> NodalFields:
        """Fields on the boundary for a load (n, 5) in SI units and global axes."""
        layout, units = self.layout, self.units
        loads = units.fluxes(load).ravel()
        unknowns = self.constant + self.response @ loads
        values = _fill(layout.value_data, layout.value_column, unknowns)
        fluxes = _fill(layout.flux_data, layout.flux_column, unknowns)
        fluxes = _fill(fluxes, layout.load_column, loads)
        points = layout.patches.point
        cells = tuple(
            (block.element.meshio_type, connectivity)
            for block, connectivity in zip(self.mesh.blocks, layout.patches.connectivity, strict=True)
        )
        return NodalFields(self.mesh.points[points], cells, units.values_si(values)[points], units.fluxes_si(fluxes))


def factorise(system: System) -> tuple[Array, Array]:
    """constant (u,) and response (u, 5 n) of the unknowns to the loads. Overwrites the matrices of the system.

    Raises CaseError if the matrix is singular to working precision.
    """
    # the C-ordered matrix is handed over as its Fortran-ordered transpose: no copy is made
    matrix = system.matrix.T
    norm = dlange("1", matrix)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LinAlgWarning)  # an exactly singular factor is judged below
        factors = lu_factor(matrix, overwrite_a=True, check_finite=False)
    reciprocal, _ = dgecon(factors[0], norm, norm="1")
    if not reciprocal > SINGULAR:
        raise CaseError(
            f"the boundary element system is singular (reciprocal condition {reciprocal:.1e}): every separate part of "
            "the body needs supports and a prescribed value of each potential"
        )
    constant: Array = lu_solve(factors, system.rhs, trans=1, check_finite=False)
    response: Array = lu_solve(factors, system.load_matrix, trans=1, overwrite_b=True, check_finite=False)
    return constant, response


def zone_relation(solution: BoundarySolution) -> tuple[Array, Array]:
    """offset (n, 5) and compliance (n, 5, n, 5) of values on fluxes in the contact zone, SI units, global axes."""
    layout, units = solution.layout, solution.units
    columns = layout.value_column[layout.zone]
    n = len(columns)
    offset = units.values_si(solution.constant[columns])
    to_values = units.values_si(np.ones(N_FIELDS))
    to_loads = units.fluxes(np.ones(N_FIELDS))
    matrix = solution.response[columns.ravel()].reshape(n, N_FIELDS, n, N_FIELDS)
    compliance: Array = matrix * to_values[None, :, None, None] * to_loads
    return offset, compliance


def characteristic_length(body: Body) -> float:
    """Size of the contact zone, or of the body where there is none [m]: the unit of length of the system."""
    group = body.contact_group
    points = body.mesh.points if group is None else body.mesh.points[body.mesh.group_points(group)]
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _fill(data: Array, columns: Indices, unknowns: Array) -> Array:
    filled = data.copy()
    mask = columns != NONE
    filled[mask] = unknowns[columns[mask]]
    return filled
