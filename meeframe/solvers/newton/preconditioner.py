"""Preconditioner of Newton's equations without a matrix, from an approximate inverse of the compliance.

Coupled rows are of two kinds. Those of sticking and pressed nodes and of conductors prescribe a displacement or a
potential: the approximate inverse, restricted to these nodes, solves them. The others mainly involve loads of their own
node, as for friction that follows the pressure: the inverse of the node's own block solves them.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.common.sparse import sparse_inverse
from meeframe.contact.conduction import Mask
from meeframe.fields import N_MECHANICAL, NORMAL, TANGENTIAL, Array, Indices
from meeframe.solvers.krylov import Linear
from meeframe.solvers.newton.jacobian import ReducedJacobian
from meeframe.system.capabilities import MaterialFlow
from meeframe.system.node_blocks import NodeBlocks, NodeProducts

NEARBY_RADIUS: Final = 1.1
"""Radius, in spacings of nodes, beyond which the response to a single node is neglected.

It falls with the third power of the distance. 1.5 saves no product, 0.6 takes two more.
"""
MAX_TANGENTIAL_RATIO: Final = 3.0
"""Largest ratio of a node's load to its self-compliance at which a tangential row still prescribes a displacement.

2 took as many products in frictional contact with conduction on ten grids, 1 took 6 % more.
"""
SINGLE_ROUND_OFF: Final = 1e-6
"""Round-off of single precision, relative to other entries of a block."""


def preconditioner(jacobian: ReducedJacobian) -> Linear:
    """Return the approximate inverse of the coupled rows, (r c,) of (r c,).

    At biactive nodes pressure and gap are zero. In the preconditioner their gap is paired with the pressure, as
    everywhere in contact, and the condition of zero pressure with the contact fraction, which alone can satisfy it,
    through the response that it causes nearby. Fluxes of these nodes count as fully conducted, since they act on the
    surrounding nodes at any contact fraction.
    """
    n_fields = jacobian.equation.problem.fields.size
    if n_fields not in jacobian.components:
        solve, shape = _solution_of_loads(jacobian), jacobian.coupled.shape
        return lambda values: solve(values.reshape(shape)).ravel()
    between = np.flatnonzero(jacobian.coupled[-1])
    last, pressure = len(jacobian.components) - 1, jacobian.components.index(NORMAL)
    a, b = (blocks.swap_rows(pressure, last, between) for blocks in (jacobian.a, jacobian.b))
    coupled = jacobian.coupled.copy()
    coupled[last] = False
    for field in range(N_MECHANICAL, n_fields):
        if field in jacobian.components:
            row = jacobian.components.index(field)
            conducting, channel = between[coupled[row, between]], field - N_MECHANICAL
            compliance = jacobian.equation.self_compliance[jacobian.nodes[conducting], channel]
            share = compliance / (compliance + jacobian.equation.series[field]) / jacobian.equation.scales.drop[channel]
            a = a.with_entries(row, row, conducting, share * jacobian.series[row])
            b = b.with_entries(row, jacobian.displacement_fields.index(field), conducting, share)
    solve = _solution_of_loads(replace(jacobian, a=a, b=b, coupled=coupled))
    fraction_row = np.array([a.entry(last, column)[between] for column in range(last + 1)], jacobian.precision)
    jumps = np.zeros(coupled.shape, jacobian.precision)
    jumps[:, between] = [-a.entry(row, last)[between] for row in range(last + 1)]
    touched, responses = _responses_nearby(solve, jumps, jacobian, between)
    positions = np.arange(jumps.size).reshape(jumps.shape)[:, between]
    couplings = (responses[np.searchsorted(touched, numbers)] for numbers in positions)
    inverse = sparse_inverse(
        sum(scipy.sparse.diags_array(row) @ coupling for row, coupling in zip(fraction_row, couplings, strict=True)),
        jacobian.precision,
    )

    def precondition(values: Array) -> Array:
        right = values.reshape(jumps.shape).copy()
        right[pressure, between], right[last, between] = right[last, between], right[pressure, between]
        solution = solve(right)
        contact_fraction = inverse(right[last, between] - (fraction_row * solution[:, between]).sum(axis=0))
        solution.ravel()[touched] += responses @ contact_fraction
        solution[last, between] = contact_fraction
        return solution.ravel()

    return precondition


def _responses_nearby(solve: Linear, jumps: Array, jacobian: ReducedJacobian, nodes: Indices) -> tuple[Indices, Any]:
    """Return the unknowns that right-hand sides (r, c) of single nodes (g,) cause near these.

    The result is the numbers (t,), in order, of these unknowns among the (r c,), and their values, (t, g) sparse. Nodes
    far from each other share a solution: a few solutions suffice for any number of nodes.
    """
    system = jacobian.equation.problem.system
    points, radius = system.points[jacobian.nodes], NEARBY_RADIUS * np.sqrt(system.weights.max())
    colors = np.full(len(nodes), -1)
    for number, others in enumerate(scipy.spatial.cKDTree(points[nodes]).query_ball_point(points[nodes], 2.0 * radius)):
        colors[number] = min(set(range(len(others))) - set(colors[others].tolist()))
    nearby = jacobian.equation.tree.query_ball_point(points[nodes], radius)
    position = np.full(len(system.points), -1)
    position[jacobian.nodes] = np.arange(len(points))
    neighbours, cause = np.concatenate(nearby), np.repeat(np.arange(len(nodes)), [len(numbers) for numbers in nearby])
    neighbours, cause = position[neighbours[position[neighbours] >= 0]], cause[position[neighbours] >= 0]
    values = np.zeros((len(jumps), len(neighbours)), jumps.dtype)
    for color in range(colors.max() + 1):
        right = np.zeros_like(jumps)
        right[:, nodes[colors == color]] = jumps[:, nodes[colors == color]]
        of_color = colors[cause] == color
        values[:, of_color] = solve(right)[:, neighbours[of_color]]
    positions = np.arange(len(jumps))[:, None] * len(points) + neighbours
    touched, which = np.unique(positions, return_inverse=True)
    entries = values.ravel(), (which.ravel(), np.broadcast_to(cause, positions.shape).ravel())
    return touched, scipy.sparse.csr_array(entries, (len(touched), len(nodes)))


def _solution_of_loads(jacobian: ReducedJacobian) -> Linear:
    """Return the function that approximately solves for the unknowns (r, c) of right-hand sides (r, c).

    Rows that prescribe displacements come first, then the others, node by node; tangential rows are solved along and
    across the direction in which a node slips.
    """
    loaded, rotation, node_compliance = jacobian.equation.loaded, _Rotation.of(jacobian), _node_compliance(jacobian)
    jacobian = replace(jacobian, a=rotation.to_rotated(jacobian.a), b=rotation.to_rotated(jacobian.b))
    prescribing, friction = _displacement_rows(jacobian, node_compliance)
    inverse = _inverse_with_friction(jacobian, friction)
    if inverse is None:
        inverse, friction = jacobian.equation.inverse, np.zeros_like(friction)
    to_displacement = _prescribed_displacements(jacobian, node_compliance, prescribing, friction)
    node_inverse, by_loads, by_displacement = _node_solution(
        jacobian, node_compliance, jacobian.coupled[: len(prescribing)] & ~prescribing, prescribing
    )
    by_inverse = NodeBlocks.of(
        {(i, i): mask / jacobian.units[i] for i, mask in enumerate(prescribing)}, prescribing.shape
    )
    number = np.array([loaded.index(field) if field in loaded else -1 for field in jacobian.fields], np.intp)
    zone_displacement = np.zeros((len(loaded), len(jacobian.equation.blocks) if inverse else 0), jacobian.precision)
    nodes, precision = jacobian.nodes, jacobian.precision
    del jacobian, node_compliance, friction  # blocks take as much memory as the iteration

    def products(blocks: NodeBlocks) -> NodeProducts:
        return rotation.to_original(blocks).products(precision)

    # prescribed displacements, and unknowns by right-hand sides and by inverse: one map each, with rotation and units
    right_products = products(node_inverse.plus(by_displacement.compose(to_displacement)))
    del node_inverse, by_displacement
    displacement_products = products(to_displacement)
    del to_displacement
    inverse_products = products(by_inverse.plus(by_loads.compose(by_inverse)))
    displacement_products = replace(
        displacement_products, rows=number[displacement_products.rows], shape=(len(loaded), len(nodes))
    )
    inverse_products = replace(inverse_products, columns=number[inverse_products.columns])

    def solve(right: Array) -> Array:
        solution = np.zeros_like(right)
        right_products.add(right, solution)
        if inverse is not None:
            for of_zone, of_contact in zip(zone_displacement, displacement_products.times(right), strict=True):
                of_zone[nodes] = of_contact
            inverse_products.add(inverse(zone_displacement.T).T.take(nodes, axis=1), solution)
        return solution

    return solve


@dataclass(frozen=True, eq=False)
class _Rotation:
    """Rotation from the tangential axes of c nodes to those along and across the direction in which each slips.

    angle: its cosine and sine (c,); None if all slip along an axis.
    """

    angle: tuple[Array, Array] | None

    @classmethod
    def of(cls, jacobian: ReducedJacobian) -> "_Rotation":
        """Return the rotation to the directions in which the tangential rows A involve their loads most and least.

        The principal axes of A A^T: A is not symmetric where friction is orthotropic.
        """
        if jacobian.components[:2] != [0, 1]:
            return cls(None)
        (a, b), (c, d) = ([jacobian.a.entry(row, column) for column in (0, 1)] for row in (0, 1))
        askew = 2.0 * (a * c + b * d)
        if not askew.any():
            return cls(None)
        angle = 0.5 * np.arctan2(askew, a**2 + b**2 - c**2 - d**2) * jacobian.coupled[:2].all(axis=0)
        return cls((np.cos(angle), np.sin(angle)))

    def to_rotated(self, blocks: NodeBlocks) -> NodeBlocks:
        """Return the blocks of the nodes in the rotated axes, without the round-off that couples the two."""
        if self.angle is None:
            return blocks
        entries = dict(blocks.rotate(*self.angle).entries)
        for position in {(0, 1), (1, 0)} & entries.keys():
            least = SINGLE_ROUND_OFF * sum(np.abs(entries.get((i, i), 0.0)) for i in (0, 1))
            entries[position] = np.where(np.abs(entries[position]) > least, entries[position], 0.0)
        return NodeBlocks.of(entries, blocks.shape)

    def to_original(self, blocks: NodeBlocks) -> NodeBlocks:
        """Return the blocks in the original axes."""
        return blocks if self.angle is None else blocks.rotate(self.angle[0], -self.angle[1])


def _displacement_rows(jacobian: ReducedJacobian, self_compliance: NodeBlocks) -> tuple[Mask, Array]:
    """Return the rows (l, c) that prescribe displacements, and the resistances of friction in them, times the units.

    In these the response of a node to its load outweighs the load, or is not much smaller, where it slips: loads of
    neighbours move it as well. self_compliance: (f, l) response of displacements to the unknowns of the node.
    """
    friction = np.zeros((len(jacobian.fields), len(jacobian.nodes)))
    prescribing, flow = friction > 0.0, jacobian.equation.problem.system.capability(MaterialFlow)
    for position, field in enumerate(jacobian.fields):
        if jacobian.equation.inverse and field in jacobian.equation.loaded:
            column = jacobian.displacement_fields.index(field)
            itself, coupling = jacobian.a.entry(position, position), jacobian.b.entry(position, column)
            compliance = self_compliance.entry(column, position) + jacobian.series[position]
            threshold = np.abs(itself) / (MAX_TANGENTIAL_RATIO if field in TANGENTIAL else 1.0)
            prescribing[position] = jacobian.coupled[position] & (np.abs(coupling * compliance) > threshold)
            if flow and field in TANGENTIAL:
                np.divide(itself, coupling, out=friction[position], where=prescribing[position])
    return prescribing, np.maximum(friction, 0.0)


def _node_compliance(jacobian: ReducedJacobian) -> NodeBlocks:
    """Return the displacements (f, c) that the unknowns (l, c) of the loads cause at their own node.

    They are almost the same in all tangential directions, so that the axes do not matter. Round-off is omitted.
    """
    blocks, largest = jacobian.equation.blocks.transpose(1, 2, 0), jacobian.equation.largest_entries
    least = SINGLE_ROUND_OFF * np.sqrt(np.outer(np.diagonal(largest), np.diagonal(largest)))
    entries = {
        (row, position): jacobian.units[position] * blocks[field, loaded].take(jacobian.nodes)
        for row, field in enumerate(jacobian.displacement_fields)
        for position, loaded in enumerate(jacobian.fields)
        if largest[field, loaded] > least[field, loaded]
    }
    return NodeBlocks.of(entries, (len(jacobian.displacement_fields), len(jacobian.nodes)))


def _inverse_with_friction(jacobian: ReducedJacobian, friction: Array) -> Linear | None:
    """Return the inverse in series with friction (l, c), times the units; None if there is none."""
    equation, resistance = jacobian.equation, np.zeros(len(jacobian.equation.blocks))
    resistance[jacobian.nodes] = (friction / jacobian.units[: len(friction), None]).max(axis=0, initial=0.0)
    flow = equation.problem.system.capability(MaterialFlow) if resistance.any() else None
    return None if flow is None else flow.inverse_with_friction(equation.loaded, resistance)


def _prescribed_displacements(
    jacobian: ReducedJacobian, self_compliance: NodeBlocks, prescribing: Mask, friction: Array
) -> NodeBlocks:
    """Return the displacements (l, c), in the fields of the loads, that right-hand sides (r, c) prescribe.

    Right-hand sides are those of the rows `prescribing` (l, c). Displacements are those that loads cause at their own
    node if they satisfy its rows alone, and drops of the resistances that the inverse includes, with friction.
    """
    positions = [jacobian.displacement_fields.index(field) for field in jacobian.fields]
    causes = [self_compliance.entry(column, position) for position, column in enumerate(positions)]
    by_cause = {
        (row, position): jacobian.b.entries[row, column] * causes[position]
        for row in range(len(prescribing))
        for position, column in enumerate(positions)
        if (row, column) in jacobian.b.entries
    }
    inverses = jacobian.a.plus(NodeBlocks(by_cause, prescribing.shape)).inverses(prescribing)
    return NodeBlocks(
        {(i, j): (causes[i] + jacobian.series[i] + friction[i]) * entry for (i, j), entry in inverses.entries.items()},
        prescribing.shape,
    )


def _node_solution(
    jacobian: ReducedJacobian, response: NodeBlocks, marked: Mask, prescribing: Mask
) -> tuple[NodeBlocks, NodeBlocks, NodeBlocks]:
    """Return blocks (l, l) that give the loads of the marked rows (l, c).

    The three blocks act on the right-hand sides of these rows, on the loads of other rows, and on the prescribed
    displacements (l, c). They are inverses of the equations of single nodes, with their own response where their
    displacement is not prescribed.
    """
    equations, by_loads, by_displacement = (
        defaultdict[tuple[int, int], Array](partial(np.zeros, marked.shape[1])) for _ in range(3)
    )
    positions = {jacobian.displacement_fields.index(field): position for position, field in enumerate(jacobian.fields)}
    for row, column in np.ndindex(len(marked), len(marked)):
        if (marked[row] & marked[column]).any():
            if (row, column) in jacobian.a.entries:
                equations[row, column] += jacobian.a.entries[row, column]
            for column_field in range(len(jacobian.displacement_fields)):
                if (row, column_field) in jacobian.b.entries and (column_field, column) in response.entries:
                    product = jacobian.b.entries[row, column_field] * response.entries[column_field, column]
                    equations[row, column] += (
                        np.where(prescribing[positions[column_field]], 0.0, product)
                        if column_field in positions
                        else product
                    )
    inverses = NodeBlocks.of(equations, marked.shape).inverses(marked)
    for (row, shared), inverse in inverses.entries.items():
        for column_field, column in positions.items():
            if (shared, column) in jacobian.a.entries:
                by_loads[row, column] -= np.where(marked[column], 0.0, inverse * jacobian.a.entries[shared, column])
            if (shared, column_field) in jacobian.b.entries:
                prescribed = np.where(prescribing[column], inverse * jacobian.b.entries[shared, column_field], 0.0)
                by_displacement[row, column] -= prescribed
    return inverses, NodeBlocks.of(by_loads, marked.shape), NodeBlocks.of(by_displacement, marked.shape)
