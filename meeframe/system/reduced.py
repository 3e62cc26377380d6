"""Contract of a formulation and of the reduced system it hands over: the seam between discretisation and contact."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array, Indices
from meeframe.mesh.body import Body

AnyArray = NDArray[Any]
BlockResponse = Callable[[Array, Sequence[int], Sequence[int]], Array]
"""Displacements (n, k) in k fields, of loads (n, l), the fields l of the loads, and k: see ReducedSystem."""
ROUGH: Final = 1e-4
"""Of the largest response in a field: how far a rough one is off, at most, or where weak couplings cancel, about."""
Progress = Callable[[str, float], None]
"""Called with the name of a stage and the fraction of it that is done."""


def silent(_stage: str, _fraction: float) -> None:
    """Progress that shows nothing."""


@dataclass(frozen=True, eq=False)
class NodalFields:
    """Fields on the boundary in SI units and global axes, for pictures and checks.

    points: (p, 3), repeated where tractions are discontinuous; cells: (meshio cell type, connectivity) pairs;
    values: (p, 5) extended displacement; fluxes: (p, 5) extended traction on the outward normal.
    """

    points: Array
    cells: tuple[tuple[str, Indices], ...]
    values: Array
    fluxes: Array


@dataclass(frozen=True, eq=False)
class ReducedSystem(ABC):
    """displacement = offset + compliance(load) on the n nodes of the contact zone. SI units, local frames.

    load (n, 5) = (t.e1, t.e2, t.nu, q, s): extended tractions as densities; t.nu <= 0 in compression, q = D.nu and
    s = B.nu outward. displacement (n, 5) = (u.e1, u.e2, u.nu, -phi, -psi). The two potentials are negated here, once,
    so that the compliance has a positive-definite symmetric part (docs/theory.md, Flipped rows).

    points: node coordinates, (n, 3) [m];
    frames: local frames, (n, 3, 3), rows e1, e2, nu, right-handed, nu outward;
    weights: integration weights, (n,) [m^2]: the resultant of nodal densities f is sum(weights * f);
    cells: (meshio cell type, connectivity) pairs of the contact zone, numbers into points;
    offset: displacement at zero load, due to the prescribed boundary data, (n, 5).
    """

    points: Array
    frames: Array
    weights: Array
    cells: tuple[tuple[str, Indices], ...]
    offset: Array

    @property
    def n_fields(self) -> int:
        """Number of fields: three displacements and the potentials."""
        return int(self.offset.shape[1])

    @abstractmethod
    def apply(self, load: Array) -> Array:
        """compliance(load), (n, 5) for load (n, 5)."""

    @abstractmethod
    def diagonal_blocks(self) -> Array:
        """Response of each node to its own load, (n, 5, 5)."""

    def own_response(self, fields: Sequence[int]) -> Array:
        """Diagonals (n, k) of these blocks in k fields, one after another."""
        blocks = self.diagonal_blocks()
        return np.array([blocks[:, field, field] for field in fields]).T

    @abstractmethod
    def dense(self) -> Array | None:
        """The compliance as (n, 5, n, 5) where it is held as a matrix, else None."""

    @abstractmethod
    def recover(self, load: Array) -> NodalFields:
        """Fields on the whole boundary for a load (n, 5) on the contact zone."""

    def response(self, load: Array, fields: Sequence[int]) -> Array:
        """compliance(load) in the given fields alone, (n, len(fields)), where that is cheaper than all five."""
        return self.apply(load)[:, list(fields)]

    def block_response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """compliance in k fields alone, (n, k), of loads (n, l) in l fields alone.

        Of loads in single precision it need be no more precise than they are, where that is cheaper.
        """
        whole = np.zeros((self.n_fields, len(load))).T
        whole[:, list(loaded)] = load
        return self.response(whole, fields)

    def rough_response(self) -> BlockResponse | None:
        """As block_response, in single precision and off by up to ROUGH, where that is cheaper, else None.

        Linear. Solvers find steps with it: it changes how many they take, never what they find.
        """
        return None

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """Loads (n, k) of the given k fields alone that roughly cause displacements (n, k) in them; None if unknown.

        Linear. Solvers precondition with it: it changes how fast they are, never what they find.
        """
        return None

    def extension(self, nodes: Indices) -> "Prolongation | None":
        """How displacements of nodes (f,), each once, go on beside them under a load on those alone, roughly; None if
        unknown. Of no nodes at all they go on as zeros, if not None.

        With it the approximate inverse is about that of the compliance restricted to those nodes. Used as that is.
        """
        return None

    def coarser(self) -> "Coarsening | None":
        """The same body on a coarser division of its zone, from which to start; None if there is none."""
        return None

    def within(self, nodes: Indices) -> "Subsystem | None":
        """The same body on a part of its zone that holds these nodes (k,), where products take much less time; None if
        there is none, or if no node is asked for."""
        return None

    def stencil(self, reach: int, fields: Sequence[int]) -> "Stencil | None":
        """What loads in some fields cause in these, so many places around their nodes; None if nodes lie on no lattice,
        or on one that is smaller."""
        return None

    def kept(self) -> Mapping[str, AnyArray] | None:
        """Arrays of numbers, by name, of which Formulation.restored makes the same system again; None where there is a
        matrix, which is kept instead, or where the system is made so fast that it need not be kept."""
        return None

    def edges(self, pressure: Array, rim: "IndenterEdge | None" = None) -> "Edges | None":
        """The edge of the contact between the nodes, for formulations that resolve it; None for those that do not.

        pressure: (n,) >= 0 [Pa], found with the edge resolved to nodes; rim: where the indenter ends, if it does.
        """
        return None


def rescale_inverse(inverse: Callable[[Array], Array], before: Array, after: Array) -> Callable[[Array], Array]:
    """Approximate inverse of a compliance whose nodes respond more to their own load than one whose `inverse` is known.

    before, after: (n, k) of both, each field's response to its own load. What is added acts at single nodes.
    """
    factor = np.sqrt(np.abs(before / after))
    return lambda displacement: factor * inverse(factor * displacement)


@dataclass(frozen=True, eq=False)
class Edges:
    """What a contact whose edge lies between the nodes changes at the nodes around it.

    own: (n, 5, 5) that comes to each node's response to its own load, as of diagonal_blocks, with a positive
    semidefinite symmetric part; area_fraction: (n,) in [0, 1], the part of each node's area that is in contact, above
    zero also at nodes just outside.
    """

    own: Array
    area_fraction: Array


@dataclass(frozen=True, eq=False)
class IndenterEdge:
    """Where an indenter ends, as nodes see it.

    distance: (n,) [m] from there, positive under the indenter, negative beside it, inf or -inf where it is far;
    outward: (n, 2) the direction that leads across it, in the local frame, zero where it is far; gap: (n,) [m] between
    body and indenter at nodes beside it, as if the indenter's surface went on, inf at all others.
    """

    distance: Array
    outward: Array
    gap: Array


@dataclass(frozen=True, eq=False)
class Prolongation:
    """From values at some nodes to values at all of them, and back; single precision.

    extended: (n,) from (f,), linear, the same at those nodes; gathered: (f,) from (n,), its adjoint in inner products
    weighted by the areas of the nodes.
    """

    extended: Callable[[Array], Array]
    gathered: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Stencil:
    """Responses on a lattice, the same around all nodes inside it; to about six digits.

    lattice: (nx, ny) the node at each place; periodic: whether it repeats itself; responses: (2 r + 1, 2 r + 1, 5, 5)
    displacement of a node to the load of another, entry [r + i, r + j] if it stands (i, j) places from that; zero in
    fields that were not asked for.
    """

    lattice: Indices
    periodic: bool
    responses: Array


@dataclass(frozen=True, eq=False)
class Coarsening:
    """A coarser reduced system. kept: (m,) the nodes of the finer system that are its nodes, in its order;
    prolong: gives nodal values (n, k) on the finer system for (m, k) on this one."""

    system: ReducedSystem
    kept: Indices
    prolong: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Subsystem:
    """A reduced system on a part of a zone: what loads there cause there. kept: (m,) the nodes of the whole zone that
    are its nodes, in its order."""

    system: ReducedSystem
    kept: Indices


@dataclass(frozen=True)
class Formulation(ABC):
    """A discretisation; the fields of a concrete class are its case-file keys."""

    @abstractmethod
    def check(self, body: Body) -> None:
        """Raises MeshError or CaseError if the body does not fit the formulation, before anything is computed."""

    def warnings(self, body: Body) -> tuple[str, ...]:
        """What may come out wrong for a body that check lets pass, and what to do, each in words."""
        return ()

    def is_periodic(self) -> bool:
        """Whether the contact zone is a period of an endless surface, whose contact ends at no edge of the zone."""
        return False

    def resolves_edges(self) -> bool:
        """Whether its systems say where the edge of the contact lies between the nodes, see ReducedSystem.edges."""
        return False

    @abstractmethod
    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Discretise the body, factorise once and condense to the contact zone.

        Raises as check, and MaterialError if the formulation does not take the material.
        """

    def restored(self, body: Body, kept: Mapping[str, AnyArray]) -> ReducedSystem:
        """The reduced system of a body by what ReducedSystem.kept gave of it, bit for bit the same for contact.

        Fields on the whole boundary may need the reduction again. Raises ValueError if these are no such arrays.
        Where a formulation does not say how, nothing is kept of its systems.
        """
        raise NotImplementedError(f"{type(self).__name__} does not restore systems")


def kept_of(formulation: Formulation, system: ReducedSystem) -> Mapping[str, AnyArray] | None:
    """What is kept of a system: nothing if its formulation, which may wrap another one, does not restore it."""
    return None if type(formulation).restored is Formulation.restored else system.kept()
