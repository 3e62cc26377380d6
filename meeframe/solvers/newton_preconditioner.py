"""Roughly the inverse of Newton's equations without a matrix, from an approximate inverse of the compliance.

Coupled rows are of two kinds. Those of sticking and pressed nodes and of conductors ask for a displacement or a
potential: to them the approximate inverse answers, restricted to where they are. Those of the others have mostly to do
with loads of their own node, as friction has that follows the pressure: to them the inverse of the node's own block.
"""

from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any, Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.core.fields import ELECTRIC, MAGNETIC, Array
from meeframe.core.mesh import Indices
from meeframe.solvers.conduction import Mask
from meeframe.solvers.krylov import Linear
from meeframe.solvers.newton_rows import NodeBlocks, Rows, multiplied
from meeframe.solvers.nonsmooth import CLOSED

NORMAL: Final = 2
NEARBY: Final = 6.0
"""Spacings of nodes: farther away what a single node causes, which falls with the third power, is left out."""
SINGULAR: Final = 1e12
"""Condition of a node's block from which on its pseudo-inverse is meant."""


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
    pressure = rows.components.index(NORMAL)
    a, b, coupled = _exchanged(rows.a, pressure, between), _exchanged(rows.b, pressure, between), rows.coupled.copy()
    coupled[-1] = False
    for field in (ELECTRIC, MAGNETIC):
        if field in rows.components:
            row = rows.components.index(field)
            conducting = between[coupled[row, between]]
            a[row, row, conducting] = 0.0
            b[row, rows.asked.index(field), conducting] = 1.0 / rows.equation.scales.displacement[field]
    solve = _solution_of_loads(replace(rows, a=a, b=b, coupled=coupled))
    fading = a[-1][:, between].astype(rows.precision)
    jumps = np.zeros(coupled.shape, rows.precision)
    jumps[:, between] = -a[:, -1, between]
    responses = _responses_nearby(solve, jumps, rows, between)
    places = np.arange(jumps.size).reshape(jumps.shape)[:, between]
    among = responses[places.ravel()].toarray().reshape(*places.shape, len(between))
    matrix = np.einsum("jg,jgk->gk", fading, among)
    inverse = np.linalg.pinv(matrix, rcond=len(matrix) * float(np.finfo(matrix.dtype).eps))

    def precondition(values: Array) -> Array:
        rest = _exchanged(values.reshape(rows.coupled.shape), pressure, between)
        found = solve(rest)
        closed = inverse @ (rest[-1, between] - (fading * found[:, between]).sum(axis=0))
        found += (responses @ closed).reshape(found.shape)
        found[-1, between] = closed
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
    nearby = scipy.spatial.cKDTree(points).query_ball_point(points[nodes], reach)
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


def _exchanged(part: Array, pressure: int, nodes: Indices) -> Array:
    """Rows (r, ..., c) with those of the pressure and the closed fraction exchanged at nodes (g,)."""
    exchanged = part.copy()
    for one, other in ((pressure, -1), (-1, pressure)):
        exchanged[one][..., nodes] = part[other][..., nodes]
    return exchanged


def _solution_of_loads(rows: Rows) -> Linear:
    """Roughly the unknowns (r, c) of right-hand sides (r, c): first of the rows that ask for displacements, then of the
    others, node by node."""
    inverse, n, fields = rows.equation.inverse, len(rows.equation.blocks), rows.fields
    loads = slice(len(fields))
    asking = _asking(rows) if inverse else np.zeros_like(rows.coupled[loads])
    apart = [
        (
            which[:, None] * len(rows.nodes) + nodes,
            nodes,
            NodeBlocks.of(-rows.a[which].take(nodes, axis=2), rows.precision),
            _own(rows, which, nodes),
        )
        for which, nodes in _sets(rows.coupled[loads] & ~asking)
    ]
    loaded = rows.equation.loaded
    known = [(place, loaded.index(field)) for place, field in enumerate(fields) if field in loaded]
    displacement = rows.equation.scales.displacement[fields]
    to_displacement = rows.b[loads][:, [rows.asked.index(field) for field in fields]]
    ask = _NodeInverse.of(to_displacement * displacement[:, None], asking, rows.precision)
    answering = (asking / rows.units[loads, None]).astype(rows.precision)

    def solve(right: Array) -> Array:
        found = np.zeros_like(right)
        if inverse is not None:
            asked = np.zeros((len(loaded), n), rows.precision)
            for (place, number), part in zip(known, ask(right[loads])[[place for place, _ in known]], strict=True):
                asked[number, rows.nodes] = displacement[place] * part
            load = inverse(asked.T).T
            for place, number in known:
                np.multiply(load[number].take(rows.nodes), answering[place], out=found[place])
        for places, nodes, opposed, own in apart:
            rest = right.take(places)
            opposed.add(found.take(nodes, axis=1), rest)
            found.reshape(-1)[places] = own(rest)
        return found

    return solve


def _asking(rows: Rows) -> Mask:
    """Rows (l, c) that ask for displacements: those in which a node's own response outweighs its own load."""
    fields = rows.fields
    asking = np.zeros((len(fields), len(rows.nodes)), bool)
    for place, field in enumerate(fields):
        if field in rows.equation.loaded:
            own = rows.equation.blocks[rows.nodes, field, field] * rows.units[place]
            moved = np.abs(rows.b[place, rows.asked.index(field)] * own)
            asking[place] = rows.coupled[place] & (moved > np.abs(rows.a[place, place]))
    return asking


def _sets(which: Mask) -> list[tuple[Indices, Indices]]:
    """The sets of rows (s,) that are marked (l, c) at some nodes, and all nodes (k,) that have just these marked."""
    code = 2 ** np.arange(len(which)) @ which
    sets = [np.flatnonzero(code == one) for one in np.unique(code[code > 0])]
    return [(np.flatnonzero(which[:, nodes[0]]), nodes) for nodes in sets]


def _own(rows: Rows, which: Indices, nodes: Indices) -> "_NodeInverse":
    """Inverses of s rows (s,) of k of the nodes (k,), with their own response."""
    fields = [rows.fields[place] for place in which]
    blocks = rows.equation.blocks[rows.nodes[nodes]][:, rows.asked][:, :, fields] * rows.units[which]
    answer = np.einsum("ijc,jkc->ikc", rows.b[which][:, :, nodes], np.ascontiguousarray(blocks.transpose(1, 2, 0)))
    own = rows.a[np.ix_(which, which, nodes)] + answer
    return _NodeInverse.of(own, np.ones(own.shape[1:], bool), rows.precision)


@dataclass(frozen=True, eq=False)
class _NodeInverse:
    """Inverses of the blocks (s, s) of c nodes on some rows and columns, zero elsewhere.

    diagonal: (s, c) of blocks that have no other entries; full: (s, s, k) of the other ones, at nodes `linked` (k,).
    """

    diagonal: Array
    linked: Indices
    full: Array

    @classmethod
    def of(cls, blocks: Array, which: Mask, precision: np.dtype[Any]) -> "_NodeInverse":
        """Of blocks (s, s, c) on the rows and columns (s, c) which."""
        size = range(len(blocks))
        diagonal = np.zeros(which.shape)
        for inverse, some, block in zip(diagonal, which, blocks[size, size], strict=True):
            np.divide(1.0, block, out=inverse, where=some & (block != 0.0))
        beside = np.zeros(which.shape[1], bool)
        for i, j in permutations(size, 2):
            beside |= which[i] & which[j] & (blocks[i, j] != 0.0)
        linked = np.flatnonzero(beside)
        full = blocks[:, :, linked]
        some = which[:, linked]
        np.copyto(full, np.eye(len(blocks))[:, :, None], where=~(some[:, None] & some))
        full = np.where(some[:, None] & some, _inverse(full), 0.0)
        return cls(diagonal.astype(precision), linked, full.astype(precision))

    def __call__(self, vectors: Array) -> Array:
        """Products (s, c) with vectors (s, c)."""
        product = self.diagonal * vectors
        if self.linked.size:
            linked = multiplied(self.full, vectors.take(self.linked, axis=1))
            for part, at_linked in zip(product, linked, strict=True):
                part[self.linked] = at_linked
        return product


def _inverse(blocks: Array) -> Array:
    """Inverses of blocks (s, s, c), pseudo-inverses of those that are singular."""
    turned = blocks.transpose(2, 0, 1)
    with np.errstate(all="ignore"):
        if len(blocks) == 2:  # the two directions in which nodes slip, at many of them
            (a, b), (c, d) = blocks
            found = (np.array([[d, -b], [-c, a]]) / (a * d - b * c)).transpose(2, 0, 1)
        else:
            try:
                found = np.asarray(np.linalg.inv(turned), float)
            except np.linalg.LinAlgError:
                return np.asarray(np.linalg.pinv(turned).transpose(1, 2, 0))
        size, bound = (np.abs(part).max(axis=(1, 2), initial=0.0) for part in (turned, found))
        singular = ~(size * bound < SINGULAR)
    found[singular] = np.linalg.pinv(turned[singular])
    return np.asarray(found.transpose(1, 2, 0))
