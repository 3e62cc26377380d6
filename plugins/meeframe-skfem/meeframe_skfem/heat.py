"""Action of the temperature on the other fields in finite elements: forces int N_a,i beta_iJ N_b dV of temperatures.

The temperature does not depend on the other fields, so that one factorisation of the matrix without this action serves
twice: it gives the temperature, and then the response of the other fields to its forces.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.sparse import coo_array, csr_array

from meeframe.plugin import THERMAL_FIELD, Array, Body, Indices
from meeframe.plugin.boundary_elements import Units
from meeframe_skfem.assembly import gradients
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
    moduli : Array
        Thermal moduli (3, N_FIELDS), scaled.
    source : int
        Column of the temperature.
    forces : csr_array
        (fields p, p) matrix of the forces of temperatures at the points.
    """

    moduli: Array
    source: int
    forces: csr_array

    @classmethod
    def of(cls, body: Body, mesh: VolumeMesh, units: Units) -> "HeatAction | None":
        """Return the action in a body, on its mesh in units of the system; None if there is none."""
        moduli = units.thermal_moduli(body)
        if moduli is None:
            return None
        source = body.fields.index(THERMAL_FIELD.name)
        return cls(moduli, source, _forces(mesh, moduli, body.fields.size))

    def add_response(self, values: Array, unknown: Indices, solve: Callable[[Array], Array]) -> None:
        """Add the response to the temperatures of values (p, fields), in the unknowns, that `solve` returns."""
        values.flat[unknown] += solve((self.forces @ values[:, self.source])[unknown])

    def add_flexibility(
        self, flexibility: Array, unknown: Indices, zone: Indices, solve: Callable[[Array], Array], n_fields: int
    ) -> None:
        """Add to a flexibility (fields n, fields n) the values of the zone's nodes due to heat there.

        zone: (fields n,) indices among the unknowns, node by node.
        """
        n_points = self.forces.shape[1]
        heat = np.arange(self.source, len(zone), n_fields)
        for start in range(0, len(heat), BATCH):
            columns = heat[start : start + BATCH]
            unit = np.zeros((len(unknown), len(columns)), order="F")
            unit[zone[columns], np.arange(len(columns))] = 1.0
            values = np.zeros((n_fields * n_points, len(columns)))
            values[unknown] = solve(unit)
            temperature = values[self.source :: n_fields]
            forces = np.asfortranarray((self.forces @ temperature)[unknown])
            flexibility[:, columns] += solve(forces)[zone]

    def fluxes(self, normals: Array, temperature: Array) -> Array:
        """Return nu_i beta_iJ theta, (..., N_FIELDS), for normals (..., 3) and temperatures (...)."""
        fluxes: Array = (normals @ self.moduli) * temperature[..., None]
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
