"""Fields inside a body from the shape functions of its finite elements."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from meeframe.plugin import (
    INTERIOR_STAGE,
    MECHANICAL,
    THERMAL_FIELD,
    Array,
    CaseError,
    Indices,
    InteriorFields,
    PointFields,
    Progress,
    silent,
)
from meeframe_skfem.elements import VolumeElement, tabulate
from meeframe_skfem.system import FiniteElementSolution
from meeframe_skfem.volume import VolumeMesh

MAX_ITERATIONS: Final = 30
MAX_CHANGE: Final = 1e-13
"""Change of reference coordinates at which the iteration ends."""
MAX_COORDINATE: Final = 3.0
"""Bound of reference coordinates during the iteration."""
OUTSIDE: Final = 1e-6
"""Reference coordinate by which a point may be outside of an element, for round-off of points on its faces."""
_MARGIN: Final = 0.1
"""Margin of the bounding boxes of elements, in their sizes, since curved sides bulge beyond their nodes."""
_BATCH: Final = 10_000_000
"""Points times elements of one batch."""


@final
@dataclass(frozen=True, eq=False)
class FiniteElementInterior(InteriorFields):
    """Values and gradients of the shape functions in the element that contains a point.

    Gradients jump between elements; on a common side, those of one element are returned. So do fluxes along interfaces
    between layers, and values where interfaces are not bonded.

    Attributes
    ----------
    solution
        The factorised system.
    """

    solution: FiniteElementSolution

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points (m, 3) in the body, its surface included, for a load (n, fields).

        Raises
        ------
        CaseError
            If a point is outside the body.
        """
        matched, mesh = self.solution.matched, self.solution.matched.volume
        points = np.asarray(points, float)
        progress(INTERIOR_STAGE, 0.0)
        cells, xi = locate(mesh, points)
        outside = np.flatnonzero(cells < 0)
        if outside.size:
            raise CaseError(
                f"{outside.size} of {len(points)} points are outside the body, the first one at {points[outside[0]]} "
                "[m]; allowed: points in its finite elements"
            )
        tractions = load.copy()
        tractions[:, MECHANICAL] = np.einsum("nai,na->ni", matched.zone.frames, load[:, MECHANICAL])
        layered = matched.layered
        nodal = self.solution.values(tractions)[layered.mesh.cells[cells]]
        shapes, slopes = tabulate(mesh.element, xi)
        maps = np.einsum("mnk,mnx->mkx", slopes, mesh.points[mesh.cells[cells]])
        derivatives = np.einsum("mxk,mnk->mnx", np.linalg.inv(maps), slopes)
        values = np.einsum("mn,mnj->mj", shapes, nodal)
        gradients = np.einsum("mnx,mnj->mjx", derivatives, nodal)
        fluxes = np.empty_like(gradients.transpose(0, 2, 1))
        for region, stiffness in enumerate(layered.stiffnesses):
            members = layered.regions[cells] == region
            fields = PointFields.of(points[members], values[members], gradients[members], stiffness)
            moduli = matched.body.all_moduli[region]
            if moduli is not None:
                fields = fields.with_heat(moduli, matched.body.fields.index(THERMAL_FIELD.name))
            fluxes[members] = fields.fluxes
        progress(INTERIOR_STAGE, 1.0)
        return PointFields(points, values, gradients, fluxes)


def locate(mesh: VolumeMesh, points: Array) -> tuple[Indices, Array]:
    """Return the cell that contains each point, and the reference coordinates there.

    Parameters
    ----------
    mesh : VolumeMesh
        The volume mesh.
    points : Array
        Positions, (m, 3), in the unit of the mesh.

    Returns
    -------
    Indices
        Cells, (m,), -1 for a point outside of all of them.
    Array
        Reference coordinates, (m, 3).
    """
    corners = mesh.points[mesh.cells]
    low, high = corners.min(axis=1), corners.max(axis=1)
    margin = _MARGIN * (high - low).max(axis=1, keepdims=True)
    cells, coordinates = np.full(len(points), -1), np.zeros((len(points), 3))
    excess = np.full(len(points), OUTSIDE)
    step = max(1, _BATCH // len(corners))
    for start in range(0, len(points), step):
        batch = points[start : start + step, None]
        point, cell = np.nonzero(((batch >= low - margin) & (batch <= high + margin)).all(axis=-1))
        point += start
        xi = _reference_coordinates(mesh.element, corners[cell], points[point])
        distances = _distance_outside(mesh.element, xi)
        # of all candidates the one that contains the point best comes first
        order = np.lexsort((distances, point))
        first = order[np.unique(point[order], return_index=True)[1]]
        inside = first[distances[first] <= excess[point[first]]]
        cells[point[inside]], coordinates[point[inside]] = cell[inside], xi[inside]
    return cells, coordinates


def _reference_coordinates(element: VolumeElement, nodes: Array, points: Array) -> Array:
    """Return reference coordinates (m, 3) of points (m, 3) in elements with nodes (m, n, 3) by Newton's method."""
    xi = np.tile(element.nodes.mean(axis=0), (len(points), 1))
    for _ in range(MAX_ITERATIONS):
        shapes, slopes = tabulate(element, xi)
        residual = points - np.einsum("mn,mnx->mx", shapes, nodes)
        maps = np.einsum("mnk,mnx->mxk", slopes, nodes)
        change = np.linalg.solve(maps, residual[..., None])[..., 0]
        updated = np.clip(xi + change, -MAX_COORDINATE, MAX_COORDINATE)
        largest, xi = np.abs(updated - xi).max(initial=0.0), updated
        if largest < MAX_CHANGE:
            break
    return xi


def _distance_outside(element: VolumeElement, xi: Array) -> Array:
    """Return by how much reference coordinates (m, 3) are outside the reference domain, (m,); <= 0 inside."""
    beyond = np.maximum(-xi.min(axis=1), 0.0)
    upper = xi.max(axis=1) if element.surface.reference == "quadrilateral" else xi.sum(axis=1)
    distance: Array = np.maximum(beyond, upper - 1.0)
    return distance
