"""Newton steps without a matrix: Krylov iteration, preconditioned by an approximate inverse of the compliance.

Coupled rows are of two kinds. Those of sticking and pressed nodes and of conductors ask for a displacement or a
potential: to them the approximate inverse answers, restricted to where they are. Those of the others have mostly to do
with loads of their own node, as friction has that follows the pressure: to them the inverse of the node's own block.
Free motions are unknowns beside the loads; that a motion is resisted by the contact is part of the preconditioner.

Components come before nodes in what follows: numpy is much faster along the longer axis.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.core.fields import ELECTRIC, MAGNETIC, N_FIELDS, Array
from meeframe.core.mesh import Indices
from meeframe.solvers.conduction import Mask
from meeframe.solvers.krylov import Linear, gmres
from meeframe.solvers.nonsmooth import CLOSED, Blocks, Equation

NORMAL: Final = 2
UNRESISTED: Final = 1e-12
"""Stiffness against a motion, as a fraction of the largest one, that is none."""
NEARBY: Final = 6.0
"""Spacings of nodes: farther away what a single node causes, which falls with the third power, is left out."""
SINGULAR: Final = 1e12
"""Condition of a node's block from which on its pseudo-inverse is meant."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The linearised equations on the k coupled rows, by dimensionless unknowns (k,).

    nodes: (c,) that have such rows; a: (6, 6, c) and b: (6, 5, c) of theirs; coupled: (6, c) rows of theirs; places:
    (k,) where those are in all rows (6, n), units: (k,) of the unknowns there; asked: fields of the displacement that b
    asks for.
    """

    equation: Equation
    nodes: Indices
    a: Array
    b: Array
    coupled: Mask
    places: Indices
    units: Array
    asked: list[int]

    @classmethod
    def of(cls, equation: Equation, blocks: Blocks, coupled: Mask) -> "Rows":
        """Of the blocks of an equation; coupled: (n, 6)."""
        nodes = np.flatnonzero(coupled.any(axis=1))
        a, b = (np.ascontiguousarray(part[nodes].transpose(1, 2, 0)) for part in (blocks.a, blocks.b))
        places = np.flatnonzero(coupled.T)
        units = np.append(equation.scales.load, 1.0)[places // len(coupled)]
        asked = np.flatnonzero(b.any(axis=(0, 2))).tolist()
        return cls(equation, nodes, a, b, np.ascontiguousarray(coupled[nodes].T), places, units, asked)

    def step(self, values: Array) -> Array:
        """Step (n, 6) by unknowns (k,), zero off the coupled rows."""
        step = np.zeros((CLOSED + 1, len(self.equation.blocks)))
        step.reshape(-1)[self.places] = self.units * values
        return step.T

    def product(self, step: Array) -> Array:
        """Product (k,) of the equations with a step (n, 6)."""
        moved = self.equation.problem.system.response(step[:, :N_FIELDS], self.asked)
        image = multiplied(self.a, step[self.nodes].T) + multiplied(self.b[:, self.asked], moved[self.nodes].T)
        return np.asarray(image[self.coupled])

    def multiply(self, values: Array) -> Array:
        """Product (k,) of the equations with unknowns (k,)."""
        return self.product(self.step(values))

    def lifted(self, displacement: Array) -> Array:
        """What displacements (n, 5, m) of the indenter add to the right-hand side, (k, m)."""
        return np.asarray(np.einsum("ijc,cjm->icm", self.b, displacement[self.nodes])[self.coupled])


def multiplied(blocks: Array, vectors: Array) -> Array:
    """Product (i, c) of the blocks (i, j, c) of c nodes with their vectors (j, c)."""
    return np.asarray(np.einsum("ijc,jc->ic", blocks, vectors))


def krylov_step(
    equation: Equation, blocks: Blocks, coupled: Mask, given: Array, tolerance: float
) -> tuple[Array, Array]:
    """Step (n, 6) and amounts (m,) of the motions, with what is given of the step (n, 6) off the coupled rows.

    The residual that is left is that fraction of the one before.
    """
    rows = Rows.of(equation, blocks, coupled)
    right = -blocks.residual[rows.nodes].T[rows.coupled] - (rows.product(given) if given.any() else 0.0)
    precondition = _preconditioner(rows)
    border = _Border.of(rows, precondition)
    balance = -blocks.balance - np.einsum("kni,ni->k", equation.measures, given[:, :N_FIELDS])
    weight = np.sqrt(len(given))  # as the merit weighs the balance
    size = len(right)

    def multiply(values: Array) -> Array:
        loads, amounts = values[:size], values[size:]
        left = rows.multiply(loads) - border.columns @ amounts
        return np.concatenate([left, weight * (border.totals @ loads)])

    def solve(values: Array) -> Array:
        loads = precondition(values[:size])
        amounts = (values[size:] / weight - border.totals @ loads) / border.stiffness
        return np.concatenate([loads + border.responses @ amounts, amounts])

    found = gmres(multiply, solve, np.concatenate([right, weight * border.turned(balance)]), tolerance)
    amounts = border.motions @ found[size:]
    farthest = float(np.abs(amounts).max(initial=0.0))
    if farthest > blocks.farthest:
        amounts *= blocks.farthest / farthest
        found = gmres(rows.multiply, precondition, right + rows.lifted(equation.modes) @ amounts, tolerance)
    return given + rows.step(found[:size]), amounts


@dataclass(frozen=True, eq=False)
class _Border:
    """The r combinations of motions that something resists, as columns and rows of the equations.

    motions: (m, r) amounts in them; columns: (k, r) what they add to the right-hand side; responses: (k, r) loads that
    they roughly cause; totals: (r, k) resultants of loads, combined likewise, and stiffness: (r,) those of the
    responses; left: (m, r) the combinations of resultants.
    """

    motions: Array
    columns: Array
    responses: Array
    totals: Array
    stiffness: Array
    left: Array

    @classmethod
    def of(cls, rows: Rows, precondition: Linear) -> "_Border":
        equation = rows.equation
        columns = rows.lifted(equation.modes)
        responses = np.column_stack([precondition(column) for column in columns.T]) if columns.size else columns
        extended = np.zeros((columns.shape[1], CLOSED + 1, len(equation.blocks)))
        extended[:, :N_FIELDS] = equation.measures.transpose(0, 2, 1)
        totals = extended.reshape(columns.shape[1], (CLOSED + 1) * len(equation.blocks))[:, rows.places] * rows.units
        left, stiffness, right = np.linalg.svd(totals @ responses)
        resisted = stiffness > UNRESISTED * stiffness.max(initial=0.0)
        motions, left = right[resisted].T, left[:, resisted]
        return cls(motions, columns @ motions, responses @ motions, left.T @ totals, stiffness[resisted], left)

    def turned(self, resultants: Array) -> Array:
        """Combinations (r,) of resultants (m,)."""
        return np.asarray(self.left.T @ resultants)


def _preconditioner(rows: Rows) -> Linear:
    """Roughly the inverse of the coupled rows, (k,) of (k,).

    At nodes between open and closed no pressure and no gap are asked for. There the gap goes with the pressure, as
    everywhere in contact, and that there is none with the closed fraction, which alone can see to it: by what it causes
    nearby. Fluxes there count as fully conducted: they act on the nodes around whatever part of them is.
    """
    between = np.flatnonzero(rows.coupled[CLOSED])
    a, b, coupled = _exchanged(rows.a, between), _exchanged(rows.b, between), rows.coupled.copy()
    coupled[CLOSED] = False
    for field in (ELECTRIC, MAGNETIC):
        conducting = between[coupled[field, between]]
        a[field, field, conducting], b[field, field, conducting] = 0.0, 1.0 / rows.equation.scales.displacement[field]
    solve = _solution_of_loads(replace(rows, a=a, b=b, coupled=coupled))
    fading = a[CLOSED][:, between] * np.append(rows.equation.scales.load, 1.0)[:, None]
    jumps = np.zeros(coupled.shape)
    jumps[:, between] = -a[:, CLOSED, between]
    responses = _responses_nearby(solve, jumps, rows, between)
    places = np.arange(jumps.size).reshape(jumps.shape)[:, between]
    among = responses[places.ravel()].toarray().reshape(*places.shape, len(between))
    pressures = np.einsum("jg,jgk->gk", fading, among)
    inverse = np.linalg.pinv(pressures)

    def precondition(values: Array) -> Array:
        rest = np.zeros(coupled.shape)
        rest[rows.coupled] = values
        rest = _exchanged(rest, between)
        found = solve(rest)
        closed = inverse @ (rest[CLOSED, between] - (fading * found[:, between]).sum(axis=0))
        found += (responses @ closed).reshape(found.shape)
        found[CLOSED, between] = closed
        return np.asarray(found[rows.coupled])

    return precondition


def _responses_nearby(solve: Linear, jumps: Array, rows: Rows, nodes: Indices) -> Any:
    """Unknowns (6 c, g), sparse, that right-hand sides (6, c) of single nodes (g,) cause near these.

    Nodes far from each other share a solution: however many there are, a few will do.
    """
    if not nodes.size:
        return scipy.sparse.csr_array((jumps.size, 0))
    system = rows.equation.problem.system
    points, reach = system.points[rows.nodes], NEARBY * np.sqrt(system.weights.max())
    group = np.full(len(nodes), -1)
    for number, others in enumerate(scipy.spatial.cKDTree(points[nodes]).query_ball_point(points[nodes], 2.0 * reach)):
        group[number] = np.setdiff1d(np.arange(len(others)), group[others])[0]
    nearby = scipy.spatial.cKDTree(points).query_ball_point(points[nodes], reach)
    own, cause = np.concatenate(nearby), np.repeat(np.arange(len(nodes)), [len(numbers) for numbers in nearby])
    values = np.zeros((len(jumps), len(own)))
    for one in range(group.max() + 1):
        alone = np.zeros_like(jumps)
        alone[:, nodes[group == one]] = jumps[:, nodes[group == one]]
        pairs = group[cause] == one
        values[:, pairs] = solve(alone)[:, own[pairs]]
    places = np.arange(len(jumps))[:, None] * len(points) + own
    columns = np.broadcast_to(cause, places.shape)
    return scipy.sparse.csr_array((values.ravel(), (places.ravel(), columns.ravel())), (jumps.size, len(nodes)))


def _exchanged(part: Array, nodes: Indices) -> Array:
    """Rows (6, ..., c) with those of the pressure and the closed fraction exchanged at nodes (g,)."""
    exchanged = part.copy()
    for one, other in ((NORMAL, CLOSED), (CLOSED, NORMAL)):
        exchanged[one][..., nodes] = part[other][..., nodes]
    return exchanged


def _solution_of_loads(rows: Rows) -> Linear:
    """Roughly the unknowns (6, c) of right-hand sides (6, c): first of the rows that ask for displacements, then of the
    others, node by node."""
    inverse, fields, n = rows.equation.inverse, rows.equation.loaded, len(rows.equation.blocks)
    asking = _asking(rows) if inverse else np.zeros_like(rows.coupled[:N_FIELDS])
    others = rows.coupled.copy()
    others[:N_FIELDS] &= ~asking
    own = _inverse_of_own(rows, others)
    units: Array = np.append(rows.equation.scales.load, 1.0)[:, None]
    ask = _restricted_inverse(rows.b[:N_FIELDS] * rows.equation.scales.displacement[:, None], asking)
    ask *= rows.equation.scales.displacement[:, None, None]

    def solve(right: Array) -> Array:
        if inverse is None or not asking.any():
            return multiplied(own, right)
        asked = np.zeros((len(fields), n))
        asked[:, rows.nodes] = multiplied(ask[fields], right[:N_FIELDS])
        found = np.zeros_like(right)
        found[fields] = np.where(asking[fields], inverse(asked.T)[rows.nodes].T, 0.0)
        return found / units + multiplied(own, right - multiplied(rows.a, found))

    return solve


def _asking(rows: Rows) -> Mask:
    """Rows (5, c) that ask for displacements: those in which a node's own response outweighs its own load."""
    own = _diagonal(rows.equation.blocks[rows.nodes].transpose(1, 2, 0))
    load, moved = (np.abs(_diagonal(part[:N_FIELDS, :N_FIELDS])) for part in (rows.a, rows.b))
    asking: Mask = rows.coupled[:N_FIELDS] & (moved * np.abs(own) > load)
    asking[np.setdiff1d(np.arange(N_FIELDS), rows.equation.loaded)] = False
    return asking


def _diagonal(blocks: Array) -> Array:
    return np.asarray(np.diagonal(blocks).T)


def _inverse_of_own(rows: Rows, which: Mask) -> Array:
    """Inverses (6, 6, c) of each node's own block on the rows (6, c) which, dimensionless; zero elsewhere."""
    own = rows.a.copy()
    own[:, :N_FIELDS] += np.einsum("ijc,cjk->ikc", rows.b, rows.equation.blocks[rows.nodes])
    own *= np.append(rows.equation.scales.load, 1.0)[:, None]
    return _restricted_inverse(own, which)


def _restricted_inverse(blocks: Array, which: Mask) -> Array:
    """Inverses (s, s, c) of blocks (s, s, c) on the rows and columns (s, c) which, zero elsewhere."""
    size = range(len(blocks))
    restricted = np.where(which[:, None] & which, blocks, 0.0)
    diagonal = _diagonal(restricted).copy()
    inverses = np.zeros_like(blocks)
    inverses[size, size] = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal != 0.0)
    restricted[size, size] = 0.0
    full = np.flatnonzero(restricted.any(axis=(0, 1)))
    if full.size:
        restricted[size, size] = np.where(which, diagonal, 1.0)
        inverse = _inverse(restricted[:, :, full].transpose(2, 0, 1)).transpose(1, 2, 0)
        inverses[:, :, full] = np.where(which[:, None, full] & which[:, full], inverse, 0.0)
    return inverses


def _inverse(blocks: Array) -> Array:
    """Inverses of blocks (c, s, s), pseudo-inverses of those that are singular."""
    try:
        found: Array = np.asarray(np.linalg.inv(blocks), float)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(blocks))
    size, bound = (np.abs(part).max(axis=(1, 2)) for part in (blocks, found))
    singular = ~(size * bound < SINGULAR)
    found[singular] = np.linalg.pinv(blocks[singular])
    return found
