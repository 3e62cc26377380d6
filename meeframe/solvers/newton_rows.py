"""The linearised equations of Newton's method where they say more than what one unknown of their own node is."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from meeframe.core.fields import N_FIELDS, Array
from meeframe.core.mesh import Indices
from meeframe.solvers.conduction import Mask
from meeframe.solvers.krylov import Linear
from meeframe.solvers.nonsmooth import CLOSED, Blocks, Equation


@dataclass(frozen=True, eq=False)
class Rows:
    """The linearised equations on c nodes in r of their six components, by unknowns in characteristic units.

    nodes: (c,) that have coupled rows; components: the r of 0..5 that are coupled anywhere, fields: the l of them
    that are loads, asked: the f fields of the displacement that take part; coupled: (r, c) where they are;
    a: (r, r, c) of the unknowns and b: (r, f, c) of the displacement, zero in rows that are not coupled; precision: of
    vectors, which are (r c,) with zeros where nothing is coupled.
    """

    equation: Equation
    nodes: Indices
    components: list[int]
    asked: list[int]
    coupled: Mask
    a: Array
    b: Array
    precision: np.dtype[Any]

    @classmethod
    def of(cls, equation: Equation, blocks: Blocks, coupled: Mask, precision: np.dtype[Any]) -> "Rows":
        """Of the blocks of an equation; coupled: (n, 6)."""
        nodes = np.flatnonzero(coupled.any(axis=1))
        components = np.flatnonzero(coupled.any(axis=0)).tolist()
        where = np.ascontiguousarray(coupled[nodes].T[components])
        asked = np.flatnonzero(blocks.b.any(axis=(0, 1)) | coupled[:, :N_FIELDS].any(axis=0)).tolist()
        units = np.append(equation.scales.load, 1.0)[components]
        a = _entries(blocks.a, components, components, nodes) * units[:, None]
        b = _entries(blocks.b, components, asked, nodes)
        for part in (a, b):
            np.copyto(part, 0.0, where=~where[:, None])
        return cls(equation, nodes, components, asked, where, a, b, precision)

    @property
    def units(self) -> Array:
        """Of the unknowns, (r,)."""
        return np.append(self.equation.scales.load, 1.0)[self.components]

    @property
    def fields(self) -> list[int]:
        """Those of the components that are loads."""
        return [component for component in self.components if component < CLOSED]

    def chosen(self, whole: Array) -> Array:
        """The coupled ones of all rows (n, 6), (r c,)."""
        return np.where(self.coupled, whole[self.nodes].T[self.components], 0.0).ravel()

    def step(self, values: Array) -> Array:
        """Step (n, 6) by unknowns (r c,), zero off the coupled rows."""
        step = np.zeros((CLOSED + 1, len(self.equation.blocks)))
        for component, unit, part in zip(self.components, self.units, values.reshape(self.coupled.shape), strict=True):
            step[component, self.nodes] = unit * part
        return step.T

    def image(self, blocks: Blocks, step: Array) -> Array:
        """Product (r c,) of the equations with a whole step (n, 6), which need not be coupled; blocks: of them all."""
        load = step[:, :N_FIELDS].astype(self.precision, order="K", copy=False)
        moved = self.equation.problem.system.response(load, self.asked)
        own = np.einsum("cij,cj->ic", blocks.a[self.nodes][:, self.components], step[self.nodes])
        own[~self.coupled] = 0.0
        return np.asarray((own + multiplied(self.b, moved[self.nodes].T)).ravel())

    def multiplication(self) -> Linear:
        """Product (r c,) of the equations with unknowns (r c,)."""
        a, b = (NodeBlocks.of(part, self.precision) for part in (self.a, self.b))
        fields, system, n = self.fields, self.equation.problem.system, len(self.equation.blocks)
        units = self.units[: len(fields)].tolist()

        def multiply(values: Array) -> Array:
            unknowns = values.reshape(self.coupled.shape)
            load = np.zeros((len(fields), n), self.precision)
            for part, unit, unknown in zip(load, units, unknowns, strict=False):
                part[self.nodes] = unit * unknown
            moved = system.block_response(load.T, fields, self.asked).T.take(self.nodes, axis=1)
            product = np.zeros_like(unknowns)
            a.add(unknowns, product)
            b.add(moved, product)
            return product.ravel()

        return multiply

    def lifted(self, displacement: Array) -> Array:
        """What displacements (n, 5, m) of the indenter add to the right-hand side, (m, r c)."""
        moved = displacement.transpose(2, 1, 0)[:, :, self.nodes][:, self.asked]
        lifted = np.empty((len(moved), self.coupled.size))
        for row, motion in zip(lifted, moved, strict=True):
            row[:] = multiplied(self.b, motion).ravel()
        return lifted

    def combined(self, measures: Array) -> Array:
        """Measures (m, n, 5) of loads, of unknowns instead, (m, r c)."""
        of_unknowns = np.zeros((len(measures), *self.coupled.shape))
        fields = self.fields
        of_unknowns[:, : len(fields)] = measures.transpose(0, 2, 1)[:, :, self.nodes][:, fields]
        of_unknowns *= self.units[:, None] * self.coupled
        return of_unknowns.reshape(len(measures), self.coupled.size)


@dataclass(frozen=True, eq=False)
class NodeBlocks:
    """Blocks of c nodes by those entries (c,) that are not zero at all of them, with their row and column."""

    entries: list[tuple[int, int, Array]]

    @classmethod
    def of(cls, blocks: Array, precision: np.dtype[Any]) -> "NodeBlocks":
        """Of blocks (i, j, c)."""
        where = zip(*np.nonzero(blocks.any(axis=2)), strict=True)
        return cls([(int(row), int(column), blocks[row, column].astype(precision)) for row, column in where])

    def add(self, vectors: Array, to: Array) -> None:
        """Add the products with vectors (j, c) to other ones (i, c)."""
        for row, column, entry in self.entries:
            to[row] += entry * vectors[column]


def multiplied(blocks: Array, vectors: Array) -> Array:
    """Product (i, c) of the blocks (i, j, c) of c nodes with their vectors (j, c)."""
    return np.asarray(np.einsum("ijc,jc->ic", blocks, vectors))


def _entries(blocks: Array, rows: list[int], columns: list[int], nodes: Indices) -> Array:
    """Rows and columns of the blocks (n, i, j) of c nodes, (i, j, c)."""
    entries = np.empty((len(rows), len(columns), len(nodes)))
    for row, of_row in zip(rows, entries, strict=True):
        for column, entry in zip(columns, of_row, strict=True):
            np.take(blocks[:, row, column], nodes, out=entry)
    return entries
