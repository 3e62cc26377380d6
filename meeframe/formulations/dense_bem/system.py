"""Reduction of the collocated system to the contact zone, by one factorisation."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import ELECTRIC, Array, Indices
from meeframe.formulations.dense_bem.assembly import System
from meeframe.formulations.dense_bem.blas import subtract_product
from meeframe.formulations.dense_bem.elimination import all_unknowns, eliminate, inverse_norm, last_unknowns
from meeframe.formulations.dense_bem.layout import Layout
from meeframe.formulations.dense_bem.units import Units
from meeframe.mesh.surface import SurfaceMesh

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
        Result of `eliminate`, (u, u + n_loads + 1): the matrix of all unknowns but those of an independent field, the
        columns of unit loads on the n nodes of the zone, whose values are among the last unknowns, and the prescribed
        data, all in units of the system.
    independent : Array
        Unknowns of the independent field of the layout, (i, n + 1), for unit fluxes of that field on the nodes of the
        zone, and for the prescribed data; (0, n + 1) if there is no such field.
    layout : Layout
        Numbers of the unknowns.
    units : Units
        Units of the system.
    mesh : SurfaceMesh
        The mesh [m].
    """

    factors: Array
    independent: Array
    layout: Layout
    units: Units
    mesh: SurfaceMesh

    @property
    def n_inner(self) -> int:
        """Number of unknowns among those of `factors` before the last ones."""
        return _inner(self.layout)

    def unknowns(self, loads: Array) -> Array:
        """Return all unknowns (u,) for loads (n_loads,), in units of the system."""
        n = len(self.factors)
        right = self.factors[:, n:-1] @ loads + self.factors[:, -1]
        unknowns = all_unknowns(self.factors, self.n_inner, right[:, None])[:, 0]
        if self.layout.independent is None:
            return unknowns
        first = self.independent[:, :-1] @ loads[_independent_loads(self.layout)[:-1]] + self.independent[:, -1]
        return np.concatenate([first, unknowns])


def factorise(system: System, layout: Layout) -> tuple[Array, Array]:
    """Eliminate the unknowns of a system in place and return `factors` and `independent` of BoundarySolution.

    The independent field, such as a temperature, is solved for first. Its unknowns then are known data of the others.

    Raises
    ------
    CaseError
        If a matrix is singular to working precision or not finite.
    """
    independent = _solve_independent(system.equations, layout)
    n_first = len(independent)
    factors = system.equations[n_first:, n_first:]
    eliminate_regular(factors, _inner(layout))
    return factors, independent


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
    n, n_fields = len(layout.zone), layout.n_fields
    values = zone_values(solution).reshape(n, n_fields, -1)
    offset = units.values_si(values[:, :, -1])
    to_values = units.values_si(np.ones(n_fields))
    to_loads = units.fluxes(np.ones(n_fields))
    matrix = values[:, :, :-1].reshape(n, n_fields, n, n_fields)
    compliance: Array = matrix * to_values[None, :, None, None] * to_loads
    return offset, compliance


def zone_values(solution: BoundarySolution) -> Array:
    """Return the values of the zone for unit loads and for the prescribed data, (f n, n_loads + 1), in system units.

    The charge of a floating electrode on the zone follows them in one more row.
    """
    layout, factors = solution.layout, solution.factors
    columns = np.append(layout.value_column[layout.zone].ravel(), layout.n_unknowns - 1)
    if not layout.joints.floats_above:
        columns = columns[:-1]
    values = np.zeros((len(columns), layout.n_loads + 1))
    values[: layout.n_fields * len(layout.zone), -1] = layout.value_data[layout.zone].ravel()
    last = last_unknowns(factors, solution.n_inner, factors[:, len(factors) :])
    for first, unknowns, right in (
        (layout.n_unknowns - len(last), last, np.arange(layout.n_loads + 1)),
        (0, solution.independent, _independent_loads(layout)),
    ):
        known = (columns >= first) & (columns < first + len(unknowns))
        values[np.ix_(known, right)] = unknowns[columns[known] - first]
    if layout.joints.floats_above:  # its potential is the last load
        values[ELECTRIC : -1 : layout.n_fields, -2] = 1.0
    return values


def _inner(layout: Layout) -> int:
    """Return the number of unknowns, without those of an independent field, before the last ones."""
    return layout.n_unknowns - layout.n_independent - layout.n_last


def _independent_loads(layout: Layout) -> Indices:
    """Return the columns of the fluxes of the independent field among those of loads and prescribed data, (n + 1,)."""
    loads = layout.n_fields * np.arange(len(layout.zone)) + (layout.independent or 0)
    return np.append(loads, layout.n_loads)


def _solve_independent(columns: Array, layout: Layout) -> Array:
    """Return the unknowns of the independent field, and subtract their action from the right-hand sides of the others.

    columns: (u, u + n_loads + 1), see System.
    """
    count = layout.n_independent
    right = len(columns) + _independent_loads(layout)
    if count == 0:
        return np.empty((0, len(right)))
    block = np.asfortranarray(columns[:count, np.append(np.arange(count), right)])
    eliminate_regular(block, 0)
    unknowns = last_unknowns(block, 0, block[:, count:])
    others = np.asfortranarray(columns[count:, right])
    subtract_product(others, columns[count:, :count], unknowns)
    columns[count:, right] = others
    return unknowns


def eliminate_regular(columns: Array, inner: int) -> None:
    """Eliminate the unknowns of a system, the first `inner` of them first, and check that it is not singular."""
    matrix = columns[:, : len(columns)]
    norm = float(np.sqrt(np.einsum("ij,ij->", matrix, matrix)))  # without a copy
    if not np.isfinite(norm):
        raise CaseError(
            "the boundary element system has coefficients that are not finite: "
            "elements may be degenerate, or touch others without sharing their nodes"
        )
    eliminate(columns, inner)
    inverse = inverse_norm(columns, inner)
    reciprocal = 1.0 / (norm * inverse) if np.isfinite(inverse) else 0.0
    if not reciprocal > MIN_RECIPROCAL_CONDITION:
        raise CaseError(
            f"the boundary element system is singular to round-off (reciprocal condition {reciprocal:.1e}; "
            f"allowed: above {MIN_RECIPROCAL_CONDITION:g}): the body is very slender, or elements coincide"
        )
