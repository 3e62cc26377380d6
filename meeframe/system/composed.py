"""Reduced systems that are composed of others: in other frames, with edge corrections, and of two bodies.

The compliance of a composed system is a sum over bodies, with an addition at the nodes,

    C = sum_i R_i P_i^T C_i P_i R_i^T + E,

where R_i changes components from the local frames of body i to those of the composition, P_i takes nodes of the
composition to nodes of body i, and E is a 5 x 5 block at each node. Capabilities of the bodies are forwarded; see
`ComposedSystem.capability`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final, TypeVar, final

import numpy as np

from meeframe.fields import TANGENTIAL, Array, Indices
from meeframe.system.capabilities import (
    AnyArray,
    ApproximateInverse,
    Coarsening,
    EdgeCorrection,
    EdgeResolution,
    FieldProduct,
    FieldwiseApply,
    IndenterEdge,
    InteriorFields,
    Multigrid,
    PointFields,
    Prolongation,
    Restriction,
    Subsystem,
    apply_fields,
    diagonal,
    rescale_inverse,
)
from meeframe.system.reduced import NodalFields, Progress, ReducedSystem, silent

C = TypeVar("C")
ROUND_OFF: Final = 1e-14


@final
@dataclass(frozen=True, eq=False)
class Rotation:
    """An orthogonal change of components at each node, identical at all nodes or not.

    Attributes
    ----------
    entries
        Nonzero coefficients of component j in the new component i, by (i, j): one number if all nodes share it, else
        (n,).
    n_fields
        Number of components.
    """

    entries: Mapping[tuple[int, int], float | Array]
    n_fields: int

    @classmethod
    def of(cls, blocks: Array) -> "Rotation":
        """Return the rotation of blocks (n, f, f); entries that are zero or uniform to round-off are stored so."""
        entries: dict[tuple[int, int], float | Array] = {}
        for i, j in np.ndindex(*blocks.shape[1:]):
            entry = blocks[:, i, j]
            if np.abs(entry).max(initial=0.0) > ROUND_OFF:
                entries[i, j] = float(entry[0]) if np.ptp(entry) < ROUND_OFF else np.ascontiguousarray(entry)
        return cls(entries, blocks.shape[1])

    @cached_property
    def inverse(self) -> "Rotation":
        """The transposed blocks."""
        return Rotation({(j, i): entry for (i, j), entry in self.entries.items()}, self.n_fields)

    @cached_property
    def is_uniform(self) -> bool:
        """True if all nodes rotate alike."""
        return not any(isinstance(entry, np.ndarray) for entry in self.entries.values())

    @cached_property
    def coupled_fields(self) -> tuple[frozenset[int], ...]:
        """For each field, all fields coupled to it, itself included."""
        groups = [{field} for field in range(self.n_fields)]
        for i, j in self.entries:
            if groups[i] is not groups[j]:
                groups[i] |= groups[j]
                for field in groups[j]:
                    groups[field] = groups[i]
        return tuple(frozenset(group) for group in groups)

    def closure(self, fields: Sequence[int]) -> list[int]:
        """Return all fields coupled to some fields; the latter, in their order, if they are coupled to no others."""
        closed = frozenset[int]().union(*(self.coupled_fields[field] for field in fields))
        return list(fields) if len(closed) == len(fields) else sorted(closed)

    def at(self, nodes: Indices) -> "Rotation":
        """Return the rotation at some nodes."""
        return Rotation(
            {ij: entry[nodes] if isinstance(entry, np.ndarray) else entry for ij, entry in self.entries.items()},
            self.n_fields,
        )

    def change(self, values: AnyArray, source: Sequence[int], target: Sequence[int]) -> AnyArray:
        """Return components `target`, (n, k), of values (n, l) with components `source`, in the precision of these."""
        changed = np.zeros((len(target), len(values)), values.dtype)
        rows, columns = {field: k for k, field in enumerate(target)}, {field: k for k, field in enumerate(source)}
        for (i, j), entry in self.entries.items():
            if i in rows and j in columns:
                changed[rows[i]] += entry * values[:, columns[j]]
        return changed.T

    def change_blocks(self, blocks: Array) -> Array:
        """Return R B R^T for blocks B (n, f, f)."""
        changed = np.zeros((self.n_fields, self.n_fields, len(blocks)))
        for (i, j), first in self.entries.items():
            for (k, m), second in self.entries.items():
                changed[k, i] += first * second * blocks[:, j, m]
        return changed.T


@final
@dataclass(frozen=True, eq=False)
class Term:
    """A body of a composition.

    Attributes
    ----------
    system
        The body in its own frames.
    rotation
        From components in the frames of the body to those of the composition, at its nodes; None if they coincide.
    nodes
        (n,) node of the body at each node of the composition; None if they have the same numbers.
    """

    system: ReducedSystem
    rotation: Rotation | None = None
    nodes: Indices | None = None

    def to_body(self, values: AnyArray, source: Sequence[int], target: Sequence[int]) -> AnyArray:
        """Return components of nodal values of the composition at the nodes and in the frames of the body."""
        return self.at_body(values if self.rotation is None else self.rotation.inverse.change(values, source, target))

    def at_body(self, values: AnyArray) -> AnyArray:
        """Return nodal values (n, ...) of the composition in the order of the nodes of the body."""
        if self.nodes is None:
            return values
        ordered = np.empty_like(values)
        ordered[self.nodes] = values
        return ordered

    def from_body(self, values: AnyArray, source: Sequence[int], target: Sequence[int]) -> AnyArray:
        """Return components of nodal values of the body at the nodes and in the frames of the composition."""
        gathered = values if self.nodes is None else values[self.nodes]
        return gathered if self.rotation is None else self.rotation.change(gathered, source, target)

    def blocks_from_body(self, blocks: Array) -> Array:
        """Return blocks (n, f, f) of the body at the nodes and in the frames of the composition."""
        gathered = blocks if self.nodes is None else blocks[self.nodes]
        return gathered if self.rotation is None else self.rotation.change_blocks(gathered)

    def closure(self, fields: Sequence[int]) -> list[int]:
        """Return the fields of the body on which fields of the composition depend."""
        return list(fields) if self.rotation is None else self.rotation.closure(fields)

    def product(self, multiply: FieldProduct, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the contribution of the body to a product of the composition, by a product `multiply` of the body."""
        inner_loaded, inner_fields = self.closure(loaded), self.closure(fields)
        response = multiply(self.to_body(load, loaded, inner_loaded), inner_loaded, inner_fields)
        return self.from_body(response, inner_fields, fields)

    def edge_seen(self, edge: IndenterEdge) -> IndenterEdge:
        """Return an indenter's edge at the nodes and in the frames of the body."""
        distance, gap = (self.at_body(values) for values in (edge.distance, edge.gap))
        return IndenterEdge(distance, self.to_body(edge.outward, TANGENTIAL, TANGENTIAL), gap)


@final
@dataclass(frozen=True, eq=False)
class ComposedSystem(
    ReducedSystem,
    FieldwiseApply,
    ApproximateInverse,
    Multigrid,
    Restriction,
    EdgeResolution,
    InteriorFields,
):
    """A sum of reduced systems in common frames, with an additional compliance at the nodes.

    Attributes
    ----------
    terms
        The bodies. The first one has the nodes of the composition, in the same order.
    extra_compliance
        (n, f, f) addition to the diagonal blocks, or None.
    matrix
        (n, f, n, f), the compliance if all bodies have theirs as a matrix; see `sum_matrices`.
    """

    terms: tuple[Term, ...]
    extra_compliance: Array | None = None
    matrix: Array | None = None

    def capability(self, kind: type[C]) -> C | None:
        """Return the system itself if its bodies allow it to forward a capability, else None.

        Products in some fields need one body that has them. The approximate inverse, its prolongation and interior
        fields are those of the first body. Coarsening and restriction need all bodies, coarsening on the same nodes
        and without extra compliance. Edge resolution needs all bodies, and no correction already in place. Persistence
        is not forwarded: bodies are stored one by one.
        """
        systems, corrected = [term.system for term in self.terms], self.extra_compliance is not None
        has = [system.capability(kind) is not None for system in systems]
        forwarded: dict[type, bool] = {
            FieldwiseApply: any(has),
            ApproximateInverse: has[0],
            Multigrid: all(has) and not corrected,
            Restriction: all(has),
            EdgeResolution: all(has) and not corrected,
            InteriorFields: has[0],
        }
        if not forwarded.get(kind, False):
            return None
        if kind is Multigrid and self._coarsening is None:
            return None
        return super().capability(kind)

    def apply(self, load: Array) -> Array:
        """Return compliance(load), (n, f), for a load (n, f)."""
        if self.matrix is not None:
            response: Array = self.matrix.reshape(load.size, load.size) @ np.ravel(load)
            return response.reshape(load.shape)
        fields = range(self.n_fields)
        return self._sum([_in_all_fields(term.system) for term in self.terms], load, fields, fields)

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load, (n, f, f)."""
        return self._sum_blocks([term.system.diagonal_blocks() for term in self.terms], self.extra_compliance)

    def dense(self) -> Array | None:
        """Return the compliance, (n, f, n, f), if all bodies have theirs as a matrix."""
        return self.matrix

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the whole boundary of the first body."""
        fields = range(self.n_fields)
        return self.terms[0].system.recover(self.terms[0].to_body(load, fields, fields))

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields inside the first body."""
        fields = range(self.n_fields)
        interior = _required(self.terms[0].system, InteriorFields)
        return interior.evaluate(self.terms[0].to_body(load, fields, fields), points, progress)

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in some fields as the sum of the products of the bodies."""
        return self._sum([partial(apply_fields, term.system) for term in self.terms], load, loaded, fields)

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of `diagonal_blocks` in k fields, (n, k)."""
        if len(self.terms) == 1 and self.terms[0].rotation is None:
            blocks = diagonal(self.terms[0].system, fields)
            return (
                blocks
                if self.extra_compliance is None
                else blocks + self.extra_compliance[:, list(fields), list(fields)]
            )
        return self.diagonal_blocks()[:, list(fields), list(fields)]

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """Return the inverse of the first body, rescaled for the nodal compliance of the other bodies and corrections.

        None if the rotation of the first body mixes these fields with others.
        """
        inverse = _required(self.terms[0].system, ApproximateInverse).approximate_inverse
        return self._rescaled(inverse, list(fields), np.zeros(len(fields)))

    def series_inverse(self, fields: Sequence[int], resistances: Array) -> Callable[[Array], Array] | None:
        """Return that of the first body, rescaled likewise.

        None if a rotation mixes these fields with others, or fields with different resistances.
        """
        term, chosen = self.terms[0], list(fields)
        of_field = dict(zip(chosen, resistances.tolist(), strict=True))
        if any(len({of_field.get(other) for other in term.closure([field])}) > 1 for field in chosen):
            return None
        inverse = _required(term.system, ApproximateInverse).series_inverse
        return self._rescaled(lambda some: inverse(some, resistances), chosen, resistances)

    def _rescaled(
        self,
        inverse_of: Callable[[list[int]], Callable[[Array], Array] | None],
        fields: list[int],
        resistances: Array,
    ) -> Callable[[Array], Array] | None:
        """Return an inverse of the first body, in series with resistances, in the frames of the composition."""
        term = self.terms[0]
        if set(term.closure(fields)) != set(fields):
            return None
        inverse = inverse_of(fields)
        if inverse is None:
            return None
        inverse = _in_frames(inverse, term, fields)
        if len(self.terms) == 1 and self.extra_compliance is None:
            return inverse
        alone = term.blocks_from_body(term.system.diagonal_blocks())[:, fields, fields]
        return rescale_inverse(inverse, alone + resistances, self.diagonal(fields) + resistances)

    def prolongation(self, nodes: Indices) -> Prolongation | None:
        """Return that of the first body."""
        return _required(self.terms[0].system, ApproximateInverse).prolongation(nodes)

    def coarsen(self) -> Coarsening:
        """Return the composition of the coarsened bodies, whose nodes coincide."""
        assert self._coarsening is not None
        return self._coarsening

    @cached_property
    def _coarsening(self) -> Coarsening | None:
        """The coarsening, None if the coarse nodes of the bodies do not coincide."""
        coarsenings = [_required(term.system, Multigrid).coarsen() for term in self.terms]
        system = self._on_nodes([(coarsening.system, coarsening.nodes) for coarsening in coarsenings])
        return None if system is None else Coarsening(system, coarsenings[0].nodes, coarsenings[0].prolong)

    def restrict(self, nodes: Indices) -> Subsystem | None:
        """Return the composition of the restricted bodies; None if these do not exist or have other nodes."""
        subsystems = []
        for term in self.terms:
            subsystem = _required(term.system, Restriction).restrict(nodes if term.nodes is None else term.nodes[nodes])
            if subsystem is None:
                return None
            subsystems.append((subsystem.system, subsystem.nodes))
        system = self._on_nodes(subsystems)
        return None if system is None else Subsystem(system, subsystems[0][1])

    def edge_correction(self, pressure: Array, indenter_edge: IndenterEdge | None = None) -> EdgeCorrection:
        """Return the sum of the corrections of all bodies, with the area fraction of the first one."""
        result = [
            _required(term.system, EdgeResolution).edge_correction(
                term.at_body(pressure),
                None if indenter_edge is None else term.edge_seen(indenter_edge),
            )
            for term in self.terms
        ]
        return EdgeCorrection(self._sum_blocks([one.extra_compliance for one in result]), result[0].area_fraction)

    def _sum(
        self, products: Sequence[FieldProduct], load: Array, loaded: Sequence[int], fields: Sequence[int]
    ) -> Array:
        """Return the product with the compliance by a product of each body."""
        contributions = (
            term.product(multiply, load, loaded, fields) for term, multiply in zip(self.terms, products, strict=True)
        )
        total = next(contributions)
        for contribution in contributions:
            total = total + contribution
        if self.extra_compliance is None:
            return total
        extra = self.extra_compliance[:, list(fields)][:, :, list(loaded)]
        summed: Array = total + np.einsum("nij,nj->ni", extra, load)
        return summed

    def _sum_blocks(self, blocks: Sequence[Array], extra: Array | None = None) -> Array:
        """Return the sum of blocks (n, f, f) of the bodies and of extra ones of the composition."""
        total: Array | int = 0 if extra is None else extra
        for term, block in zip(self.terms, blocks, strict=True):
            total = total + term.blocks_from_body(block)
        return np.asarray(total)

    def _on_nodes(self, systems: Sequence[tuple[ReducedSystem, Indices]]) -> "ComposedSystem | None":
        """Return the composition of systems on some nodes of each body; None if these nodes do not coincide."""
        (first, nodes), terms = systems[0], []
        for term, (system, members) in zip(self.terms, systems, strict=True):
            number = np.full(len(self.points), -1)
            number[members] = np.arange(len(members))
            partners = number[nodes if term.nodes is None else term.nodes[nodes]]
            if len(members) != len(nodes) or partners.min(initial=0) < 0:
                return None
            rotation = None if term.rotation is None else term.rotation.at(nodes)
            terms.append(Term(system, rotation, None if term.nodes is None else partners))
        extra = None if self.extra_compliance is None else self.extra_compliance[nodes]
        return compose(first, tuple(terms), self.frames[nodes], self.offset[nodes], extra)


def compose(
    geometry: ReducedSystem, terms: tuple[Term, ...], frames: Array, offset: Array, extra: Array | None = None
) -> ComposedSystem:
    """Return a composition with the points, weights and cells of a system, in the given frames (n, 3, 3)."""
    matrix = sum_matrices(terms, extra)
    return ComposedSystem(geometry.points, frames, geometry.weights, geometry.cells, offset, terms, extra, matrix)


def sum_matrices(terms: Sequence[Term], extra: Array | None = None) -> Array | None:
    """Return the compliance of a composition as (n, f, n, f) if all its bodies have theirs, else None."""
    total: Array | None = None
    for term in terms:
        matrix = term.system.dense()
        if matrix is None:
            return None
        changed = _matrix_in_frames(term, matrix)
        total = changed if total is None else total + changed
    if total is not None and extra is not None:
        total, nodes = total.copy(), np.arange(len(extra))
        total[nodes, :, nodes, :] += extra
    return total


def _matrix_in_frames(term: Term, matrix: Array) -> Array:
    """Return the matrix (n, f, n, f) of a body at the nodes and in the frames of the composition."""
    if term.nodes is not None:
        matrix = matrix[term.nodes][:, :, term.nodes]
    if term.rotation is None:
        return matrix
    entries = term.rotation.entries.items()
    by_rows, changed = np.zeros_like(matrix), np.zeros_like(matrix)
    for (i, j), entry in entries:
        by_rows[:, i] += (entry[:, None, None] if isinstance(entry, np.ndarray) else entry) * matrix[:, j]
    for (i, j), entry in entries:
        changed[..., i] += entry * by_rows[..., j]
    return changed


def _required(system: ReducedSystem, kind: type[C]) -> C:
    """Return a capability that the system is known to have."""
    capability = system.capability(kind)
    assert capability is not None
    return capability


def _in_all_fields(system: ReducedSystem) -> FieldProduct:
    return lambda load, _loaded, _fields: system.apply(load)


def _in_frames(inverse: Callable[[Array], Array], term: Term, fields: Sequence[int]) -> Callable[[Array], Array]:
    """Return an approximate inverse of a body in the frames of the composition."""
    if term.rotation is None:
        return inverse
    return lambda displacement: term.from_body(inverse(term.to_body(displacement, fields, fields)), fields, fields)
