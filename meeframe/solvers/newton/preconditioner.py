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

from meeframe.contact.conduction import Mask
from meeframe.fields import N_MECHANICAL, Array, Indices
from meeframe.solvers.cg.normal_modes import NORMAL
from meeframe.solvers.krylov import Linear
from meeframe.solvers.newton.jacobian import TANGENTIAL, ReducedJacobian
from meeframe.solvers.newton.node_blocks import NodeBlocks
from meeframe.system.capabilities import ApproximateInverse, Prolongation

NEARBY: Final = 1.1
"""Radius, in spacings of nodes, beyond which the response to a single node is neglected.

It falls with the third power of the distance. 1.5 saves no product, 0.6 takes two more.
"""
MAX_TANGENTIAL_RATIO: Final = 3.0
"""Largest ratio of the own load to the own response at which a tangential row still prescribes a displacement.

2 took as many products in frictional contact with conduction on ten grids, 1 took 6 % more.
"""
ROUND_OFF: Final = 1e-6
"""Round-off of single precision, relative to other entries of a block."""


def preconditioner(rows: ReducedJacobian) -> Linear:
    """Return the approximate inverse of the coupled rows, (r c,) of (r c,).

    At nodes between open and closed pressure and gap are zero. In the preconditioner their gap is paired with the
    pressure, as everywhere in contact, and the condition of zero pressure with the contact fraction, which alone can
    satisfy it, through the response that it causes nearby. Fluxes of these nodes count as fully conducted, since they
    act on the nodes around whatever part of them is.
    """
    n_fields = rows.equation.problem.fields.size
    if n_fields not in rows.components:
        solve = _solution_of_loads(rows)
        return lambda values: solve(values.reshape(rows.coupled.shape)).ravel()
    between = np.flatnonzero(rows.coupled[-1])
    last, pressure = len(rows.components) - 1, rows.components.index(NORMAL)
    a, b = (part.exchanged(pressure, last, between) for part in (rows.a, rows.b))
    coupled = rows.coupled.copy()
    coupled[last] = False
    for field in range(N_MECHANICAL, n_fields):
        if field in rows.components:
            row = rows.components.index(field)
            conducting = between[coupled[row, between]]
            a = a.changed(row, row, conducting, 0.0)
            b = b.changed(row, rows.asked.index(field), conducting, 1.0 / rows.equation.scales.displacement[field])
    solve = _solution_of_loads(replace(rows, a=a, b=b, coupled=coupled))
    fading = np.array([a.entry(last, column)[between] for column in range(last + 1)], rows.precision)
    jumps = np.zeros(coupled.shape, rows.precision)
    jumps[:, between] = [-a.entry(row, last)[between] for row in range(last + 1)]
    touched, responses = _responses_nearby(solve, jumps, rows, between)
    places = np.arange(jumps.size).reshape(jumps.shape)[:, between]
    among = responses[np.searchsorted(touched, places.ravel())].toarray().reshape(*places.shape, len(between))
    matrix = np.einsum("jg,jgk->gk", fading, among)
    inverse = np.linalg.pinv(matrix, rcond=len(matrix) * float(np.finfo(matrix.dtype).eps))

    def precondition(values: Array) -> Array:
        rest = values.reshape(rows.coupled.shape).copy()
        rest[pressure, between], rest[last, between] = rest[last, between], rest[pressure, between]
        found = solve(rest)
        contact_fraction = inverse @ (rest[last, between] - (fading * found[:, between]).sum(axis=0))
        found.ravel()[touched] += responses @ contact_fraction
        found[last, between] = contact_fraction
        return found.ravel()

    return precondition


def _responses_nearby(solve: Linear, jumps: Array, rows: ReducedJacobian, nodes: Indices) -> tuple[Indices, Any]:
    """Return the unknowns that right-hand sides (r, c) of single nodes (g,) cause near these.

    The result is the numbers (t,), in order, of these unknowns among the (r c,), and their values, (t, g) sparse. Nodes
    far from each other share a solution: a few solutions suffice for any number of nodes.
    """
    system = rows.equation.problem.system
    points, reach = system.points[rows.nodes], NEARBY * np.sqrt(system.weights.max())
    group = np.full(len(nodes), -1)
    for number, others in enumerate(scipy.spatial.cKDTree(points[nodes]).query_ball_point(points[nodes], 2.0 * reach)):
        group[number] = min(set(range(len(others))) - set(group[others].tolist()))
    nearby = rows.equation.tree.query_ball_point(points[nodes], reach)
    place = np.full(len(system.points), -1)
    place[rows.nodes] = np.arange(len(points))
    own, cause = np.concatenate(nearby), np.repeat(np.arange(len(nodes)), [len(numbers) for numbers in nearby])
    own, cause = place[own[place[own] >= 0]], cause[place[own] >= 0]
    values = np.zeros((len(jumps), len(own)), jumps.dtype)
    for one in range(group.max() + 1):
        alone = np.zeros_like(jumps)
        alone[:, nodes[group == one]] = jumps[:, nodes[group == one]]
        pairs = group[cause] == one
        values[:, pairs] = solve(alone)[:, own[pairs]]
    places = np.arange(len(jumps))[:, None] * len(points) + own
    columns = np.broadcast_to(cause, places.shape)
    touched, which = np.unique(places, return_inverse=True)
    found = values.ravel(), (which.ravel(), columns.ravel())
    return touched, scipy.sparse.csr_array(found, (len(touched), len(nodes)))


def _solution_of_loads(rows: ReducedJacobian) -> Linear:
    """Return the function that approximately solves for the unknowns (r, c) of right-hand sides (r, c).

    Rows that prescribe displacements come first, then the others, node by node; tangential rows are solved along and
    across the direction in which a node slips.
    """
    inverse, loaded = rows.equation.inverse, rows.equation.loaded
    turn, node_compliance = _Turn.of(rows), _node_compliance(rows)
    rows = replace(rows, a=turn.there(rows.a), b=turn.there(rows.b))
    loads = slice(len(rows.fields))
    asking = _asking(rows, node_compliance) if inverse else np.zeros_like(rows.coupled[loads])
    ask = _asked(rows, node_compliance, asking)
    own, by_loads, by_displacement = _apart(rows, node_compliance, rows.coupled[loads] & ~asking, asking)
    answering = NodeBlocks.of({(i, i): part / rows.units[i] for i, part in enumerate(asking)}, asking.shape)
    # prescribed displacements, and unknowns by right-hand sides and by inverse: one map each, with rotation and units
    maps = ask, own.plus(by_displacement.after(ask)), answering.plus(by_loads.after(answering))
    ask_for, by_right, by_answer = (turn.back(blocks).products(rows.precision) for blocks in maps)
    number = np.array([loaded.index(field) if field in loaded else -1 for field in rows.fields], np.intp)
    ask_for = replace(ask_for, rows=number[ask_for.rows], shape=(len(loaded), len(rows.nodes)))
    by_answer = replace(by_answer, columns=number[by_answer.columns])
    asked = np.zeros((len(loaded), len(rows.equation.blocks)), rows.precision)
    beside = {number[place]: found for place, found in _beside(rows, asking).items()} if inverse else {}

    def solve(right: Array) -> Array:
        found = np.zeros_like(right)
        by_right.add(right, found)
        if inverse is not None and beside:
            displacement, answer = ask_for.times(right), np.zeros(ask_for.shape, right.dtype)
            for field, (there, extension) in beside.items():
                asked[field] = extension.prolong(displacement[field, there])
            load = inverse(asked.T).T
            for field, (there, extension) in beside.items():
                answer[field, there] = extension.restrict(load[field])
            by_answer.add(answer, found)
        elif inverse is not None:
            ask_for.spread(right, rows.nodes, asked)
            by_answer.add_at(inverse(asked.T).T, rows.nodes, found)
        return found

    return solve


def _beside(rows: ReducedJacobian, asking: Mask) -> dict[int, tuple[Indices, Prolongation]]:
    """Return for the place of a field the nodes that prescribe displacements in it, and their prolongation.

    The nodes are numbers among those of the rows (l, c); the prolongation extends their displacements to the zone. The
    result is empty where there is friction.
    """
    found = dict[int, tuple[Indices, Prolongation]]()
    if not set(TANGENTIAL).isdisjoint(rows.components):
        return found
    for place, some in enumerate(asking):
        known = [other for other in found if np.array_equal(asking[other], some)]
        there = np.flatnonzero(some)
        if known:
            found[place] = found[known[0]]
        elif there.size:
            inverse = rows.equation.problem.system.capability(ApproximateInverse)
            extension = None if inverse is None else inverse.prolongation(rows.nodes[there])
            if extension is None:  # prolongations for all fields or for none
                return {}
            found[place] = there, extension
    return found


@dataclass(frozen=True, eq=False)
class _Turn:
    """Rotation from the tangential axes of c nodes to those along and across the direction in which each slips.

    angle: its cosine and sine (c,); None if all slip along an axis.
    """

    angle: tuple[Array, Array] | None

    @classmethod
    def of(cls, rows: ReducedJacobian) -> "_Turn":
        """Return the rotation to the directions in which the tangential rows A involve their loads most and least.

        These are the principal axes of A A^T, since A is not symmetric where friction is orthotropic.
        """
        if rows.components[:2] != [0, 1]:
            return cls(None)
        (a, b), (c, d) = ([rows.a.entry(row, column) for column in (0, 1)] for row in (0, 1))
        askew = 2.0 * (a * c + b * d)
        if not askew.any():
            return cls(None)
        angle = 0.5 * np.arctan2(askew, a**2 + b**2 - c**2 - d**2) * rows.coupled[:2].all(axis=0)
        return cls((np.cos(angle), np.sin(angle)))

    def there(self, blocks: NodeBlocks) -> NodeBlocks:
        """Return the blocks of the nodes in the rotated axes, without the round-off that couples the two."""
        if self.angle is None:
            return blocks
        entries = dict(blocks.rotated(*self.angle).entries)
        for place in {(0, 1), (1, 0)} & entries.keys():
            least = ROUND_OFF * sum(np.abs(entries.get((i, i), 0.0)) for i in (0, 1))
            entries[place] = np.where(np.abs(entries[place]) > least, entries[place], 0.0)
        return NodeBlocks.of(entries, blocks.shape)

    def back(self, blocks: NodeBlocks) -> NodeBlocks:
        """Return the blocks in the original axes."""
        if self.angle is None:
            return blocks
        cosine, sine = self.angle
        return blocks.rotated(cosine, -sine)


def _asking(rows: ReducedJacobian, own: NodeBlocks) -> Mask:
    """Return the rows (l, c) that prescribe displacements.

    In these the response of a node to its own load outweighs the load itself, or does not fall far behind, where a node
    slips: loads of its neighbours move it as well. own: (f, l) response of the displacements to the unknowns of the
    node.
    """
    fields = rows.fields
    asking = np.zeros((len(fields), len(rows.nodes)), bool)
    for place, field in enumerate(fields):
        if field in rows.equation.loaded:
            asked = rows.asked.index(field)
            moved = np.abs(rows.b.entry(place, asked) * own.entry(asked, place))
            least = np.abs(rows.a.entry(place, place)) / (MAX_TANGENTIAL_RATIO if field in TANGENTIAL else 1.0)
            asking[place] = rows.coupled[place] & (moved > least)
    return asking


def _node_compliance(rows: ReducedJacobian) -> NodeBlocks:
    """Return the displacements (f, c) that the unknowns (l, c) of the loads cause at their own node.

    They are almost the same in all tangential directions, so that the axes do not matter. Round-off is omitted.
    """
    blocks, units, largest = rows.equation.blocks.transpose(1, 2, 0), rows.units, rows.equation.strongest
    least = ROUND_OFF * np.sqrt(np.outer(np.diagonal(largest), np.diagonal(largest)))
    entries = {
        (row, place): units[place] * blocks[field, loaded].take(rows.nodes)
        for row, field in enumerate(rows.asked)
        for place, loaded in enumerate(rows.fields)
        if largest[field, loaded] > least[field, loaded]
    }
    return NodeBlocks.of(entries, (len(rows.asked), len(rows.nodes)))


def _asked(rows: ReducedJacobian, own: NodeBlocks, asking: Mask) -> NodeBlocks:
    """Return the displacements (l, c), in the fields of the loads, that right-hand sides (r, c) prescribe.

    The right-hand sides are those of the rows `asking` (l, c). The displacements are those that loads cause at their
    own node if they satisfy its rows alone.
    """
    places = [rows.asked.index(field) for field in rows.fields]
    causes = [own.entry(asked, place) for place, asked in enumerate(places)]
    by_cause = {
        (row, place): rows.b.entries[row, asked] * causes[place]
        for row in range(len(asking))
        for place, asked in enumerate(places)
        if (row, asked) in rows.b.entries
    }
    equations = rows.a.plus(NodeBlocks(by_cause, asking.shape))
    found = equations.inverses(asking)
    return NodeBlocks({place: causes[place[0]] * entry for place, entry in found.entries.items()}, asking.shape)


def _apart(
    rows: ReducedJacobian, response: NodeBlocks, marked: Mask, asking: Mask
) -> tuple[NodeBlocks, NodeBlocks, NodeBlocks]:
    """Return blocks (l, l) that give the loads of the marked rows (l, c).

    The three blocks act on the right-hand sides of these rows, on the loads of other rows, and on the prescribed
    displacements (l, c). They are inverses of the equations of single nodes, with their own response where their
    displacement is not prescribed.
    """
    equations, by_loads, by_displacement = (
        defaultdict[tuple[int, int], Array](partial(np.zeros, marked.shape[1])) for _ in range(3)
    )
    places = {rows.asked.index(field): place for place, field in enumerate(rows.fields)}
    for row, column in np.ndindex(len(marked), len(marked)):
        if (marked[row] & marked[column]).any():
            if (row, column) in rows.a.entries:
                equations[row, column] += rows.a.entries[row, column]
            for asked in range(len(rows.asked)):
                if (row, asked) in rows.b.entries and (asked, column) in response.entries:
                    moved = rows.b.entries[row, asked] * response.entries[asked, column]
                    equations[row, column] += np.where(asking[places[asked]], 0.0, moved) if asked in places else moved
    own = NodeBlocks.of(equations, marked.shape).inverses(marked)
    for (row, through), inverse in own.entries.items():
        for asked, column in places.items():
            if (through, column) in rows.a.entries:
                by_loads[row, column] -= np.where(marked[column], 0.0, inverse * rows.a.entries[through, column])
            if (through, asked) in rows.b.entries:
                known = np.where(asking[column], inverse * rows.b.entries[through, asked], 0.0)
                by_displacement[row, column] -= known
    return own, NodeBlocks.of(by_loads, marked.shape), NodeBlocks.of(by_displacement, marked.shape)
