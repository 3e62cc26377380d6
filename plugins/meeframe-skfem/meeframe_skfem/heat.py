"""Action of the temperature on the other fields in finite elements: forces int N_a,i beta_iJ N_b dV of temperatures.

The temperature does not depend on the other fields, so that one factorisation of the matrix without this action serves
twice: it gives the temperature, and then the response of the other fields to its forces.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from typing import Final, final

import numpy as np
from scipy.sparse import coo_array, csr_array

from meeframe.plugin import N_FIELDS, THERMAL_FIELD, Array, Body, Indices
from meeframe.plugin.boundary_elements import Units
from meeframe_skfem.assembly import gradients
from meeframe_skfem.constraints import Constraints
from meeframe_skfem.elements import cell_rule, tabulate
from meeframe_skfem.volume import VolumeMesh

BATCH: Final = 64
"""Number of heat sources whose responses are computed at once."""


@final
@dataclass(frozen=True, eq=False)
class HeatAction:
    """Forces on the other fields due to temperatures, in units of the system.

    Attributes
    ----------
    moduli : tuple of Array
        Thermal moduli (3, N_FIELDS) of the regions, scaled.
    source : int
        Column of the temperature.
    constraints : Constraints
        Constraints of the nodes.
    forces : csr_array
        (u, p) matrix of the forces of temperatures at the points on the unknowns.
    """

    moduli: tuple[Array, ...]
    source: int
    constraints: Constraints
    forces: csr_array

    @classmethod
    def of(
        cls, body: Body, mesh: VolumeMesh, regions: Indices, units: Units, constraints: Constraints
    ) -> "HeatAction | None":
        """Return the action in a body whose cells belong to regions; None if there is none.

        mesh: its mesh in units of the system; regions: (e,), numbers of `Body.all_moduli`.
        """
        if not body.expands:
            return None
        source, n_fields = body.fields.index(THERMAL_FIELD.name), body.fields.size
        moduli = tuple(
            np.zeros((3, N_FIELDS)) if one is None else units.scale_moduli(one, source) for one in body.all_moduli
        )
        forces = [
            _forces(replace(mesh, cells=mesh.cells[regions == region]), one, n_fields)
            for region, one in enumerate(moduli)
        ]
        merged = constraints.merge_rows(reduce(add, forces))
        return cls(moduli, source, constraints, csr_array(merged[constraints.unknown]))

    def add_response(self, values: Array, solve: Callable[[Array], Array]) -> None:
        """Add the response to the temperatures of values (p, fields), in the unknowns, that `solve` returns."""
        response = solve(self.forces @ values[:, self.source])
        values += self.constraints.expand(response).reshape(values.shape)

    def add_flexibility(
        self, flexibility: Array, zone: Indices, solve: Callable[[Array], Array], n_fields: int
    ) -> None:
        """Add to a flexibility (fields n, fields n) the values of the zone's nodes due to heat there.

        zone: (fields n,) indices among the unknowns, node by node.
        """
        unknown, masters = self.constraints.unknown, self.constraints.masters
        heat = np.arange(self.source, len(zone), n_fields)
        for start in range(0, len(heat), BATCH):
            columns = heat[start : start + BATCH]
            unit = np.zeros((len(unknown), len(columns)), order="F")
            unit[zone[columns], np.arange(len(columns))] = 1.0
            values = np.zeros((len(masters), len(columns)))
            values[unknown] = solve(unit)
            forces = np.asfortranarray(self.forces @ values[masters[self.source :: n_fields]])
            flexibility[:, columns] += solve(forces)[zone]

    def fluxes(self, normals: Array, temperature: Array, region: int) -> Array:
        """Return nu_i beta_iJ theta, (..., N_FIELDS), in a region, for normals (..., 3) and temperatures (...)."""
        fluxes: Array = (normals @ self.moduli[region]) * temperature[..., None]
        return fluxes


def _forces(mesh: VolumeMesh, moduli: Array, n_fields: int) -> csr_array:
    """Return the matrix (fields p, p) of int N_a,i beta_iJ N_b dV."""
    xi, weights = cell_rule(mesh.element)
    shapes, slopes_of_shapes = tabulate(mesh.element, xi)
    slopes, jacobians = gradients(mesh.points[mesh.cells], slopes_of_shapes)
    measures = jacobians * weights
    entries = np.einsum("em,emai,ij,mb->eajb", measures, slopes, moduli, shapes, optimize=True)
    cells = mesh.cells
    rows = n_fields * cells[:, :, None, None] + np.arange(moduli.shape[1])[None, None, :, None]
    rows = np.broadcast_to(rows, entries.shape)
    columns = np.broadcast_to(cells[:, None, None, :], entries.shape)
    shape = n_fields * len(mesh.points), len(mesh.points)
    return csr_array(coo_array((entries.ravel(), (rows.ravel(), columns.ravel())), shape=shape))
