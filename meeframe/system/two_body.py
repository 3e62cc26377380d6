"""Two deformable bodies as one reduced system: compliances add (Johnson, Contact Mechanics (1985), section 4.1).

The second body is described like the first, in its own coordinates, with its contact zone up; it is then turned over
about the x1 axis, (x, y, z) -> (x, -y, -z), onto the first. The load on the one is the reaction to that on the other,
and what leaves the one enters the other: load_counter = -R^T load. Contact sees relative displacements and the jump of
the potentials, u - R u_counter, so that

    offset = offset_first - R offset_counter,    compliance = C_first + R C_counter R^T,

where R turns components in the local frames of the second body into those of the first: diag(1, -1, -1, 1, 1) for
frames that coincide.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final, Protocol, final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.common.errors import MeshError
from meeframe.fields import MECHANICAL, Array, Indices
from meeframe.system.reduced import (
    BlockResponse,
    Edges,
    IndenterEdge,
    NodalFields,
    Prolongation,
    ReducedSystem,
    Subsystem,
    rescale_inverse,
)

TURN_OVER: Final = np.array([1.0, -1.0, -1.0])
COINCIDENT: Final = 1e-6
"""Nodes closer than this part of the zone's extent coincide."""
ROUND_OFF: Final = 1e-14
SAME_DIVISION: Final = 1e-3
"""Normals [rad] and weights (in parts of the largest) of coinciding nodes differ by less on zones divided alike."""


class ZoneGeometry(Protocol):
    """What is needed of a contact zone: points (n, 3), frames (n, 3, 3) and weights (n,) as in ReducedSystem."""

    @property
    def points(self) -> Array:
        """(n, 3) [m]."""

    @property
    def frames(self) -> Array:
        """(n, 3, 3), rows e1, e2, nu."""

    @property
    def weights(self) -> Array:
        """(n,) [m^2]."""


@final
@dataclass(frozen=True, eq=False)
class TwoBodySystem(ReducedSystem):
    """Two bodies in contact, seen from the first: displacement = that of the first less that of the second body.

    Displacements, potentials (as jumps) and loads are in the local frames of the first body; the load acts on it.

    first, second_body: the two bodies; partners: (n,) the node of the second body at each node of the first; rotation:
    (n, 5, 5), R of the module's text; matrix: (n, 5, n, 5), the sum of the compliances if both are matrices, else None.
    """

    first: ReducedSystem
    second_body: ReducedSystem
    partners: Indices
    rotation: Array
    matrix: Array | None

    def apply(self, load: Array) -> Array:
        """Relative displacement (n, 5) due to a load (n, 5)."""
        if self.matrix is not None:
            response: Array = np.tensordot(self.matrix, load, 2)
            return response
        return self.first.apply(load) - self._seen_from_first(self.second_body.apply(self.second_load(load)))

    def response(self, load: Array, fields: Sequence[int]) -> Array:
        """Relative displacement in k fields alone, (n, k) for load (n, 5)."""
        chosen = list(fields)
        if self.matrix is not None or not self._aligned:
            return self.apply(load)[:, chosen]
        theirs = self.second_body.response(self.second_load(load), chosen)[self.partners]
        return self.first.response(load, chosen) - self.rotation[:, chosen, chosen] * theirs

    def block_response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Relative displacement in k fields alone, (n, k), of loads (n, l) in l fields alone."""
        if self.matrix is not None or not self._aligned:
            return super().block_response(load, loaded, fields)
        return self._added_answers(self.first.block_response, self.second_body.block_response, load, loaded, fields)

    def rough_response(self) -> BlockResponse | None:
        """Those of both bodies, of which one may have none, where frames are aligned and no matrix is held.

        Off by up to ROUGH of what each body answers, also where the two cancel.
        """
        first, second_body = self.first.rough_response(), self.second_body.rough_response()
        if self.matrix is not None or not self._aligned or (first is None and second_body is None):
            return None
        answers = first or self.first.block_response, second_body or self.second_body.block_response
        return partial(self._added_answers, *answers)

    def _added_answers(
        self,
        first: BlockResponse,
        second_body: BlockResponse,
        load: Array,
        loaded: Sequence[int],
        fields: Sequence[int],
    ) -> Array:
        """`block_response` of aligned frames by answers of the two bodies."""
        borne, chosen = list(loaded), list(fields)
        reaction = np.empty_like(load)
        reaction[self.partners] = -self.rotation[:, borne, borne] * load
        theirs = second_body(reaction, borne, chosen)[self.partners]
        return first(load, borne, chosen) - self.rotation[:, chosen, chosen] * theirs

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """That of the first body, with the compliance that the other adds to each field at a node."""
        inverse = self.first.approximate_inverse(fields)
        if inverse is None:
            return None
        alone, together = (system.diagonal_blocks()[:, fields, fields] for system in (self.first, self))
        return rescale_inverse(inverse, alone, together)

    def extension(self, nodes: Indices) -> Prolongation | None:
        """That of the first body."""
        return self.first.extension(nodes)

    def within(self, nodes: Indices) -> Subsystem | None:
        """If both bodies have a part there and on the same nodes, as they have on grids that are divided alike."""
        part = self.first.within(nodes)
        theirs = None if part is None else self.second_body.within(self.partners[nodes])
        if part is None or theirs is None or len(part.kept) != len(theirs.kept):
            return None
        kept, number = part.kept, np.full(len(self.partners), -1)
        number[theirs.kept] = np.arange(len(theirs.kept))
        partners = number[self.partners[kept]]
        if partners.min() < 0:
            return None
        first = part.system
        geometry = first.points, first.frames, first.weights, first.cells, self.offset[kept]
        return Subsystem(TwoBodySystem(*geometry, first, theirs.system, partners, self.rotation[kept], None), kept)

    @cached_property
    def _aligned(self) -> bool:
        """Whether frames coincide but for signs and round-off."""
        return bool(np.abs(self.rotation[:, ~np.eye(self.n_fields, dtype=bool)]).max(initial=0.0) < ROUND_OFF)

    def diagonal_blocks(self) -> Array:
        """Relative response of each node to its own load, (n, 5, 5)."""
        return self._added(self.first.diagonal_blocks(), self.second_body.diagonal_blocks())

    def dense(self) -> Array | None:
        """The sum of the compliances, (n, 5, n, 5), if both are held as matrices."""
        return self.matrix

    def edges(self, pressure: Array, rim: IndenterEdge | None = None) -> Edges | None:
        """The edge of the contact between the nodes, if both bodies resolve it."""
        theirs = np.empty_like(pressure)
        theirs[self.partners] = pressure
        first, second_body = (
            self.first.edges(pressure, rim),
            self.second_body.edges(theirs, rim and self._second_edge(rim)),
        )
        if first is None or second_body is None:
            return None
        return Edges(self._added(first.own, second_body.own), first.area_fraction)

    def recover(self, load: Array) -> NodalFields:
        """Fields on the whole boundary of the first body; those of the other: counter.recover(second_load(load))."""
        return self.first.recover(load)

    def second_load(self, load: Array) -> Array:
        """The reaction (n, 5) on the second body, at its own nodes and in its own frames, to a load (n, 5)."""
        reaction = np.empty_like(load)
        reaction[self.partners] = -np.einsum("naj,na->nj", self.rotation, load)
        return reaction

    def _second_edge(self, rim: IndenterEdge) -> IndenterEdge:
        """The rim at the nodes and in the frames of the second body."""
        distance, outward, gap = np.empty_like(rim.distance), np.empty_like(rim.outward), np.empty_like(rim.gap)
        distance[self.partners], gap[self.partners] = rim.distance, rim.gap
        outward[self.partners] = np.einsum("naj,na->nj", self.rotation[:, :2, :2], rim.outward)
        return IndenterEdge(distance, outward, gap)

    def second_displacement(self, load: Array) -> Array:
        """Displacement (n, 5) of the second body's surface at the nodes and in the frames of the first body.

        It counts from the body's own supports and potentials, wherever a load step has moved them. The displacement of
        the first body is that of the pair and this one together.
        """
        return self._seen_from_first(self.second_body.offset + self.second_body.apply(self.second_load(load)))

    def _added(self, first: Array, second_body: Array) -> Array:
        """Own responses (n, 5, 5) of the two bodies together, each given at its own nodes and in its own frames."""
        added: Array = first + self.rotation @ second_body[self.partners] @ self.rotation.transpose(0, 2, 1)
        return added

    def _seen_from_first(self, displacement: Array) -> Array:
        return _turned(self.rotation, displacement[self.partners])


def combine_bodies(first: ReducedSystem, second_body: ReducedSystem) -> TwoBodySystem:
    """The two bodies in contact as one reduced system, seen from the first.

    first, counter: each in its own coordinates with its contact zone up. Raises MeshError as `match_nodes`.
    """
    partners = match_nodes(first, second_body)
    rotation = np.tile(np.eye(first.n_fields), (len(partners), 1, 1))
    turned = second_body.frames[partners] * TURN_OVER
    rotation[:, MECHANICAL, MECHANICAL] = first.frames @ turned.transpose(0, 2, 1)
    return TwoBodySystem(
        points=first.points,
        frames=first.frames,
        weights=first.weights,
        cells=first.cells,
        offset=first.offset - _turned(rotation, second_body.offset[partners]),
        first=first,
        second_body=second_body,
        partners=partners,
        rotation=rotation,
        matrix=_sum(first.dense(), second_body.dense(), partners, rotation),
    )


def match_nodes(first: ZoneGeometry, second_body: ZoneGeometry) -> Indices:
    """The node of the second body, turned over, at each node of the first, (n,).

    Raises MeshError, which says how many nodes have none and by how much the first of them misses, unless the nodes
    coincide (COINCIDENT), the two surfaces face each other, and they are divided into elements alike (SAME_DIVISION).
    """
    extent = float(np.linalg.norm(np.ptp(first.points, axis=0)))
    distances, nearest = scipy.spatial.cKDTree(second_body.points * TURN_OVER).query(first.points)
    missing = np.flatnonzero(~(distances <= COINCIDENT * extent))
    n, others = len(first.points), len(second_body.points)
    if missing.size:
        raise MeshError(
            f"the contact zones of the two bodies do not match: {missing.size} of the {n} nodes of the first meet none "
            f"of the {others} of the second body turned over about the x1 axis; the first, at "
            f"{first.points[missing[0]]} [m], misses by {distances[missing[0]]:.3g} m; "
            f"allowed: {COINCIDENT * extent:.3g} m"
        )
    partners: Indices = np.asarray(nearest, np.int64)
    if len(np.unique(partners)) != others or others != n:
        raise MeshError(
            f"the contact zones of the two bodies do not match: the first has {n} nodes, the second body {others}; "
            "allowed: the same division of both"
        )
    _check_alike(first, second_body, partners)
    return partners


def _check_alike(first: ZoneGeometry, second_body: ZoneGeometry, partners: Indices) -> None:
    """Raises MeshError unless normals are opposite and weights equal at coinciding nodes."""
    normals = first.frames[:, 2] + second_body.frames[partners, 2] * TURN_OVER
    askew = np.flatnonzero(np.linalg.norm(normals, axis=1) > SAME_DIVISION)
    if askew.size:
        raise MeshError(
            f"the contact zones of the two bodies do not face each other at {askew.size} of {len(partners)} nodes, "
            f"first at {first.points[askew[0]]} [m]; allowed: a second body whose surface, turned over about the x1 "
            "axis, lies on that of the first"
        )
    differences = np.abs(first.weights - second_body.weights[partners])
    unlike = np.flatnonzero(differences > SAME_DIVISION * np.abs(first.weights).max())
    if unlike.size:
        raise MeshError(
            f"the contact zones of the two bodies have the same nodes but other elements at {unlike.size} of "
            f"{len(partners)} nodes, first at {first.points[unlike[0]]} [m]; allowed: the same division of both"
        )


def _sum(first: Array | None, second_body: Array | None, partners: Indices, rotation: Array) -> Array | None:
    if first is None or second_body is None:
        return None
    own = second_body[partners[:, None], :, partners[None, :], :]  # (n, n, 5, 5): response, load, and their fields
    turned = rotation[:, None] @ own @ rotation.transpose(0, 2, 1)[None]
    matrix: Array = first + turned.transpose(0, 2, 1, 3)
    return matrix


def _turned(rotation: Array, vectors: Array) -> Array:
    turned: Array = np.einsum("naj,nj->na", rotation, vectors)
    return turned
