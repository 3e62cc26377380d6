"""A plugin with a formulation: a layer on a rigid base, periodic in its plane, by fast Fourier transforms.

Waves t^ exp(i k m.x) of the surface load cause waves u^ = Y(k, m) t^ / k of the surface displacement. Waves
interpolate the load, so the reduced system multiplies each wave by its 5 x 5 block.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar, final

import numpy as np
import scipy.fft
import scipy.linalg

from meeframe.plugin import (
    N_FIELDS,
    ApproximateInverse,
    Array,
    Body,
    BoundaryCondition,
    CaseError,
    Coarsening,
    FieldScaling,
    FieldwiseApply,
    Formulation,
    Indices,
    MeshError,
    Multigrid,
    NodalFields,
    Progress,
    Record,
    ReducedSystem,
    check_conditions,
    hookimpl,
    silent,
)

C = TypeVar("C")

SIGNS: Final = np.array([1.0, 1.0, 1.0, -1.0, -1.0])
"""Signs of the potentials in a displacement of ReducedSystem."""
DEEP: Final = 40.0
"""Depths beyond so many wave lengths / (2 pi) do not move the surface."""
MIN_COARSE: Final = 16
"""Smallest number of nodes along an axis of the coarsest grid."""


def surface_symbol(stiffness: Array, thickness: float, waves: Array) -> Array:
    """Return u^ / t^ of a layer on a rigid, grounded base for wave vectors k m (w, 2), as (w, 5, 5), in SI units.

    Displacements and tractions (u, t / k) of each wave satisfy a linear differential equation in k z with a constant
    matrix A(m). It is integrated from the base to the surface in steps that preserve their quotient, which remains
    bounded.
    """
    scaling = FieldScaling.of(stiffness)
    c = scaling.scale_stiffness(stiffness)
    k = np.linalg.norm(waves, axis=1)
    m = np.column_stack([waves / k[:, None], np.zeros(len(k))])
    t_inverse = np.linalg.inv(c[2, :, :, 2])
    q, r = np.einsum("wi,ijkm,wm->wjk", m, c, m), np.einsum("wi,ijk->wjk", m, c[:, :, :, 2])
    a = np.zeros((len(k), 2 * N_FIELDS, 2 * N_FIELDS), complex)
    a[:, :N_FIELDS, :N_FIELDS] = -1j * (t_inverse @ r.transpose(0, 2, 1))
    a[:, :N_FIELDS, N_FIELDS:] = t_inverse
    a[:, N_FIELDS:, :N_FIELDS] = q - r @ t_inverse @ r.transpose(0, 2, 1)
    a[:, N_FIELDS:, N_FIELDS:] = -1j * (r @ t_inverse)
    depth = np.minimum(k * thickness, DEEP)
    count = np.ceil(depth).astype(int)
    step = scipy.linalg.expm((depth / count)[:, None, None] * a)
    y = np.zeros((len(k), N_FIELDS, N_FIELDS), complex)
    for number in range(count.max()):
        moving = count > number
        x = step[moving]
        above = x[:, :N_FIELDS, :N_FIELDS] @ y[moving] + x[:, :N_FIELDS, N_FIELDS:]
        below = x[:, N_FIELDS:, :N_FIELDS] @ y[moving] + x[:, N_FIELDS:, N_FIELDS:]
        y[moving] = above @ np.linalg.inv(below)
    symbol: Array = scaling.factors[:, None] * y * scaling.factors / k[:, None, None]
    return symbol


def grid_symbol(stiffness: Array, thickness: float, size: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the blocks (nx, ny // 2 + 1, 5, 5) by which waves of a periodic grid are multiplied."""
    kx, ky = (2.0 * np.pi * np.fft.fftfreq(n, h) for n, h in zip(size, spacing, strict=True))
    grid = np.stack(np.meshgrid(kx, np.abs(ky[: size[1] // 2 + 1]), indexing="ij"), axis=-1)
    flat = grid.reshape(-1, 2)
    blocks = np.empty((len(flat), N_FIELDS, N_FIELDS), complex)
    blocks[1:] = surface_symbol(stiffness, thickness, flat[1:])
    blocks[0] = thickness * np.linalg.inv(stiffness[2, :, :, 2])  # a uniform load
    # on a grid with an even number of nodes, the shortest wave has both directions
    for axis in range(2):
        if size[axis] % 2 == 0:
            shortest = np.isclose(np.abs(flat[:, axis]), np.pi / spacing[axis])
            reflected = flat[shortest] * (np.array([-1.0, 1.0]) if axis == 0 else np.array([1.0, -1.0]))
            blocks[shortest] = 0.5 * (blocks[shortest] + surface_symbol(stiffness, thickness, reflected))
    return SIGNS[:, None] * blocks.reshape(*grid.shape[:2], N_FIELDS, N_FIELDS)


@final
@dataclass(frozen=True, eq=False)
class LayerSystem(ReducedSystem, FieldwiseApply, ApproximateInverse, Multigrid):
    """A layer on a grid that repeats itself; nodes along the second axis first.

    Attributes
    ----------
    size
        Number of nodes along each axis.
    symbol
        (nx, ny // 2 + 1, 5, 5), see `grid_symbol`.
    """

    size: tuple[int, int]
    symbol: Array

    def capability(self, kind: type[C]) -> C | None:
        """Return the layer itself, or None where a coarser grid would be too coarse."""
        coarsest = any(n % 2 or n < 2 * MIN_COARSE for n in self.size)
        return None if kind is Multigrid and coarsest else super().capability(kind)

    def apply(self, load: Array) -> Array:
        """Return the displacement (n, 5) due to a load (n, 5)."""
        return self.apply_fields(load, range(N_FIELDS), range(N_FIELDS))

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in some fields due to a load in some fields."""
        return self._multiply(self.symbol[..., list(fields), :][..., list(loaded)], load)

    def _multiply(self, blocks: Array, values: Array) -> Array:
        waves = scipy.fft.rfft2(values.T.reshape(-1, *self.size))
        moved = scipy.fft.irfft2(np.einsum("xyij,jxy->ixy", blocks, waves), self.size)
        return moved.reshape(len(moved), -1).T.astype(values.dtype, copy=False)

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its load, (n, 5, 5), which is the same at all nodes."""
        blocks: Array = np.broadcast_to(self._response_to_first_node()[0, 0], (len(self.points), N_FIELDS, N_FIELDS))
        return blocks

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of these blocks in some fields."""
        return self.diagonal_blocks()[:, list(fields), list(fields)]

    def _response_to_first_node(self) -> Array:
        """Return the displacements (nx, ny, 5, 5) due to unit loads on the first node."""
        load = np.zeros((len(self.points), N_FIELDS, N_FIELDS))
        load[0] = np.eye(N_FIELDS)
        return np.stack([self.apply(load[..., field]).reshape(*self.size, -1) for field in range(N_FIELDS)], axis=-1)

    def dense(self) -> None:
        """Return None: there is no matrix."""
        return

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the contact zone."""
        return NodalFields(self.points, self.cells, (self.offset + self.apply(load)) * SIGNS, load)

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array]:
        """Return the inverse of each wave: exact for loads on all nodes."""
        inverse = np.linalg.inv(self.symbol[..., list(fields), :][..., list(fields)])
        return lambda displacement: self._multiply(inverse, displacement)

    def coarsen(self) -> Coarsening:
        """Return the layer on every second node along both axes."""
        nx, ny = self.size
        lattice = np.arange(nx * ny).reshape(self.size)
        nodes, coarse = lattice[::2, ::2].ravel(), (nx // 2, ny // 2)
        rows = np.r_[0 : nx // 4 + 1, nx - (nx // 2 - nx // 4) + 1 : nx]
        symbol = self.symbol[rows, : ny // 4 + 1]
        if nx // 2 % 2 == 0:  # on the coarse grid, the shortest wave has both directions
            symbol[nx // 4] = 0.5 * (symbol[nx // 4] + self.symbol[nx - nx // 4, : ny // 4 + 1])
        if ny // 2 % 2 == 0:
            symbol[:, -1] = 0.5 * (symbol[:, -1] + np.roll(symbol[::-1, -1], 1, axis=0).conj())
        system = replace(
            self,
            points=self.points[nodes],
            frames=self.frames[nodes],
            weights=4.0 * self.weights[nodes],
            cells=grid_cells(coarse),
            offset=self.offset[nodes],
            size=coarse,
            symbol=symbol,
        )
        return Coarsening(system, nodes, lambda values: self._interpolate(values.reshape(*coarse, -1)))

    def _interpolate(self, coarse: Array) -> Array:
        """Return bilinear interpolation (n, k) of values (nx / 2, ny / 2, k)."""
        fine = np.empty((*self.size, coarse.shape[2]), coarse.dtype)
        fine[::2, ::2] = coarse
        fine[1::2, ::2] = 0.5 * (coarse + np.roll(coarse, -1, axis=0))
        fine[:, 1::2] = 0.5 * (fine[:, ::2] + np.roll(fine[:, ::2], -1, axis=1))
        return fine.reshape(len(self.points), -1)


def grid_cells(size: tuple[int, int]) -> tuple[tuple[str, Indices], ...]:
    """Return the quadrilaterals between the nodes of a grid."""
    nodes = np.arange(size[0] * size[1]).reshape(size)
    corners = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    return (("quad", np.stack([corner.ravel() for corner in corners], axis=1)),)


@final
@dataclass(frozen=True)
class ElasticLayer(Formulation):
    """A layer bonded to a rigid base, periodic in its plane; the base prescribes all displacements and potentials.

    Nodes are the centres of the rectangles of the contact zone, which is one period.
    """

    def check(self, body: Body) -> None:
        """Raise CaseError or MeshError unless the body is a layer on a base with a regular, horizontal zone."""
        if body.contact_group is None:
            raise CaseError("elastic-layer: this body has no contact zone")
        check_conditions(body)
        fixed = {condition.field for condition in body.conditions if condition.kind == "value"}
        if len(body.conditions) != N_FIELDS or len(fixed) != N_FIELDS:
            raise CaseError("elastic-layer: the base prescribes all five fields, and nothing else is prescribed")
        if any(np.ptp(np.asarray(condition.data)) for condition in body.conditions):
            raise CaseError("elastic-layer: the prescribed values are uniform")
        self._grid(body)

    def is_periodic(self) -> bool:
        """Return True."""
        return True

    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Compute the symbol of the layer on the grid of its zone."""
        self.check(body)
        progress("surface symbol", 0.0)
        points, size, spacing = self._grid(body)
        thickness = float(points[0, 2] - body.mesh.points[:, 2].min())
        base = np.zeros(N_FIELDS)
        for condition in body.conditions:
            base[condition.field] = np.ravel(condition.data)[0]
        n = len(points)
        return LayerSystem(
            points=points,
            frames=np.tile(np.eye(3), (n, 1, 1)),
            weights=np.full(n, spacing[0] * spacing[1]),
            cells=grid_cells(size),
            offset=np.tile(base * SIGNS, (n, 1)),
            size=size,
            symbol=grid_symbol(body.stiffness, thickness, size, spacing),
        )

    def _grid(self, body: Body) -> tuple[Array, tuple[int, int], tuple[float, float]]:
        """Return the centres (n, 3) of the rectangles of the zone, their numbers and widths along both axes."""
        corners = body.mesh.points[body.mesh.group_points(body.contact_group or "")]
        lines = [np.unique(np.round(corners[:, axis], 12)) for axis in range(2)]
        widths = [np.diff(line) for line in lines]
        full = len(corners) == len(lines[0]) * len(lines[1])
        regular = all(np.ptp(width) < 1e-6 * width.mean() for width in widths)
        if not (full and regular and np.ptp(corners[:, 2]) < 1e-9 * widths[0][0]):
            raise MeshError("elastic-layer: the contact zone is a horizontal rectangle with equal divisions")
        x, y = (0.5 * (line[1:] + line[:-1]) for line in lines)
        grid = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((len(x), len(y)), corners[0, 2])], axis=-1)
        return grid.reshape(-1, 3), (len(x), len(y)), (float(widths[0].mean()), float(widths[1].mean()))


def uniform_load(_: ElasticLayer) -> Mapping[str, Any]:
    """Return a layer and its exact solution under a uniform load, as arguments of check_formulation."""
    from meeframe.testing import block_mesh, create, library_material
    from meeframe.testing.manufactured import LinearField

    stiffness, thickness = library_material("orthotropic-mee").stiffness, 0.01
    gradient = LinearField.random(stiffness, seed=3).gradient * [0.0, 0.0, 1.0]
    field = LinearField(stiffness, gradient, np.array([1e-5, -2e-5, 3e-5, 4.0, 5e-3]))
    base = field.values(np.array([[0.0, 0.0, -thickness]]))[0]
    conditions = tuple(BoundaryCondition("base", number, "value", float(value)) for number, value in enumerate(base))
    mesh = block_mesh(0.115, thickness, 0.03, (33, 36), 1, 1, create("element", "quad4"))
    return {"body": Body(stiffness, mesh, conditions, "contact"), "field": field, "tolerance": 1e-9, "asymmetry": 1e-9}


@hookimpl
def meeframe_formulations() -> list[Record]:
    """Register the formulation."""
    summary = "layer on a rigid base by Fourier transforms"
    return [Record("elastic-layer", ElasticLayer, summary, "notes on layers", uniform_load)]
