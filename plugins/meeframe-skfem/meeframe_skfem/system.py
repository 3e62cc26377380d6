"""From a matched body to its reduced system: assembly, one factorisation, condensation, recovery.

Symbols: u values (p, fields) of the volume's points, f nodal forces, K stiffness, G flexibility of the zone's nodes, M
mass matrix of its faces; all in units of the system (meeframe.formulations.dense_bem.layout.Units).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array, csr_array

from meeframe.plugin import N_FIELDS, Array, NodalFields, Progress
from meeframe.plugin.boundary_elements import NONE, Layout, Units
from meeframe.plugin.surfaces import normal_vectors
from meeframe_skfem.assembly import face_masses, gradients, stiffness_matrix
from meeframe_skfem.elements import face_nodes, tabulate
from meeframe_skfem.factorisation import LinearSolver, condense
from meeframe_skfem.heat import HeatAction
from meeframe_skfem.matching import MatchedBody
from meeframe_skfem.volume import VolumeMesh


@dataclass(frozen=True, eq=False)
class FiniteElementSolution:
    """values = constant + respond(nodal forces on the zone), in units of the system.

    mesh: the volume; stiffness: scaled, (3, fields, fields, 3); constant: (p, fields) values at zero load; respond:
    values (p, fields) of nodal forces (n, fields) on the zone; flexibility: (fields n, fields n) values of the zone's
    nodes by their forces, symmetric unless heat acts on other fields; mass: (n, n) of the zone's faces, forces from
    fluxes; heat: action of the temperature on other fields, None if there is none.
    """

    matched: MatchedBody
    layout: Layout
    units: Units
    mesh: VolumeMesh
    stiffness: Array
    constant: Array
    respond: Callable[[Array], Array]
    flexibility: Array
    mass: csr_array
    heat: HeatAction | None = None

    def zone_relation(self) -> tuple[Array, Array]:
        """Return offset (n, fields) and compliance (n, fields, n, fields) of values on fluxes in the zone.

        SI units, global axes.
        """
        n, n_fields = len(self.matched.zone_points), self.constant.shape[1]
        by_field = self.flexibility.reshape(n_fields * n, n, n_fields).transpose(0, 2, 1).reshape(-1, n)
        loads = np.asarray(by_field @ self.mass).reshape(n, n_fields, n_fields, n).transpose(0, 1, 3, 2)
        to_values, to_loads = self.units.values_si(np.ones(n_fields)), self.units.fluxes(np.ones(n_fields))
        compliance: Array = to_values[:, None, None] * loads * to_loads
        offset = self.constant[self.matched.nodes[self.matched.zone_points]]
        return self.units.values_si(offset), compliance

    def values(self, load: Array) -> Array:
        """Return values (p, fields) at the points for loads (n, fields) on the zone, both in SI and global axes."""
        return self.units.values_si(self._values(load))

    def fields(self, load: Array) -> NodalFields:
        """Return the fields on the boundary for loads (n, fields) on the zone [SI, global axes].

        Fluxes are the prescribed ones; where values are prescribed, they follow from the gradients in the cells beneath
        as means over the faces of a patch.
        """
        layout, surface = self.layout, self.matched.body.mesh
        values = self._values(load)
        patches = layout.patches
        fluxes = np.where(layout.flux_column == NONE, layout.flux_data, self._patch_fluxes(values))
        loaded = (layout.load_column != NONE).all(axis=1)
        zone_index = np.full(len(surface.points), NONE)
        zone_index[self.matched.zone_points] = np.arange(len(load))
        fluxes[loaded] = self.units.fluxes(load)[zone_index[patches.point[loaded]]]
        return NodalFields(
            surface.points[patches.point],
            ((surface.blocks[0].element.meshio_type, patches.connectivity[0]),),
            self.units.values_si(values[self.matched.nodes[patches.point]]),
            self.units.fluxes_si(fluxes),
        )

    def _values(self, load: Array) -> Array:
        return self.constant + self.respond(self.mass @ self.units.fluxes(load))

    def _patch_fluxes(self, values: Array) -> Array:
        """Return the fluxes (m, fields) of the gradients at the patches."""
        connectivity = self.layout.patches.connectivity[0].ravel()
        total = np.zeros((len(self.layout.patches.point), values.shape[1]))
        np.add.at(total, connectivity, self._face_fluxes(values).reshape(-1, values.shape[1]))
        means: Array = total / np.bincount(connectivity)[:, None]
        return means

    def _face_fluxes(self, values: Array) -> Array:
        """Return n_i C_iJKm u_K,m at the nodes of each boundary face, (f, k, fields)."""
        mesh, faces = self.mesh, self.matched.faces
        fluxes = np.empty((*faces.nodes.shape, values.shape[1]))
        for local, nodes in enumerate(face_nodes(mesh.element)):
            selected = np.flatnonzero(faces.local == local)
            cells = mesh.cells[faces.cell[selected]]
            slopes, _ = gradients(mesh.points[cells], tabulate(mesh.element, mesh.element.nodes[nodes])[1])
            gradient = np.einsum("fanm,fnk->fakm", slopes, values[cells])
            surface = mesh.element.surface
            normals = normal_vectors(mesh.points, surface, faces.nodes[selected], surface.nodes)
            normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
            fluxes[selected] = np.einsum("fai,ijkm,fakm->faj", normals, self.stiffness, gradient, optimize=True)
            if self.heat is not None:
                temperature = values[faces.nodes[selected], self.heat.source]
                fluxes[selected, :, :N_FIELDS] -= self.heat.fluxes(normals, temperature)
        return fluxes


def solve_body(
    matched: MatchedBody, layout: Layout, units: Units, solver: LinearSolver, progress: Progress
) -> FiniteElementSolution:
    """Assemble, factorise once, solve for the prescribed data. Raises CaseError if the system is singular."""
    progress("assembly", 0.0)
    mesh = replace(matched.volume, points=matched.volume.points / units.length)
    stiffness = units.scaling.scale_stiffness(matched.body.stiffness)
    matrix = stiffness_matrix(mesh, stiffness)
    n_points, n_fields, nodes = len(mesh.points), stiffness.shape[1], matched.nodes
    values, free = np.zeros((n_points, n_fields)), np.ones((n_points, n_fields), bool)
    values[nodes], free[nodes] = layout.value_data, layout.value_column != NONE
    forces = np.zeros((n_points, n_fields))
    _add_forces(forces, matched, mesh, layout)
    unknown, known = np.flatnonzero(free), np.flatnonzero(~free)
    rows = matrix[unknown]
    zone = np.searchsorted(unknown, n_fields * nodes[matched.zone_points][:, None] + np.arange(n_fields)).ravel()
    progress("factorisation", 0.0)
    solve, flexibility = condense(csr_array(rows[:, unknown]), zone, solver)
    progress("factorisation", 1.0)
    values.flat[unknown] = solve(forces.ravel()[unknown] - rows[:, known] @ values.ravel()[known])
    heat = HeatAction.of(matched.body, mesh, units)
    if heat is not None:
        heat.add_response(values, unknown, solve)
        heat.add_flexibility(flexibility, unknown, zone, solve, n_fields)

    def respond(zone_forces: Array) -> Array:
        rhs, response = np.zeros(len(unknown)), np.zeros((n_points, n_fields))
        rhs[zone] = zone_forces.ravel()
        response.flat[unknown] = solve(rhs)
        if heat is not None:
            heat.add_response(response, unknown, solve)
        return response

    mass = _zone_mass(matched, units.length)
    return FiniteElementSolution(matched, layout, units, mesh, stiffness, values, respond, flexibility, mass, heat)


def _add_forces(forces: Array, matched: MatchedBody, mesh: VolumeMesh, layout: Layout) -> None:
    """Add int N_a N_b dS t_b of the prescribed fluxes to nodal forces (p, fields)."""
    block = matched.body.mesh.blocks[0]
    data = layout.flux_data[layout.patches.connectivity[0]]
    acting = np.flatnonzero(data.any(axis=(1, 2)))
    masses = face_masses(mesh.points, block.element, matched.faces.nodes[acting])
    np.add.at(forces, matched.faces.nodes[acting], masses @ data[acting])


def _zone_mass(matched: MatchedBody, length: float) -> csr_array:
    """Return int N_a N_b dS over the contact zone, (n, n), lengths in a unit [m]."""
    (_, cells), block = matched.zone.cells[0], matched.body.mesh.blocks[0]
    masses = face_masses(matched.zone.points / length, block.element, cells)
    n = len(matched.zone.points)
    rows, columns = np.repeat(cells, cells.shape[1], axis=1).ravel(), np.tile(cells, cells.shape[1]).ravel()
    return csr_array(coo_array((masses.ravel(), (rows, columns)), shape=(n, n)))
