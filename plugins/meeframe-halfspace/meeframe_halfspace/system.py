"""The reduced system of a half space: a convolution on the grid of the contact zone, without a matrix."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Final, TypeVar, final

import numpy as np

from meeframe.plugin import (
    MECHANICAL,
    POTENTIALS,
    ApproximateInverse,
    Array,
    Coarsening,
    EdgeCorrection,
    EdgeResolution,
    FieldwiseApply,
    GridCells,
    GridPoints,
    IndenterEdge,
    Indices,
    InteriorFields,
    LatticeStencil,
    Multigrid,
    NodalFields,
    Prolongation,
    ReducedSystem,
    Restriction,
    Stencil,
    Subsystem,
    ZoneRecovery,
)
from meeframe_halfspace.array_library import ArrayLibrary
from meeframe_halfspace.coarsening import bilinear, box, coarse_grid, row_major_grid
from meeframe_halfspace.convolution import Convolution, Symbol
from meeframe_halfspace.edges import resolved_edges
from meeframe_halfspace.grid import Grid
from meeframe_halfspace.grid_response import GridResponse
from meeframe_halfspace.inverse import wave_inverse
from meeframe_halfspace.prolongation import MultilevelProlongation

C = TypeVar("C")

MAX_SUBGRID_FRACTION: Final = 0.75
"""Largest fraction of the nodes in a subgrid; larger subgrids do not repay the time for their entries."""
MIN_FIELDWISE_NODES: Final = 2**20
"""Number of nodes from which the response to one field is computed field by field, which takes less memory."""
STORED_SUBGRIDS: Final = 2
"""Number of sizes of subgrids whose entries are stored, up to 500 MB each at 1024 x 1024: the present contact's, and
the one before."""


@final
class SubgridResponses:
    """Cache of the responses on subgrids of the sizes that were needed last.

    Parameters
    ----------
    response
        Response of the whole grid.
    library
        Library of the convolutions; None for NumPy.
    """

    def __init__(self, response: GridResponse, library: ArrayLibrary | None) -> None:
        self._response, self._library = response, library
        self._stored: dict[tuple[int, int], tuple[GridResponse, Convolution, Symbol | None]] = {}

    def response(self, size: tuple[int, int]) -> tuple[GridResponse, Convolution, Symbol | None] | None:
        """Return the response on subgrids of a size with its convolution and waves, or None if there is none."""
        response = self._stored.pop(size, None)
        if response is None:
            restricted = self._response.restrict(size)
            if restricted is None:
                return None
            response = restricted, convolution_of(restricted, self._library), waves_of(restricted)
            if len(self._stored) == STORED_SUBGRIDS:
                del self._stored[next(iter(self._stored))]
        self._stored[size] = response  # the last one is the one used last
        return response


@final
@dataclass(frozen=True, eq=False)
class HalfSpaceSystem(
    ReducedSystem,
    FieldwiseApply,
    ApproximateInverse,
    Multigrid,
    LatticeStencil,
    Restriction,
    EdgeResolution,
    ZoneRecovery,
):
    """A half space whose compliance is the convolution of shares * load with the response to one node.

    Attributes
    ----------
    grid
        The grid of the contact zone.
    grid_response
        Response of the grid to the density around one node.
    convolution
        See `convolution_of`.
    waves
        See `waves_of`.
    fractions
        See Grid.fractions.
    edge_waves
        Series of Re Y with which contact edges are resolved between the nodes; None if edges are at nodes.
    interior
        The fields inside the half space; None on coarser grids and subgrids.
    """

    grid: Grid
    grid_response: GridResponse
    convolution: Convolution
    waves: Symbol | None
    fractions: tuple[Array, Array]
    edge_waves: Array | None = None
    interior: InteriorFields | None = None

    def capability(self, kind: type[C]) -> C | None:
        """Return the system itself unless the capability is absent.

        Coarsening is absent on the coarsest grid, restriction on periodic grids, and edge resolution unless it is
        switched on. Fields inside the half space are absent on coarser grids and subgrids.
        """
        if isinstance(self.interior, kind):
            return self.interior
        absent: dict[type, bool] = {
            Multigrid: kind is Multigrid and self._coarsening is None,
            Restriction: self.convolution.periodic,
            EdgeResolution: self.edge_waves is None,
        }
        return None if absent.get(kind, False) else super().capability(kind)

    def apply(self, load: Array) -> Array:
        """Return compliance(load), (n, f) for a load (n, f), by fast Fourier transforms of the fields that are loaded.

        It is fastest if the columns of the load are stored one after another.
        """
        loaded = [field for field in range(self.n_fields) if load[:, field].any()]
        every = range(self.n_fields)
        if len(loaded) == 1 and self.grid.count >= MIN_FIELDWISE_NODES:
            return self._field_by_field(load, *loaded)
        return self._response(load.T if len(loaded) == self.n_fields else load.T[loaded], loaded, every)

    def _field_by_field(self, load: Array, loaded: int) -> Array:
        """Return the displacement (n, f) due to a load (n, f) in one field, with the spectra of one field at a time.

        Entries for the other fields are needed here alone; to make them takes about as long as a product.
        """
        displacement = np.zeros((self.n_fields, self.grid.count)).T  # columns of zeros are never written
        for number in range(self.n_fields):
            system = self if number == loaded else replace(self, convolution=self.convolution.without_entries())
            (values,) = system._response(load.T[loaded : loaded + 1], [loaded], [number]).T
            if values.any():
                displacement[:, number] = values
        return displacement

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in k fields by one transform for each of them and for each loaded field."""
        return self._response(load.T, loaded, fields)

    def _response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement (n, k) due to a load (l, n) in l fields."""
        on_grid = self.grid.to_grid(load.astype(np.result_type(load, np.float32), copy=False))
        return self.grid.scatter(self.convolution.response(self._load_inside(on_grid), loaded, fields))

    @property
    def shares(self) -> Array:
        """Fraction (n,) of the density around each node that belongs to the zone, below 1 only on its border."""
        return self.grid.scatter(np.outer(*self.fractions)[None])[:, 0]

    def _load_inside(self, on_grid: Array) -> Array:
        """Return the parts of loads (k, nx, ny) that belong to the zone, as a view if its border bears none."""
        along, across = (np.flatnonzero(fractions != 1.0) for fractions in self.fractions)
        if not on_grid[:, along].any() and not on_grid[:, :, across].any():
            return on_grid
        inside = on_grid.copy()
        self._multiply(inside)
        return inside

    def _multiply(self, on_grid: Array, power: float = 1.0) -> None:
        """Multiply values (k, nx, ny) by a power of the shares, in place."""
        for fractions, values in zip(self.fractions, (on_grid.swapaxes(1, 2), on_grid), strict=True):
            partial_cells = np.flatnonzero(fractions != 1.0)
            values[:, :, partial_cells] *= fractions[partial_cells].astype(on_grid.dtype) ** power

    @cached_property
    def _inside(self) -> bool:
        """True if the density around each node is inside the zone."""
        return all((fractions == 1.0).all() for fractions in self.fractions)

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load, (n, f, f), entry by entry, or as a view of one block."""
        if self._inside:
            return np.broadcast_to(self._block, (len(self.points), *self._block.shape))
        shares = self.shares
        blocks = np.zeros((self.n_fields, self.n_fields, len(shares)))  # most entries stay zero, and cost nothing
        for index in np.argwhere(self._block.T):
            np.multiply(self._block.T[*index], shares, out=blocks[*index])
        return blocks.T

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of `diagonal_blocks` in k fields, (n, k)."""
        return np.outer(self._block[fields, fields], self.shares).T

    @cached_property
    def _block(self) -> Array:
        """Response (f, f) of a node to the density around it."""
        layout = self.grid_response.response.layout
        block: Array = layout.matrix(self.grid_response.diagonal) * self.convolution.scale
        return block

    def dense(self) -> Array | None:
        """Return None; see `dense_matrix`."""
        return None

    def edge_correction(self, pressure: Array, indenter_edge: IndenterEdge | None = None) -> EdgeCorrection:
        """Return the correction for a contact edge between the nodes."""
        assert self.edge_waves is not None
        return resolved_edges(
            self.grid, self.edge_waves, self.convolution.scale, pressure, indenter_edge, self.convolution.periodic
        )

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array]:
        """Return the inverse of each wave, in single precision."""
        return self.series_inverse(fields, np.zeros(len(fields)))

    def series_inverse(self, fields: Sequence[int], resistances: Array) -> Callable[[Array], Array]:
        """Return the inverse of each wave with resistances (k,) in series, in single precision."""
        made, chosen = cache(partial(wave_inverse, self.convolution, fields, self.waves, resistances)), list(fields)

        def inverse(displacement: Array) -> Array:
            # made at the first call: entries in double precision, from which it takes less time, may exist by then
            waves = made()
            nonzero = [column for column in range(len(chosen)) if displacement[:, column].any()]
            values = displacement.T if len(nonzero) == len(chosen) else displacement.T[nonzero]
            on_grid = self.grid.to_grid(values.astype(np.float32, copy=False))
            answer = waves.response(on_grid, [chosen[column] for column in nonzero], chosen)
            if waves.size != self.convolution.padded:
                self._multiply(answer, -1.0)
            return self.grid.scatter(answer).astype(displacement.dtype, copy=False)

        return inverse

    def prolongation(self, nodes: Indices) -> Prolongation:
        """Return a prolongation whose values decay beyond the nodes."""
        size, positions = self.grid.flat
        levels = MultilevelProlongation.of(size, nodes if positions is None else positions[nodes])
        shares = None if self._inside else self.shares[nodes].astype(np.float32)

        def prolong(values: Array) -> Array:
            prolonged = levels.prolong(values).ravel()
            return prolonged if positions is None else prolonged[positions]

        def restrict(values: Array) -> Array:
            if shares is not None:
                values = self.grid.scatter(self._load_inside(self.grid.to_grid(values[None])))[:, 0]
            restricted = levels.restrict(values.reshape(size) if positions is None else values[self.grid.nodes])
            return restricted if shares is None else restricted / shares

        return Prolongation(prolong, restrict)

    def stencil(self, radius: int) -> Stencil | None:
        """Return responses to the load of a node in the middle of the grid, or of the smallest sufficient part."""
        if min(self.grid.size) <= 2 * radius:
            return None
        smallest = self.grid_response.restrict((2 * radius + 1, 2 * radius + 1))
        convolution = self.convolution if smallest is None else convolution_of(smallest)
        middle = [n // 2 for n in convolution.size]
        around = tuple(slice(place - radius, place + radius + 1) for place in middle)
        load, fields = np.zeros((1, *convolution.size), np.float32), range(self.n_fields)
        load[0, *middle] = 1.0
        columns = [convolution.response(load, [loaded], fields)[:, *around] for loaded in fields]
        return Stencil(self.grid.nodes, self.convolution.periodic, np.array(columns, float).transpose(2, 3, 1, 0))

    def coarsen(self) -> Coarsening:
        """Return the system on every second node along both axes."""
        assert self._coarsening is not None
        return self._coarsening

    @cached_property
    def _coarsening(self) -> Coarsening | None:
        grid, response = coarse_grid(self.grid), self.grid_response.coarsen()
        if grid is None or response is None:
            return None
        nodes = self.grid.nodes[::2, ::2].ravel()
        uniform = self.convolution.periodic
        system = HalfSpaceSystem(
            points=self._points_at(nodes, slice(None, None, 2), slice(None, None, 2)),
            frames=self._frames(nodes.size),
            weights=np.broadcast_to(4.0 * self.weights[0], nodes.size) if uniform else 4.0 * self.weights[nodes],
            cells=GridCells(grid.size),
            offset=self._no_offset(nodes.size),
            grid=grid,
            grid_response=response,
            convolution=convolution_of(response, self.convolution.library),
            waves=waves_of(response),
            fractions=(self.fractions[0][::2], self.fractions[1][::2]),
        )
        return Coarsening(system, nodes, partial(_prolong, self.grid, grid.size, self.convolution.periodic))

    def restrict(self, nodes: Indices) -> Subsystem | None:
        """Return the half space on a smaller free grid, which depends on the nodes alone."""
        if not nodes.size:
            return None
        rows, columns = box(self.grid, nodes)
        subgrid = self.grid.nodes[rows, columns]
        size = subgrid.shape[0], subgrid.shape[1]
        response = self._subgrids.response(size) if subgrid.size <= MAX_SUBGRID_FRACTION * len(self.points) else None
        if response is None:
            return None
        inner, grid = subgrid.ravel(), row_major_grid(self.grid, size)
        frames, offset = self._frames(inner.size), self._no_offset(inner.size)
        arrays = self._points_at(inner, rows, columns), frames, self.weights[inner], GridCells(grid.size), offset
        fractions = self.fractions[0][rows], self.fractions[1][columns]
        return Subsystem(HalfSpaceSystem(*arrays, grid, *response, fractions), inner)

    def _points_at(self, nodes: Indices, rows: slice, columns: slice) -> Array:
        """Return the points of nodes (m,), which are those in some rows and columns of the grid."""
        points = self.points
        return points.on(rows, columns) if isinstance(points, GridPoints) else points[nodes]

    def _frames(self, count: int) -> Array:
        """Return the frames (count, 3, 3) of that many nodes, as a view of one."""
        return np.broadcast_to(self.grid.frame, (count, 3, 3))

    def _no_offset(self, count: int) -> Array:
        """Return the offset (count, fields) of that many nodes, which is zero, as a view of one number."""
        return np.broadcast_to(0.0, (count, self.n_fields))

    @cached_property
    def _subgrids(self) -> "SubgridResponses":
        return SubgridResponses(self.grid_response, self.convolution.library)

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the contact zone for a load (n, f); outside the zone the surface bears no load."""
        values = (self.offset + self.apply(load)) * potential_signs(self.n_fields)
        return NodalFields(self.points, self.cells, self._global(values), self._global(load))

    def _global(self, extended: Array) -> Array:
        result = extended.copy()
        result[:, MECHANICAL] = extended[:, MECHANICAL] @ self.grid.frame
        return result


def potential_signs(n_fields: int) -> Array:
    """Return the signs (n_fields,) of displacements and potentials in a displacement of ReducedSystem."""
    signs = np.ones(n_fields)
    signs[POTENTIALS] = -1.0
    return signs


def convolution_of(response: GridResponse, library: ArrayLibrary | None = None) -> Convolution:
    """Return the convolution in SI units with the signs of ReducedSystem; its entries are computed on demand.

    library: see Convolution.
    """
    factors = response.response.factors
    scale = np.outer(factors * potential_signs(len(factors)), factors)
    symbol = _symbol_of(response)
    return Convolution(symbol, response.size, response.padded, scale, response.response.layout.source, library)


def waves_of(response: GridResponse) -> Symbol | None:
    """Return the symbol of which the approximate inverse is made unless it is that of the convolution."""
    source = response.wave_response()
    return None if source is None else _symbol_of(source)


def _symbol_of(response: GridResponse) -> Symbol:
    """Return the symbol of a response, whose entries are computed on demand."""
    return Symbol(response.symbol, response.series.numbers, response.series.parities)


def _prolong(grid: Grid, size: tuple[int, int], periodic: bool, values: Array) -> Array:
    """Return values (n, k) at the nodes of a grid from values (m, k) on the coarser grid of a size."""
    coarse = values.T.reshape(-1, *size)
    return grid.scatter(bilinear(coarse, grid.size, periodic))


def dense_matrix(system: HalfSpaceSystem) -> Array:
    """Return the compliance of a system, (n, f, n, f), by one product for each field of a unit load."""
    (nx, ny), n, n_fields = system.grid.size, system.grid.count, system.n_fields
    # a unit density in the corner of a grid that has room for all offsets
    wide = replace(system.convolution, size=system.convolution.padded)
    kernel = np.empty((n_fields, n_fields, *wide.size))
    for loaded in range(n_fields):
        load = np.zeros((1, *wide.size))
        load[0, 0, 0] = 1.0
        kernel[:, loaded] = wide.response(load, [loaded], range(n_fields))
    position = np.empty((n, 2), np.int64)
    position[system.grid.nodes.ravel()] = np.indices((nx, ny)).reshape(2, -1).T
    i, j = (position[:, None] - position).transpose(2, 0, 1)  # negative offsets count from the end
    matrix = np.empty((n, n_fields, n, n_fields))
    for row in range(n_fields):
        for column in range(n_fields):
            matrix[:, row, :, column] = kernel[row, column][i, j] * system.shares
    return matrix
