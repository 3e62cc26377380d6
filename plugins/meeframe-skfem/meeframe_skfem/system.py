"""From a matched body to its reduced system: assembly, one factorisation, condensation, recovery.

Symbols: u values (p, fields) of the volume's points, f nodal forces, K stiffness, G flexibility of the zone's nodes, M
mass matrix of its faces; all in units of the system (meeframe.formulations.dense_bem.units.Units).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce
from itertools import product
from operator import add

import numpy as np
from scipy.sparse import coo_array, csr_array, kron

from meeframe.plugin import N_FIELDS, Array, NodalFields, Progress
from meeframe.plugin.boundary_elements import NONE, Layout, Units
from meeframe.plugin.surfaces import normal_vectors
from meeframe_skfem.assembly import face_masses, gradients, mass_matrix, stiffness_matrix
from meeframe_skfem.constraints import Constraints
from meeframe_skfem.elements import face_nodes, tabulate
from meeframe_skfem.factorisation import LinearSolver, condense
from meeframe_skfem.heat import HeatAction
from meeframe_skfem.layers import LayeredMesh
from meeframe_skfem.matching import MatchedBody
from meeframe_skfem.volume import VolumeMesh


@dataclass(frozen=True, eq=False)
class FiniteElementSolution:
    """values = constant + respond(nodal forces on the zone), in units of the system.

    mesh: the volume, with p nodes; stiffnesses: scaled, (3, fields, fields, 3), of its regions; constant: (p, fields)
    values at zero load; respond: values (p, fields) of nodal forces (n, fields) on the zone; flexibility: (fields n,
    fields n) values of the zone's nodes by their forces, symmetric unless heat acts on other fields; mass: (n, n) of
    the zone's faces, for forces from fluxes; heat: action of the temperature on other fields, None if there is none.
    """

    matched: MatchedBody
    layout: Layout
    units: Units
    mesh: VolumeMesh
    stiffnesses: tuple[Array, ...]
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
        regions = self.matched.layered.regions[faces.cell]
        fluxes = np.empty((*faces.nodes.shape, values.shape[1]))
        for (local, nodes), (region, stiffness) in product(
            enumerate(face_nodes(mesh.element)), enumerate(self.stiffnesses)
        ):
            selected = np.flatnonzero((faces.local == local) & (regions == region))
            cells = mesh.cells[faces.cell[selected]]
            slopes, _ = gradients(mesh.points[cells], tabulate(mesh.element, mesh.element.nodes[nodes])[1])
            gradient = np.einsum("fanm,fnk->fakm", slopes, values[cells])
            surface = mesh.element.surface
            normals = normal_vectors(mesh.points, surface, faces.nodes[selected], surface.nodes)
            normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
            fluxes[selected] = np.einsum("fai,ijkm,fakm->faj", normals, stiffness, gradient, optimize=True)
            if self.heat is not None:
                temperature = values[faces.nodes[selected], self.heat.source]
                fluxes[selected, :, :N_FIELDS] -= self.heat.fluxes(normals, temperature, region)
        return fluxes


def solve_body(
    matched: MatchedBody,
    layout: Layout,
    units: Units,
    constraints: Constraints,
    solver: LinearSolver,
    progress: Progress,
) -> FiniteElementSolution:
    """Assemble, factorise once, solve for the prescribed data. Raises CaseError if the system is singular."""
    progress("assembly", 0.0)
    layered = matched.layered
    mesh = replace(layered.mesh, points=layered.mesh.points / units.length)
    stiffnesses = tuple(units.scaling.scale_stiffness(stiffness) for stiffness in layered.stiffnesses)
    matrix = constraints.merge(_assemble(mesh, layered, stiffnesses, units))
    n_points, n_fields, nodes = len(mesh.points), layout.value_data.shape[1], matched.nodes
    forces = np.zeros((n_points, n_fields))
    _add_forces(forces, matched, mesh, layout)
    unknown, known = constraints.unknown, np.setdiff1d(np.arange(n_points * n_fields), constraints.unknown)
    rows = matrix[unknown]
    zone = np.searchsorted(unknown, n_fields * nodes[matched.zone_points][:, None] + np.arange(n_fields)).ravel()
    progress("factorisation", 0.0)
    solve, flexibility = condense(csr_array(rows[:, unknown]), zone, solver)
    progress("factorisation", 1.0)
    rhs = constraints.merge_forces(forces)[unknown] - rows[:, known] @ constraints.values[known]
    constant = constraints.expand(solve(rhs), constraints.values).reshape(n_points, n_fields)
    heat = HeatAction.of(matched.body, mesh, layered.regions, units, constraints)
    if heat is not None:
        heat.add_response(constant, solve)
        heat.add_flexibility(flexibility, zone, solve, n_fields)

    def respond(zone_forces: Array) -> Array:
        rhs = np.zeros(len(unknown))
        rhs[zone] = zone_forces.ravel()
        response = constraints.expand(solve(rhs)).reshape(n_points, n_fields)
        if heat is not None:
            heat.add_response(response, solve)
        return response

    mass = _zone_mass(matched, units.length)
    return FiniteElementSolution(matched, layout, units, mesh, stiffnesses, constant, respond, flexibility, mass, heat)


def _assemble(mesh: VolumeMesh, layered: LayeredMesh, stiffnesses: tuple[Array, ...], units: Units) -> csr_array:
    """Return the stiffness matrix of all regions and of the springs between them, (p fields, p fields)."""
    matrices = [
        stiffness_matrix(replace(mesh, cells=mesh.cells[layered.regions == region]), stiffness)
        for region, stiffness in enumerate(stiffnesses)
    ]
    factors = units.scaling.factors
    for interface in layered.interfaces:
        if not interface.jumps.any():
            continue
        count, size = len(interface.upper), len(mesh.points)
        mass = mass_matrix(mesh.points[interface.upper], mesh.element.surface, interface.faces)
        nodes = np.concatenate([interface.upper, interface.lower])
        entries = np.repeat([1.0, -1.0], count), (np.tile(np.arange(count), 2), nodes)
        jump = csr_array(coo_array(entries, shape=(count, size)))
        springs = interface.springs * np.outer(factors, factors) * units.length
        matrices.append(csr_array(kron(jump.T @ mass @ jump, springs)))
    return reduce(add, matrices)


def _add_forces(forces: Array, matched: MatchedBody, mesh: VolumeMesh, layout: Layout) -> None:
    """Add int N_a N_b dS t_b of the prescribed fluxes to nodal forces (p, fields)."""
    faces, block = matched.faces, matched.body.mesh.blocks[0]
    data = layout.flux_data[layout.patches.connectivity[0]]
    acting = np.flatnonzero(data.any(axis=(1, 2)))
    # nodes of the cell that the face belongs to, of the two at a point of an interface
    nodes = mesh.cells[faces.cell[acting, None], face_nodes(mesh.element)[faces.local[acting]]]
    np.add.at(forces, nodes, face_masses(mesh.points, block.element, nodes) @ data[acting])


def _zone_mass(matched: MatchedBody, length: float) -> csr_array:
    """Return int N_a N_b dS over the contact zone, (n, n), lengths in a unit [m]."""
    (_, cells), block = matched.zone.cells[0], matched.body.mesh.blocks[0]
    return mass_matrix(matched.zone.points / length, block.element, cells)
