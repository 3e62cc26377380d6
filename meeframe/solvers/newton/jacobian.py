"""Linearised equations of Newton's method, restricted to the rows that involve more than their own unknown."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from meeframe.common.memory import stack_columns
from meeframe.contact.conduction import Mask
from meeframe.fields import Array, Indices
from meeframe.solvers.krylov import Linear
from meeframe.solvers.newton.residual import FRACTION, ContactResidual, Linearization
from meeframe.system.capabilities import apply_fields, apply_load
from meeframe.system.node_blocks import NodeBlocks, NodeProducts


@dataclass(frozen=True, eq=False)
class ReducedJacobian:
    """Linearised equations on c nodes in r of their components, with unknowns in characteristic units.

    Vectors are (r c,), with zeros where nothing is coupled.

    Attributes
    ----------
    equation : ContactResidual
        Equation of n nodes.
    nodes : Indices
        (c,), nodes that have coupled rows.
    components : list of int
        The r components that are coupled anywhere; those that are loads are `fields`.
    displacement_fields : list of int
        The f fields of the displacement that take part.
    coupled : Mask
        (r, c), coupled rows.
    a, b : NodeBlocks
        Blocks (r, r) of the unknowns and (r, f) of the displacement, zero in rows that are not coupled.
    precision : dtype
        Precision of vectors.
    """

    equation: ContactResidual
    nodes: Indices
    components: list[int]
    displacement_fields: list[int]
    coupled: Mask
    a: NodeBlocks
    b: NodeBlocks
    precision: np.dtype[Any]

    @classmethod
    def of(
        cls, equation: ContactResidual, blocks: Linearization, coupled: Mask, precision: np.dtype[Any]
    ) -> "ReducedJacobian":
        """Return the coupled rows of the blocks of an equation; coupled: (n, fields + 1)."""
        nodes = np.flatnonzero(coupled.any(axis=1))
        components = np.flatnonzero(coupled.any(axis=0)).tolist()
        selected = coupled.T.take(nodes, axis=1)[components]
        uses_displacement = {field for _, field in blocks.b.entries}
        displacement_fields = sorted(
            uses_displacement | {component for component in components if component < equation.problem.fields.size}
        )
        a = _entries(blocks.a, components, components, nodes, selected)
        b = _entries(blocks.b, components, displacement_fields, nodes, selected)
        units = equation.load_units[components].tolist()
        for (_, column), entry in a.items():
            entry *= units[column]
        of_unknowns, of_displacement = (NodeBlocks.of(entries, selected.shape) for entries in (a, b))
        return cls(equation, nodes, components, displacement_fields, selected, of_unknowns, of_displacement, precision)

    @property
    def units(self) -> Array:
        """Characteristic units of the unknowns, (r,)."""
        return self.equation.load_units[self.components]

    @property
    def series(self) -> Array:
        """Resistances that the inverse includes, times the units, by the row of the load."""
        return np.asarray(self.equation.series[self.fields] * self.units[: len(self.fields)])

    @property
    def fields(self) -> list[int]:
        """Components that are loads."""
        return [component for component in self.components if component < self.equation.problem.fields.size]

    def select(self, rows: Array) -> Array:
        """Return the coupled rows (r c,) of all rows (n, fields + 1)."""
        return np.where(self.coupled, rows.T.take(self.nodes, axis=1)[self.components], 0.0).ravel()

    def expansion(self, prescribed: Array) -> Linear:
        """Return the function that gives the step (n, fields + 1) of unknowns (r c,), without holding the blocks.

        prescribed: (n, fields + 1), values in the other rows, zero in the coupled ones.
        """
        nodes, rows, shape = self.nodes, list(zip(self.components, self.units, strict=True)), self.coupled.shape

        def expand(values: Array) -> Array:
            step = stack_columns(prescribed.T, prescribed.shape)  # a copy
            for (component, unit), block in zip(rows, values.reshape(shape), strict=True):
                step[nodes, component] += unit * block
            return step

        return expand

    def image(self, blocks: Linearization, prescribed: Array) -> Array:
        """Return the product (r c,) of the equations with a step (n, fields + 1) that is zero in the coupled rows.

        blocks: of all rows.
        """
        if not self.nodes.size:  # all is open
            return np.zeros(0, self.precision)
        image = np.zeros(self.coupled.shape, self.precision)
        load = prescribed[:, :FRACTION].astype(self.precision, order="F")
        response = apply_load(self.equation.problem.system, load, self.displacement_fields)
        self.of_displacement.add(response.T.take(self.nodes, axis=1), image)
        local = prescribed.T.take(self.nodes, axis=1)
        for (row, column), entry in blocks.a.entries.items():
            if row in self.components:
                position = self.components.index(row)
                image[position] += np.where(self.coupled[position], entry.take(self.nodes) * local[column], 0.0)
        return image.ravel()

    def multiplication(self) -> Linear:
        """Return the function that multiplies the equations by unknowns (r c,), giving (r c,); it holds no blocks."""
        a, b, nodes, displaced = self.of_unknowns, self.of_displacement, self.nodes, self.displacement_fields
        fields, system, n = self.fields, self.equation.problem.system, len(self.equation.blocks)
        units = self.units[: len(fields)].astype(self.precision)
        load = np.zeros((len(fields), n), self.precision)

        def multiply(values: Array) -> Array:
            unknowns = values.reshape(a.shape)
            for field_load, unit, unknown in zip(load, units, unknowns, strict=False):
                field_load[nodes] = unit * unknown
            product = a.times(unknowns)
            displacement = apply_fields(system, load.T, fields, displaced)
            b.add(displacement.T.take(nodes, axis=1), product)
            return product.ravel()

        return multiply

    @cached_property
    def of_unknowns(self) -> NodeProducts:
        """Contribution of unknowns (r, c) to the rows (r, c) of their own node."""
        return self.a.products(self.precision)

    @cached_property
    def of_displacement(self) -> NodeProducts:
        """Contribution of displacements (f, c) to the rows (r, c)."""
        return self.b.products(self.precision)

    def motion_columns(self) -> Array:
        """Return the contribution (m, r c) of characteristic free motions of the indenter to the right-hand side."""
        resultants, products = self.equation.problem.prescribed_resultants, self.of_displacement
        motion_columns = np.zeros((len(resultants), *self.coupled.shape), self.precision)
        for column, unit, resultant in zip(motion_columns, self.equation.units, resultants, strict=True):
            motions = {
                index: (unit * resultant.mode[self.nodes, field]).astype(self.precision)
                for index, field in enumerate(self.displacement_fields)
                if field in resultant.mode_fields
            }
            for row, index, entry in zip(products.rows, products.columns, products.entries, strict=True):
                if index in motions:
                    column[row] += entry * motions[index]
        return motion_columns.reshape(len(resultants), self.coupled.size)

    def measures(self) -> list[dict[int, Array]]:
        """Return the measures of the resultants, by characteristic totals, as measures of the unknowns.

        Each is a dictionary of its nonzero parts (c,) by the row of unknowns.
        """
        totals, rows = self.equation.scales.totals, list(zip(self.fields, self.units, self.coupled, strict=False))
        return [
            {
                row: float(unit) * (resultant.measure_of(field, self.nodes) / total).astype(self.precision) * coupled
                for row, (field, unit, coupled) in enumerate(rows)
                if field in resultant.density_fields
            }
            for total, resultant in zip(totals, self.equation.problem.prescribed_resultants, strict=True)
        ]


def _entries(
    blocks: NodeBlocks, rows: list[int], columns: list[int], nodes: Indices, coupled: Mask
) -> dict[tuple[int, int], Array]:
    """Return some rows and columns of the blocks of all nodes at c of them, zero where not coupled (r, c)."""
    entries = dict[tuple[int, int], Array]()
    for (row, column), entry in blocks.entries.items():
        if row in rows and column in columns:
            position = rows.index(row), columns.index(column)
            entries[position] = np.where(coupled[position[0]], entry.take(nodes), 0.0)
    return entries
