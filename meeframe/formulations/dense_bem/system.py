"""From the collocated system to the reduced system: one factorisation, then contact-size relations."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg.blas import dgemm, dtrsm
from scipy.linalg.lapack import dgecon, dgetrf, dlange, dlaswp, dtrtrs

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
AT_ONCE: Final = 12_000
"""Unknowns up to which LAPACK eliminates in one call: that of OpenBLAS, in threads, ends the process with 22,450."""
PANEL, STRIP = 4096, 2048
"""Columns that it eliminates in one call beyond that, and that are taken along at a time."""


@dataclass(frozen=True, eq=False)
class BoundarySolution:
    """upper @ unknowns = loaded @ load + constant; load flattened (n * 5,), all in units of the system.

    factors: (u, u + 5 n + 1), of which these are the upper triangle of the first u columns, the next 5 n and the last.
    """

    factors: Array
    layout: Layout
    units: Units
    mesh: SurfaceMesh

    def fields(self, load: Array) -> NodalFields:
        """Fields on the boundary for a load (n, 5) in SI units and global axes."""
        layout, units = self.layout, self.units
        loads = units.fluxes(load).ravel()
        n = layout.n_unknowns
        unknowns, _ = dtrtrs(self.factors[:, :n], self.factors[:, n:-1] @ loads + self.factors[:, -1])
        values = _fill(layout.value_data, layout.value_column, unknowns)
        fluxes = _fill(layout.flux_data, layout.flux_column, unknowns)
        fluxes = _fill(fluxes, layout.load_column, loads)
        points = layout.patches.point
        cells = tuple(
            (block.element.meshio_type, connectivity)
            for block, connectivity in zip(self.mesh.blocks, layout.patches.connectivity, strict=True)
        )
        return NodalFields(self.mesh.points[points], cells, units.values_si(values)[points], units.fluxes_si(fluxes))


def factorise(system: System) -> Array:
    """The factors of BoundarySolution, (u, u + 5 n + 1), in the place of the system.

    The elimination of the matrix takes the other columns along: what is left of them is a back substitution, of which
    the values of the zone, numbered last, need only the last rows. Raises CaseError if the matrix is singular to
    working precision.
    """
    norm = dlange("I", system.matrix)
    factors = _eliminated(system.columns)
    reciprocal, _ = dgecon(factors[:, : len(factors)], norm, norm="I")
    if not reciprocal > SINGULAR:
        raise CaseError(
            f"the boundary element system is singular (reciprocal condition {reciprocal:.1e}): every separate part of "
            "the body needs supports and a prescribed value of each potential"
        )
    return factors


def _eliminated(columns: Array) -> Array:
    """LU factors of the first u of columns (u, w) in Fortran order, in their place, the others taken along."""
    n, width = columns.shape
    if n <= AT_ONCE:
        factors: Array = dgetrf(columns, overwrite_a=True)[0]
        return factors
    swaps = np.arange(n)
    for first in range(0, n, PANEL):
        last = min(first + PANEL, n)
        panel, rows, _ = dgetrf(columns[first:, first:last])
        swaps[first:last] = first + rows
        dlaswp(columns, swaps, k1=first, k2=last - 1, overwrite_a=True)
        columns[first:, first:last] = panel
        corner, below = (np.asfortranarray(part) for part in np.split(panel, [last - first]))
        for start in range(last, width, STRIP):
            part = slice(start, start + STRIP)
            beside = dtrsm(1.0, corner, columns[first:last, part], lower=True, diag=True)
            columns[first:last, part] = beside
            if last < n:  # by SciPy, whose threads NumPy's would disturb
                columns[last:, part] -= dgemm(1.0, below, beside)
    return columns


def zone_relation(solution: BoundarySolution) -> tuple[Array, Array]:
    """offset (n, 5) and compliance (n, 5, n, 5) of values on fluxes in the contact zone, SI units, global axes."""
    layout, units = solution.layout, solution.units
    n = len(layout.zone)
    end = layout.n_unknowns
    last = solution.factors[end - N_FIELDS * n :]
    values, _ = dtrtrs(last[:, end - N_FIELDS * n : end], last[:, end:])
    offset = units.values_si(values[:, -1].reshape(n, N_FIELDS))
    to_values = units.values_si(np.ones(N_FIELDS))
    to_loads = units.fluxes(np.ones(N_FIELDS))
    matrix = values[:, :-1].reshape(n, N_FIELDS, n, N_FIELDS)
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
