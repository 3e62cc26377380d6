"""The reduced system of a half space: a convolution on the grid of the contact zone, without a matrix."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from typing import Final, final

import numpy as np

from meeframe.fields import MECHANICAL, POTENTIALS, Array, Indices
from meeframe.system.reduced import (
    BlockResponse,
    Coarsening,
    Edges,
    IndenterEdge,
    NodalFields,
    Prolongation,
    ReducedSystem,
    Stencil,
    Subsystem,
)
from meeframe_halfspace.coarsening import bilinear, box, coarse_cells, coarse_grid, numbered
from meeframe_halfspace.convolution import Convolution, Symbol
from meeframe_halfspace.edges import resolved_edges
from meeframe_halfspace.entries import entries_to_matrix
from meeframe_halfspace.extension import Pyramid
from meeframe_halfspace.grid import Grid
from meeframe_halfspace.grid_response import GridResponse
from meeframe_halfspace.inverse import wave_inverse
from meeframe_halfspace.two_grids import TwoGrids, two_grids

SMALL: Final = 0.75
"""Of the nodes: parts with more of them are not worth entries of their own."""
SIZES: Final = 2
"""Of parts whose entries are kept, up to 500 MB each at 1024 squared: that of the contact, and what it was before."""


@final
@dataclass(frozen=True, eq=False)
class HalfSpaceSystem(ReducedSystem):
    """displacement = convolution of (shares, load).

    shares: (n,) of the density around each node that belongs to the zone, 1 but on the border of a free grid;
    grid_response: to the density around one node; convolution: see convolution_of; edge_waves: series of Re Y with
    which edges are resolved between the nodes, None if they are resolved to nodes.
    """

    grid: Grid
    grid_response: GridResponse
    convolution: Convolution
    shares: Array
    edge_waves: Array | None = None
    _parts: list[tuple[GridResponse, Convolution]] = field(default_factory=list, init=False, repr=False)

    def apply(self, load: Array) -> Array:
        """compliance(load), (n, 5) for load (n, 5): fast Fourier transforms."""
        return self.response(load, range(self.n_fields))

    def response(self, load: Array, fields: Sequence[int]) -> Array:
        """compliance(load) in k fields alone, (n, k) for load (n, 5): one transform for each, and each that is loaded.

        Columns of the load may be stored one after another: it then takes the shortest time.
        """
        loaded = [field for field in range(self.n_fields) if load[:, field].any()]
        return self._response(load.T if len(loaded) == self.n_fields else load.T[loaded], loaded, fields)

    def block_response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """See ReducedSystem."""
        return self._response(load.T, loaded, fields)

    def rough_response(self) -> BlockResponse | None:
        """See ReducedSystem: what is far by a coarser grid."""
        rough = self.convolution.rough
        if rough is None:
            return None
        return lambda load, loaded, fields: self._response(load.T, loaded, fields, rough)

    def _response(
        self, load: Array, loaded: Sequence[int], fields: Sequence[int], rough: TwoGrids | None = None
    ) -> Array:
        """To the load (l, n) of l fields."""
        precision = np.result_type(load, np.float32)
        if self.convolution.periodic or self._inside:
            load = load.astype(precision, copy=False)
        else:
            load = np.multiply(load, self.shares.astype(precision, copy=False), dtype=precision, order="C")
        return self.grid.scatter((rough or self.convolution).response(self.grid.place(load), loaded, fields))

    @cached_property
    def _inside(self) -> bool:
        """Whether no node has a part of its density beside the zone."""
        return bool((self.shares == 1.0).all())

    def diagonal_blocks(self) -> Array:
        """Response of each node to its own load, (n, 5, 5), one entry after another."""
        blocks = np.zeros((self.n_fields, self.n_fields, len(self.shares)))  # much of it stays zero, and costs nothing
        for place in np.argwhere(self._own.T):
            np.multiply(self._own.T[*place], self.shares, out=blocks[*place])
        return blocks.T

    def own_response(self, fields: Sequence[int]) -> Array:
        """See ReducedSystem."""
        return np.outer(self._own[fields, fields], self.shares).T

    @cached_property
    def _own(self) -> Array:
        """Response (5, 5) of a node to the density around it."""
        own: Array = entries_to_matrix(self.grid_response.own) * self.convolution.scale
        return own

    def dense(self) -> Array | None:
        """None: see dense_matrix."""
        return None

    def edges(self, pressure: Array, rim: IndenterEdge | None = None) -> Edges | None:
        """The edge of the contact between the nodes, if that is asked for."""
        if self.edge_waves is None:
            return None
        return resolved_edges(
            self.grid, self.edge_waves, self.convolution.scale, pressure, rim, self.convolution.periodic
        )

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array]:
        """Loads (n, k) of the given k fields that roughly cause displacements (n, k) in them: wave by wave."""
        made, chosen = cache(partial(wave_inverse, self.convolution, fields)), list(fields)

        def inverse(displacement: Array) -> Array:
            waves = made()  # when entries in double precision may be there, from which it takes less time
            there = [place for place in range(len(chosen)) if displacement[:, place].any()]
            moved = displacement.T if len(there) == len(chosen) else displacement.T[there]
            placed = self.grid.place(moved.astype(np.float32, copy=False))
            answer = waves.response(placed, [chosen[place] for place in there], chosen)
            load = self.grid.scatter(answer).astype(displacement.dtype, copy=False)
            if waves.size != self.convolution.padded:
                load /= self.shares.astype(load.dtype, copy=False)[:, None]
            return load

        return inverse

    def extension(self, nodes: Indices) -> Prolongation:
        """See meeframe_halfspace.extension."""
        size, places = self.grid.flat
        pyramid = Pyramid.of(size, nodes if places is None else places[nodes])
        shares = None if self.convolution.periodic else self.shares.astype(np.float32)

        def extended(values: Array) -> Array:
            whole = pyramid.extended(values).ravel()
            return whole if places is None else whole[places]

        def gathered(whole: Array) -> Array:
            whole = whole if shares is None else whole * shares
            values = pyramid.gathered(whole.reshape(size) if places is None else whole[self.grid.nodes])
            return values if shares is None else values / shares[nodes]

        return Prolongation(extended, gathered)

    def stencil(self, reach: int, fields: Sequence[int]) -> Stencil | None:
        """Responses to the load of a node in the middle of the grid, or of the smallest part that has them all."""
        if min(self.grid.size) <= 2 * reach:
            return None
        part = self.grid_response.within((2 * reach + 1, 2 * reach + 1))
        convolution = self.convolution if part is None else convolution_of(part)
        middle, load = [n // 2 for n in convolution.size], np.zeros((1, *convolution.size), np.float32)
        load[0, *middle] = 1.0
        around = tuple(slice(place - reach, place + reach + 1) for place in middle)
        responses = np.zeros((self.n_fields, self.n_fields, 2 * reach + 1, 2 * reach + 1))
        for loaded in fields:
            responses[list(fields), loaded] = convolution.response(load, [loaded], fields)[:, *around]
        return Stencil(
            self.grid.nodes, self.convolution.periodic, np.ascontiguousarray(responses.transpose(2, 3, 0, 1))
        )

    def coarser(self) -> Coarsening | None:
        """Every second node along both axes; None if the grid is too small for that."""
        return self._coarser

    @cached_property
    def _coarser(self) -> Coarsening | None:
        grid, response = coarse_grid(self.grid), self.grid_response.coarser()
        if grid is None or response is None:
            return None
        kept = self.grid.nodes[::2, ::2].ravel()
        system = HalfSpaceSystem(
            points=self.points[kept],
            frames=self.frames[kept],
            weights=4.0 * self.weights[kept],
            cells=coarse_cells(grid),
            offset=self.offset[kept],
            grid=grid,
            grid_response=response,
            convolution=convolution_of(response),
            shares=self.shares[kept],
        )
        return Coarsening(system, kept, partial(_prolonged, self.grid, grid.size, self.convolution.periodic))

    def within(self, nodes: Indices) -> Subsystem | None:
        """On a free grid the half space on a smaller one, which depends on the nodes alone."""
        if not nodes.size:
            return None
        places = self.grid.nodes[box(self.grid, nodes)]
        size = places.shape[0], places.shape[1]
        answer = self._answer_within(size) if places.size <= SMALL * len(self.points) else None
        if answer is None:
            return None
        kept, grid = places.ravel(), numbered(self.grid, size)
        parts = self.points[kept], self.frames[kept], self.weights[kept], coarse_cells(grid), self.offset[kept]
        return Subsystem(HalfSpaceSystem(*parts, grid, *answer, self.shares[kept]), kept)

    def _answer_within(self, size: tuple[int, int]) -> tuple[GridResponse, Convolution] | None:
        """Of a part of that size, wherever it is; None if it has none. The last ones that were asked for are kept."""
        others = [answer for answer in self._parts if answer[1].size != size]
        known = [answer for answer in self._parts if answer[1].size == size]
        if not known:
            response = self.grid_response.within(size)
            if response is None:
                return None
            known = [(response, convolution_of(response))]
        self._parts[:] = [*others, *known][-SIZES:]
        return known[0]

    def recover(self, load: Array) -> NodalFields:
        """Fields on the contact zone for a load (n, 5): the half space around it has none on its surface but decays."""
        values = (self.offset + self.apply(load)) * potential_signs(self.n_fields)
        return NodalFields(self.points, self.cells, self._global(values), self._global(load))

    def _global(self, extended: Array) -> Array:
        turned = extended.copy()
        turned[:, MECHANICAL] = np.einsum("ni,nij->nj", extended[:, MECHANICAL], self.frames)
        return turned


def potential_signs(n_fields: int) -> Array:
    """Return the signs (n_fields,) of displacements and potentials in a displacement of ReducedSystem."""
    signs = np.ones(n_fields)
    signs[POTENTIALS] = -1.0
    return signs


def convolution_of(response: GridResponse) -> Convolution:
    """In SI, with the signs of ReducedSystem; its entries are made when they are needed."""
    factors = response.response.factors
    scale = np.outer(factors * potential_signs(len(factors)), factors)
    symbol = Symbol(response.symbol, response.response.numbers, response.response.parities)
    return Convolution(symbol, response.size, response.padded, scale, two_grids(response, scale))


def _prolonged(grid: Grid, size: tuple[int, int], periodic: bool, values: Array) -> Array:
    """Values (n, k) at the nodes of a grid, from (m, k) at those of the coarser one of that size."""
    coarse = values.T.reshape(-1, *size)
    return grid.scatter(bilinear(coarse, grid.size, periodic))


def dense_matrix(system: HalfSpaceSystem) -> Array:
    """The compliance of a system as (n, 5, n, 5), by as many products as a unit load has fields."""
    (nx, ny), n, n_fields = system.grid.size, system.grid.nodes.size, system.n_fields
    # a unit density in the corner of a grid that has room for all offsets
    wide = replace(system.convolution, size=system.convolution.padded)
    kernel = np.empty((n_fields, n_fields, *wide.size))
    for loaded in range(n_fields):
        load = np.zeros((1, *wide.size))
        load[0, 0, 0] = 1.0
        kernel[:, loaded] = wide.response(load, [loaded], range(n_fields))
    place = np.empty((n, 2), np.int64)
    place[system.grid.nodes.ravel()] = np.indices((nx, ny)).reshape(2, -1).T
    i, j = (place[:, None] - place).transpose(2, 0, 1)  # negative offsets count from the end
    matrix = np.empty((n, n_fields, n, n_fields))
    for row in range(n_fields):
        for column in range(n_fields):
            matrix[:, row, :, column] = kernel[row, column][i, j] * system.shares
    return matrix
