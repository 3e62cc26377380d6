"""Interior representation: fields inside a body from the fields on its boundary.

Somigliana's identity gives values at a point x' inside, and its derivative gives gradients,

    u_K(x') = int U_JK t_J - T_JK u_J dS,
    u_K,q(x') = - int U_JK,q t_J dS - int C_iJMl U_MK,l (nu_i u_J,q - nu_q u_J,i) dS.

The second integral is that of the derivative of T, integrated by parts on the closed surface, where u is continuous. It
needs first derivatives of U alone, and tangential derivatives of u alone. A temperature theta that acts on the other
fields adds nothing to the first two integrals but its column of U and T (meeframe.greens.thermal). The derivative of
nu . k grad W theta, integrated by parts in the same way, adds with k_il W_K,il = beta_iJ U_JK,i

    - int beta_iJ U_JK,i theta nu_q dS.

Near the surface, elements are subdivided by
the adaptive rule of the assembly, for kernels 1/r^2.

References
----------
Integration by parts: Bonnet, Boundary Integral Equation Methods for Solids and Fluids (1995), chapter 13.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, final

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.elements.quadrature import gauss_table, shape_table
from meeframe.fields import N_FIELDS, THERMAL_FIELD, Array
from meeframe.formulations.dense_bem._kernels.assembly import Accuracy
from meeframe.formulations.dense_bem._kernels.interior import add_points, surface_points, view
from meeframe.formulations.dense_bem.fundamental import bind_body
from meeframe.formulations.dense_bem.units import Units
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.material.layers import LayerStack
from meeframe.mesh.body import Body
from meeframe.mesh.mortar import locate_on_plane
from meeframe.mesh.surface import SurfaceMesh
from meeframe.system.capabilities import INTERIOR_STAGE, InteriorFields, PointFields
from meeframe.system.reduced import NodalFields, Progress, silent

TOLERANCE: Final = 1e-6
"""Relative error of each element integral."""
MIN_DISTANCE: Final = 1e-4
"""Smallest distance of a point from the surface, relative to the unit of length, the diameter of the contact zone."""
_LEVI_CIVITA: Final = np.array([[np.cross(a, b) for b in np.eye(3)] for a in np.eye(3)])
_BEYOND: Final = 1e-6
"""Distance beyond the border of a plane, in heights of an element, that is round-off."""
_INSIDE: Final = 0.5
"""Solid angle, in parts of the full one, that the surface of a body subtends from inside."""
_CAPACITY: Final = 1024
"""Number of points of the surface that are evaluated together: their derivatives of U stay in a second-level cache."""


@dataclass(frozen=True, eq=False)
class InteriorRepresentation:
    """Data of the interior representation of a body.

    Attributes
    ----------
    mesh : SurfaceMesh
        Boundary of the body [m].
    stiffness : Array
        Extended stiffness (3, fields, fields, 3) in SI units.
    units : Units
        Units of the system.
    bind : callable
        Function that returns the fundamental solution for the scaled stiffness.
    anisotropy : float
        Anisotropy of the medium, see `meeframe.elements.anisotropy`.
    moduli : Array or None
        Thermal moduli (3, N_FIELDS) [SI]; None if heat acts on no other field.
    temperature : int
        Column of the temperature.
    """

    mesh: SurfaceMesh
    stiffness: Array
    units: Units
    bind: Callable[[], Kernel]
    anisotropy: float
    moduli: Array | None = None
    temperature: int = N_FIELDS

    @classmethod
    def of(
        cls, fundamental_solution: FundamentalSolution, body: Body, units: Units, spread: float
    ) -> "InteriorRepresentation":
        """Return the representation of a body.

        Parameters
        ----------
        fundamental_solution : FundamentalSolution
            Method for the coupled fields.
        body : Body
            The body.
        units : Units
            Units of the system.
        spread : float
            Anisotropy of the medium, see `meeframe.elements.anisotropy`.

        Returns
        -------
        InteriorRepresentation
            The representation.
        """
        data = body.mesh, body.stiffness, units, partial(bind_body, fundamental_solution, body), spread
        if body.thermal_moduli is None:
            return cls(*data)
        return cls(*data, body.thermal_moduli, body.fields.index(THERMAL_FIELD.name))

    def evaluate(self, boundary: NodalFields, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points inside the body from those on its boundary.

        Parameters
        ----------
        boundary : NodalFields
            Fields on the boundary, with the cells of the mesh in its order.
        points : Array
            Positions in global axes, (m, 3) [m].
        progress : callable, optional
            Function that is called with the name of the stage and the fraction of the points that is done.

        Returns
        -------
        PointFields
            The fields, in SI units and global axes.

        Raises
        ------
        CaseError
            If a point is outside the body, or closer to its surface than MIN_DISTANCE.
        """
        units, mesh = self.units, self.mesh
        values, fluxes = units.values(boundary.values), units.fluxes(boundary.fluxes)
        blocks = [
            _Block(
                shape_table(block.element),
                np.ascontiguousarray(mesh.points[block.connectivity] / units.length),
                np.ascontiguousarray(values[cells]),
                np.ascontiguousarray(fluxes[cells]),
            )
            for block, (_, cells) in zip(mesh.blocks, boundary.cells, strict=True)
        ]
        kernel, accuracy = self.bind(), Accuracy(TOLERANCE, self.anisotropy)
        coupling = _Coupling.of(units.scaling.scale_stiffness(self.stiffness))

        heat = None if self.moduli is None else units.scale_moduli(self.moduli, self.temperature)

        def fields(position: Array) -> tuple[Array, Array, float]:
            return _at_point(blocks, kernel, accuracy, coupling, position, heat, self.temperature)

        results = []
        with ThreadPoolExecutor(get_num_threads()) as pool:
            for result in pool.map(fields, points / units.length):
                results.append(result)
                progress(INTERIOR_STAGE, len(results) / len(points))
        self._check_inside(points, np.array([angle for _, _, angle in results]))
        u = units.values_si(np.array([value for value, _, _ in results]))
        slopes = np.array([gradient for _, gradient, _ in results])
        gradients = units.values_si(slopes.transpose(0, 2, 1)).transpose(0, 2, 1) / units.length
        point_fields = PointFields.of(points, u, gradients, self.stiffness)
        return point_fields if self.moduli is None else point_fields.with_heat(self.moduli, self.temperature)

    def on_plane(self, boundary: NodalFields, points: Array, normal: Array) -> PointFields:
        """Return the fields at points on a plane part of the boundary.

        Parameters
        ----------
        boundary : NodalFields
            Fields on the whole boundary.
        points : Array
            Positions in the plane, (m, 3) [m].
        normal : Array
            Outward unit normal of the plane, (3,).

        Returns
        -------
        PointFields
            The fields, in SI units and global axes.

        Raises
        ------
        CaseError
            If a point is beyond its border.
        """
        cells = []
        for block, (name, nodes) in zip(self.mesh.blocks, boundary.cells, strict=True):
            along = (self.mesh.points[block.connectivity] - points[0]) @ normal
            cells.append((name, nodes[np.abs(along).max(axis=1) <= MIN_DISTANCE * self.units.length]))
        cells = [(name, nodes) for name, nodes in cells if len(nodes)]
        located = locate_on_plane(points, boundary.points, cells, normal)
        _refuse(points, located.inside < -_BEYOND, "outside the body")
        values, fluxes = (
            np.einsum("mk,mkf->mf", located.shapes, nodal[located.nodes])
            for nodal in (boundary.values, boundary.fluxes)
        )
        gradients = np.einsum("mki,mkf->mfi", located.slopes, boundary.values[located.nodes])
        rest = fluxes - np.einsum("i,iJKl,mKl->mJ", normal, self.stiffness, gradients, optimize=True)
        if self.moduli is not None:
            rest[:, :N_FIELDS] += values[:, self.temperature, None] * (normal @ self.moduli)
        factors = self.units.scaling.factors
        matrix = np.einsum("i,iJKl,l->JK", normal, self.stiffness, normal) * np.outer(factors, factors)
        gradients += (np.linalg.solve(matrix, (rest * factors).T).T * factors)[:, :, None] * normal
        beside = points - np.einsum("mk,mki->mi", located.shapes, boundary.points[located.nodes])
        values += np.einsum("mfi,mi->mf", gradients, beside)
        fields = PointFields.of(points, values, gradients, self.stiffness)
        return fields if self.moduli is None else fields.with_heat(self.moduli, self.temperature)

    def _check_inside(self, points: Array, angles: Array) -> None:
        """Raise CaseError for points outside the body or too close to its surface; angles (m,) of `_at_point`."""
        if self.mesh.semi_infinite:
            block = self.mesh.blocks[0]
            a, b, c = self.mesh.points[block.connectivity[0, :3]]
            normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
            outside = (points - a) @ normal >= 0.0
        else:
            outside = angles < _INSIDE
        close = np.isnan(angles)
        _refuse(points, close, f"closer to the surface than {MIN_DISTANCE * self.units.length:.3g} m")
        _refuse(points, outside & ~close, "outside the body")


def _refuse(points: Array, wrong: NDArray[np.bool_], what: str) -> None:
    """Raise CaseError if any of the points (m, 3) is wrong (m,), with what they are."""
    if wrong.any():
        raise CaseError(
            f"{wrong.sum()} of {len(points)} points are {what}, the first one at {points[wrong.argmax()]} [m]; "
            "allowed: points inside the body"
        )


@final
@dataclass(frozen=True, eq=False)
class BoundaryInterior(InteriorFields):
    """Interior fields of a reduced system by the interior representation.

    Attributes
    ----------
    recovery
        Function that returns the fields on the whole boundary for a load (n, fields).
    representation
        The interior representation.
    """

    recovery: Callable[[Array], NodalFields]
    representation: InteriorRepresentation

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points (m, 3) inside the body for a load (n, fields) on the contact zone."""
        return self.representation.evaluate(self.recovery(load), points, progress)


@final
@dataclass(frozen=True, eq=False)
class LayeredInterior(InteriorFields):
    """Interior fields of a layered body by the interior representations of its regions.

    On interfaces, and closer to them than MIN_DISTANCE, fields follow from the values and fluxes on the boundary of the
    region above: with n the normal, the derivative along it solves n_i C_iJKl u_K,l = t_J. So they do on face and base.

    Attributes
    ----------
    recovery
        Function that returns the fields on the boundaries of all regions, one after the other, for a load (n, fields).
    representations
        Those of the regions from the contact zone down.
    layers
        The layers.
    origin, downward
        Point of the contact zone [m] and unit vector into the body, (3,) each.
    """

    recovery: Callable[[Array], NodalFields]
    representations: tuple[InteriorRepresentation, ...]
    layers: LayerStack
    origin: Array
    downward: Array

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points (m, 3) in the regions for a load (n, fields) on the contact zone.

        Raises
        ------
        CaseError
            If a point is outside the body, or closer to its sides than MIN_DISTANCE.
        """
        points = np.asarray(points, float)
        boundary, first, done = self.recovery(load), 0, 0
        size = len(points), boundary.values.shape[1]
        fields = PointFields(points, np.empty(size), np.empty((*size, 3)), np.empty((size[0], 3, size[1])))
        depths = (points - self.origin) @ self.downward
        numbers = np.minimum(self.layers.numbers_at(depths), len(self.representations) - 1)
        for number, region in enumerate(self.representations):
            cells = boundary.cells[first : first + len(region.mesh.blocks)]
            heights = (region.mesh.points - self.origin) @ self.downward
            on_bottom, on_top = (
                (numbers == number) & (np.abs(depths - depth) < MIN_DISTANCE * region.units.length)
                for depth in (heights.max(), heights.min())
            )
            for chosen, depth, normal in (
                (on_bottom, heights.max(), self.downward),
                (on_top & ~on_bottom, heights.min(), -self.downward),
                ((numbers == number) & ~on_bottom & ~on_top, None, None),
            ):
                if not chosen.any():
                    continue
                if depth is None or normal is None:
                    in_region = region.evaluate(replace(boundary, cells=cells), points[chosen])
                else:
                    in_region = region.on_plane(replace(boundary, cells=cells), points[chosen], normal)
                fields.values[chosen], fields.gradients[chosen], fields.fluxes[chosen] = (
                    in_region.values,
                    in_region.gradients,
                    in_region.fluxes,
                )
            first, done = first + len(cells), done + int((numbers == number).sum())
            progress(INTERIOR_STAGE, done / max(len(points), 1))
        return fields


@dataclass(frozen=True, eq=False)
class _Block:
    """Elements of one type with their shape table, nodes (e, k, 3), values and fluxes (e, k, f)."""

    table: object
    nodes: Array
    values: Array
    fluxes: Array


@dataclass(frozen=True, eq=False)
class _Coupling:
    """Matrices that turn densities of values into those of derivatives of U.

    Attributes
    ----------
    values
        (3 f, 3 f), C_iJMl as [(i, J), (M, l)].
    curls
        (3 f, 9 f), C_iJMl e_iqk as [(k, J), (M, l, q)].
    """

    values: Array
    curls: Array

    @classmethod
    def of(cls, stiffness: Array) -> "_Coupling":
        """Return those of a scaled stiffness (3, f, f, 3)."""
        size = 3 * stiffness.shape[1]
        curls = np.einsum("iJMl,iqk->kJMlq", stiffness, _LEVI_CIVITA, optimize=True)
        return cls(stiffness.reshape(size, size), np.ascontiguousarray(curls.reshape(size, 3 * size)))


def _at_point(
    blocks: list[_Block],
    kernel: Kernel,
    accuracy: Accuracy,
    coupling: _Coupling,
    position: Array,
    heat: Array | None,
    temperature: int,
) -> tuple[Array, Array, float]:
    """Return values (f,), gradients (f, 3) and the solid angle of the surface seen from a point.

    The angle is in parts of the full one; NaN for a point closer to the surface than MIN_DISTANCE.
    """
    n_fields = blocks[0].values.shape[2]
    result, angle = np.zeros((n_fields, 4)), 0.0
    for block in blocks:
        for offsets, areas, t, moments, curls in _surface_points(block, accuracy, position):
            n = len(offsets)
            distance, seen = view(offsets, areas)
            if n == 0 or distance < MIN_DISTANCE:
                return result[:, 0], result[:, 1:], np.nan
            angle += seen / (4.0 * np.pi)
            slopes = kernel.gradient(offsets).reshape(n, n_fields, n_fields, 3)
            from_values = (moments.reshape(n, -1) @ coupling.values).reshape(n, n_fields, 3)
            from_curls = (curls.reshape(n, -1) @ coupling.curls).reshape(n, n_fields, 3, 3)
            if heat is not None:
                from_curls[:, :N_FIELDS] += heat.T[:, :, None] * moments[:, None, None, :, temperature]
            added = np.zeros((n_fields, 4))
            add_points(slopes, offsets, t, from_values, from_curls, added)
            if heat is not None:  # the response to heat is not homogeneous
                normals = areas / np.linalg.norm(areas, axis=1, keepdims=True)
                kernel_u, kernel_t = kernel.evaluate(offsets, normals)
                u = np.einsum("ni,niJ->nJ", normals, moments)
                added[:, 0] = np.einsum("nJK,nJ->K", kernel_u, t) - np.einsum("nJK,nJ->K", kernel_t, u)
            result += added
    return result[:, 0], result[:, 1:], angle


def _surface_points(block: _Block, accuracy: Accuracy, position: Array) -> Iterator[tuple[Array, ...]]:
    """Yield offsets, areas, t, moments and curls of `surface_points`, few enough points at once to stay in caches.

    They are without points if the point is on an element.
    """
    n_fields, first, capacity = block.values.shape[2], 0, _CAPACITY
    buffers = _buffers(capacity, n_fields)
    while first < len(block.nodes):
        surface = block.nodes, block.values, block.fluxes, block.table
        count, last = surface_points(position, *surface, accuracy, gauss_table(), first, *buffers)
        if count == 0:
            capacity *= 2
            buffers = _buffers(capacity, n_fields)
            continue
        yield tuple(buffer[: max(count, 0)] for buffer in buffers[2:])
        first = last if count > 0 else len(block.nodes)


def _buffers(capacity: int, n_fields: int) -> tuple[Array, ...]:
    """Return the buffers of `surface_points`."""
    shapes = (2,), (), (3,), (3,), (n_fields,), (3, n_fields), (3, n_fields)
    return tuple(np.empty((capacity, *shape)) for shape in shapes)
