"""Roughly the inverse of Newton's equations without a matrix, from an approximate inverse of the compliance.

Coupled rows are of two kinds. Those of sticking and pressed nodes and of conductors ask for a displacement or a
potential: to them the approximate inverse answers, restricted to where they are. Those of the others have mostly to do
with loads of their own node, as friction has that follows the pressure: to them the inverse of the node's own block.
"""

from collections import defaultdict
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.core.fields import ELECTRIC, MAGNETIC, Array
from meeframe.core.mesh import Indices
from meeframe.solvers.conduction import Mask
from meeframe.solvers.krylov import Linear
from meeframe.solvers.newton_rows import Rows
from meeframe.solvers.node_blocks import NodeBlocks
from meeframe.solvers.nonsmooth import CLOSED

NORMAL: Final = 2
NEARBY: Final = 6.0
"""Spacings of nodes: farther away what a single node causes, which falls with the third power, is left out."""


def preconditioner(rows: Rows) -> Linear:
    """Roughly the inverse of the coupled rows, (r c,) of (r c,).

    At nodes between open and closed no pressure and no gap are asked for. There the gap goes with the pressure, as
    everywhere in contact, and that there is none with the closed fraction, which alone can see to it: by what it causes
    nearby. Fluxes there count as fully conducted: they act on the nodes around whatever part of them is.
    """
    if CLOSED not in rows.components:
        solve = _solution_of_loads(rows)
        return lambda values: solve(values.reshape(rows.coupled.shape)).ravel()
    between = np.flatnonzero(rows.coupled[-1])
    last, pressure = len(rows.components) - 1, rows.components.index(NORMAL)
    a, b = (part.exchanged(pressure, last, between) for part in (rows.a, rows.b))
    coupled = rows.coupled.copy()
    coupled[last] = False
    for field in (ELECTRIC, MAGNETIC):
        if field in rows.components:
            row = rows.components.index(field)
            conducting = between[coupled[row, between]]
            a = a.changed(row, row, conducting, 0.0)
            b = b.changed(row, rows.asked.index(field), conducting, 1.0 / rows.equation.scales.displacement[field])
    solve = _solution_of_loads(replace(rows, a=a, b=b, coupled=coupled))
    fading = np.array([a.entry(last, column)[between] for column in range(last + 1)], rows.precision)
    jumps = np.zeros(coupled.shape, rows.precision)
    jumps[:, between] = [-a.entry(row, last)[between] for row in range(last + 1)]
    responses = _responses_nearby(solve, jumps, rows, between)
    places = np.arange(jumps.size).reshape(jumps.shape)[:, between]
    among = responses[places.ravel()].toarray().reshape(*places.shape, len(between))
    matrix = np.einsum("jg,jgk->gk", fading, among)
    inverse = np.linalg.pinv(matrix, rcond=len(matrix) * float(np.finfo(matrix.dtype).eps))

    def precondition(values: Array) -> Array:
        rest = values.reshape(rows.coupled.shape).copy()
        rest[pressure, between], rest[last, between] = rest[last, between], rest[pressure, between]
        found = solve(rest)
        closed = inverse @ (rest[last, between] - (fading * found[:, between]).sum(axis=0))
        found += (responses @ closed).reshape(found.shape)
        found[last, between] = closed
        return found.ravel()

    return precondition


def _responses_nearby(solve: Linear, jumps: Array, rows: Rows, nodes: Indices) -> Any:
    """Unknowns (r c, g), sparse, that right-hand sides (r, c) of single nodes (g,) cause near these.

    Nodes far from each other share a solution: however many there are, a few will do.
    """
    system = rows.equation.problem.system
    points, reach = system.points[rows.nodes], NEARBY * np.sqrt(system.weights.max())
    group = np.full(len(nodes), -1)
    for number, others in enumerate(scipy.spatial.cKDTree(points[nodes]).query_ball_point(points[nodes], 2.0 * reach)):
        group[number] = np.setdiff1d(np.arange(len(others)), group[others])[0]
    tree = scipy.spatial.cKDTree(points, balanced_tree=False, compact_nodes=False)  # asked for few nodes alone
    nearby = tree.query_ball_point(points[nodes], reach)
    own, cause = np.concatenate(nearby), np.repeat(np.arange(len(nodes)), [len(numbers) for numbers in nearby])
    values = np.zeros((len(jumps), len(own)), jumps.dtype)
    for one in range(group.max() + 1):
        alone = np.zeros_like(jumps)
        alone[:, nodes[group == one]] = jumps[:, nodes[group == one]]
        pairs = group[cause] == one
        values[:, pairs] = solve(alone)[:, own[pairs]]
    places = np.arange(len(jumps))[:, None] * len(points) + own
    columns = np.broadcast_to(cause, places.shape)
    return scipy.sparse.csr_array((values.ravel(), (places.ravel(), columns.ravel())), (jumps.size, len(nodes)))


def _solution_of_loads(rows: Rows) -> Linear:
    """Roughly the unknowns (r, c) of right-hand sides (r, c): first of the rows that ask for displacements, then of the
    others, node by node."""
    inverse, loaded = rows.equation.inverse, rows.equation.loaded
    loads = slice(len(rows.fields))
    asking = _asking(rows) if inverse else np.zeros_like(rows.coupled[loads])
    known = [(place, loaded.index(field)) for place, field in enumerate(rows.fields) if field in loaded]
    ask = _asked(rows, asking).astype(rows.precision)
    answering = (asking / rows.units[loads, None]).astype(rows.precision)
    apart = _apart(rows, rows.coupled[loads] & ~asking, asking)
    own, by_loads, by_displacement = (blocks.astype(rows.precision) for blocks in apart)
    asked = np.zeros((len(loaded), len(rows.equation.blocks)), rows.precision)

    def solve(right: Array) -> Array:
        found, rest = np.zeros_like(right), own.times(right)
        if inverse is not None:
            displacement = ask.times(right)
            by_displacement.add(displacement, rest)
            for place, number in known:
                asked[number, rows.nodes] = displacement[place]
            load = inverse(asked.T).T
            for place, number in known:
                np.multiply(load[number].take(rows.nodes), answering[place], out=found[place])
        by_loads.add(found, rest)
        found[loads] += rest
        return found

    return solve


def _asking(rows: Rows) -> Mask:
    """Rows (l, c) that ask for displacements: those in which a node's own response outweighs its own load."""
    fields = rows.fields
    asking = np.zeros((len(fields), len(rows.nodes)), bool)
    for place, field in enumerate(fields):
        if field in rows.equation.loaded:
            moved = np.abs(rows.b.entry(place, rows.asked.index(field)) * _response(rows, field, place))
            asking[place] = rows.coupled[place] & (moved > np.abs(rows.a.entry(place, place)))
    return asking


def _response(rows: Rows, field: int, place: int) -> Array:
    """Of each node in a field to its own unknown of a number, (c,)."""
    return np.asarray(rows.equation.blocks[rows.nodes, field, rows.fields[place]] * rows.units[place])


def _asked(rows: Rows, asking: Mask) -> NodeBlocks:
    """Displacements (l, c) in the fields of the loads that right-hand sides (r, c) of the rows (l, c) ask for."""
    places = {rows.asked.index(field): place for place, field in enumerate(rows.fields)}
    displacement = rows.equation.scales.displacement[rows.fields]
    to_displacement = {
        (row, places[asked]): entry * displacement[places[asked]]
        for (row, asked), entry in rows.b.entries.items()
        if row < len(asking) and asked in places
    }
    found = NodeBlocks(to_displacement, asking.shape).inverses(asking)
    return NodeBlocks(
        {(row, column): displacement[row] * entry for (row, column), entry in found.entries.items()}, asking.shape
    )


def _apart(rows: Rows, marked: Mask, asking: Mask) -> tuple[NodeBlocks, NodeBlocks, NodeBlocks]:
    """Blocks (l, l) by which the right-hand sides of marked rows (l, c), the loads of other rows and the displacements
    that are asked for (l, c) say what the loads of the marked rows are: inverses of the equations of single nodes with
    their own response, where it is not known what they are moved by."""
    equations, by_loads, by_displacement = (
        defaultdict[tuple[int, int], Array](partial(np.zeros, marked.shape[1])) for _ in range(3)
    )
    places = {rows.asked.index(field): place for place, field in enumerate(rows.fields)}
    for row, column in np.ndindex(len(marked), len(marked)):
        if (marked[row] & marked[column]).any():
            equations[row, column] += rows.a.entry(row, column)
            for asked, field in enumerate(rows.asked):
                if (row, asked) in rows.b.entries:
                    moved = rows.b.entries[row, asked] * _response(rows, field, column)
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
