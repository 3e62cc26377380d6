"""Capabilities: everything that a reduced system may be able to do beyond its four required methods.

Each capability is a small abstract class. A reduced system that has one inherits from it, and callers ask for it by
``system.capability(Multigrid)``, which returns an object of that class or None. A system whose capability depends on
the instance overrides `ReducedSystem.capability` so that absence is visible before any method is called.

Most capabilities make solvers faster. None of these changes what a solver finds, because convergence is always tested
with `ReducedSystem.apply`; `EdgeResolution` is the exception, it changes the discrete problem. `InteriorFields`
evaluates a solution inside the body.
`meeframe.testing.check_formulation` compares every capability with `apply`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import N_FIELDS, Array, Indices
from meeframe.system.reduced import Progress, ReducedSystem, silent

AnyArray = NDArray[Any]
"""Array of any type, in single or double precision."""
FieldProduct = Callable[[Array, Sequence[int], Sequence[int]], Array]
"""A function as `FieldwiseApply.apply_fields`: displacement (n, k) of (load (n, l), loaded fields, wanted fields)."""


class FieldwiseApply(ABC):
    """Products with the compliance in some of the fields, at a lower cost than `apply` in all of them.

    Frictionless contact without conduction then needs one field in place of all.
    """

    @abstractmethod
    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in some fields due to a load in some fields.

        Parameters
        ----------
        load : (n, l) array
            Load in the fields `loaded`; all other fields are unloaded. It must not be changed.
        loaded, fields : sequences of int
            Numbers of l and k fields, each once and in any order.

        Returns
        -------
        (n, k) array
            Columns in the order of `fields`. For a load in single precision, single precision is enough.
        """

    @abstractmethod
    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of `ReducedSystem.diagonal_blocks` in some fields.

        Parameters
        ----------
        fields : sequence of int
            Numbers of k fields.

        Returns
        -------
        (n, k) array
            Response of each node to its own unit load in the same field.
        """


class ApproximateInverse(ABC):
    """An approximate inverse of the compliance, with which solvers precondition."""

    @abstractmethod
    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """Return an approximate inverse of the compliance in some fields.

        Parameters
        ----------
        fields : sequence of int
            Numbers of k fields.

        Returns
        -------
        callable or None
            Linear map from displacements (n, k) to loads (n, k) that cause them; None if there is no useful inverse
            for these fields.
        """

    def series_inverse(self, fields: Sequence[int], resistances: Array) -> Callable[[Array], Array] | None:
        """Return an approximate inverse of the compliance in series with resistances; None, its absence, by default.

        Parameters
        ----------
        fields : sequence of int
            Numbers of k fields.
        resistances : Array
            (k,), the same at all nodes, of a poorly conducting contact. Each adds its product with the load of its
            field to the displacement.

        Returns
        -------
        callable or None
            Linear map from the sums (n, k) to loads (n, k) that cause them.
        """
        return None

    def prolongation(self, nodes: Indices) -> "Prolongation | None":
        """Return a prolongation of displacements from some nodes to all nodes; None, for that by zeros, by default.

        Parameters
        ----------
        nodes : Indices
            Numbers of the nodes, (f,), each once.

        Returns
        -------
        Prolongation or None
            The prolongation. None if there is none better than that by zeros.

        Notes
        -----
        Among all displacements that agree at the nodes, that of a load on these nodes alone has the least
        energy. The closer a prolongation is to it, the better the approximate inverse, between prolongation and
        restriction, approximates the inverse of the compliance restricted to the nodes.
        """
        return None


@dataclass(frozen=True, eq=False)
class Prolongation:
    """A linear map from values at some nodes to values at all nodes, and its adjoint; in single precision.

    Attributes
    ----------
    prolong : callable
        Returns values (n,) for values (f,), which are unchanged at their nodes.
    restrict : callable
        Returns values (f,) for values (n,): the adjoint in inner products weighted by the areas of the nodes.
    """

    prolong: Callable[[Array], Array]
    restrict: Callable[[Array], Array]


class Multigrid(ABC):
    """A coarser division of the contact zone, from whose solution solvers start."""

    @abstractmethod
    def coarsen(self) -> "Coarsening":
        """Return the next coarser system. On the coarsest division `capability` returns None.

        Returns
        -------
        Coarsening
            The coarser system and the transfer of values.
        """


class MaterialFlow(ABC):
    """Material that flows through the zone from node to node, and whose displacements are changes from one to the next.

    Slips of the same material then add up along a line of nodes.
    """

    @property
    @abstractmethod
    def flow_lines(self) -> Indices:
        """(k, m) numbers of the k nodes on each of m lines, from where the material enters."""

    @abstractmethod
    def inverse_with_friction(self, fields: Sequence[int], resistance: Array) -> Callable[[Array], Array] | None:
        """Return an approximate inverse of the compliance in series with friction.

        Changes along a line of flow are almost zero for some waves, unless friction resists.

        Parameters
        ----------
        fields : sequence of int
            Numbers of k fields.
        resistance : Array
            (n,) of the nodes. It adds its product with a tangential load to the displacement.

        Returns
        -------
        callable or None
            Linear map from the sums (n, k) to loads (n, k) that cause them; None if there is no useful inverse.
        """


class ZoneRecovery:
    """Capability of a system whose boundary is its contact zone alone, as of a half space that is free beside it.

    Displacement and load of the zone are then all that `recover` returns, in global axes.
    """


class LatticeStencil(ABC):
    """Responses that depend on the offset between two nodes of a lattice alone, as on a regular grid on a half space.

    Nodes around the edge of the contact and of stick are then relaxed among themselves.
    """

    @abstractmethod
    def stencil(self, radius: int) -> "Stencil | None":
        """Return the responses of nodes to loads on the nodes around them.

        Parameters
        ----------
        radius : int
            Largest offset r along each axis, in places of the lattice.

        Returns
        -------
        Stencil or None
            Responses up to this offset. None if the lattice is smaller than that.
        """


class Restriction(ABC):
    """Reduction to a part of the contact zone, where products take much less time."""

    @abstractmethod
    def restrict(self, nodes: Indices) -> "Subsystem | None":
        """Return the system on a part of the zone that contains some nodes.

        The part may contain more nodes.

        Parameters
        ----------
        nodes : Indices
            (k,) numbers of the nodes.

        Returns
        -------
        Subsystem or None
            The smaller system. None if there is no such part, if it would be nearly as large as the zone, or if no
            nodes are given.
        """


class Persistence(ABC):
    """A system without a matrix that can be stored as arrays.

    Its formulation is a `meeframe.formulations.base.PersistentFormulation`, which restores the system.
    """

    @abstractmethod
    def to_arrays(self) -> Mapping[str, AnyArray]:
        """Return the arrays from which `PersistentFormulation.from_arrays` restores the system.

        Returns
        -------
        dict of str to array
            Arrays of numbers by name.
        """


class EdgeResolution(ABC):
    """Contact edges between the nodes: nodes near the edge represent the part of their area that is in contact."""

    @abstractmethod
    def edge_correction(self, pressure: Array, indenter_edge: "IndenterEdge | None" = None) -> "EdgeCorrection":
        """Return the changes of the system due to a contact edge between the nodes.

        Parameters
        ----------
        pressure : (n,) array
            Contact pressure >= 0 [Pa], found with the contact edge at nodes.
        indenter_edge : IndenterEdge, optional
            The edge of the indenter, if it has one in the zone.

        Returns
        -------
        EdgeCorrection
            Extra compliances and area fractions of the nodes near the edge.
        """


INTERIOR_STAGE: Final = "interior fields"
"""Name of the stage in which fields inside a body are evaluated."""


class InteriorFields(ABC):
    """Fields at points inside the body, for a load on the contact zone."""

    @abstractmethod
    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> "PointFields":
        """Return the fields at points inside the body.

        Parameters
        ----------
        load : (n, f) array
            Load as in `ReducedSystem.apply`.
        points : (m, 3) array
            Positions in global axes [m].
        progress : callable, optional
            Function that receives the stage `INTERIOR_STAGE` and the fraction of the points that is done.

        Returns
        -------
        PointFields
            Fields at the m points, in SI units and global axes.

        Raises
        ------
        CaseError
            If a point is outside the body, or closer to its surface than the formulation can evaluate.
        """


@dataclass(frozen=True, eq=False)
class PointFields:
    """Fields at points inside a body, in SI units and global axes.

    Attributes
    ----------
    points : Array
        (m, 3) [m].
    values : Array
        (m, f) displacements and potentials; unlike in a displacement of `ReducedSystem`, potentials are not negated.
    gradients : Array
        (m, f, 3) derivatives of the values with respect to the position.
    fluxes : Array
        (m, 3, f) stress and flux densities: entry (i, J) is the component i of the flux of field J. Columns 0 to 2 are
        the stress, the others the electric displacement D, the magnetic flux density B and fluxes of further fields.
    """

    points: Array
    values: Array
    gradients: Array
    fluxes: Array

    @classmethod
    def of(cls, points: Array, values: Array, gradients: Array, stiffness: Array) -> "PointFields":
        """Return the fields of a homogeneous body.

        Parameters
        ----------
        points : Array
            Positions, (m, 3) [m].
        values, gradients : Array
            Displacement and potentials, (m, f), and their gradients, (m, f, 3), in SI units.
        stiffness : Array
            Extended stiffness C_iJKm, (3, f, f, 3), in SI units.

        Returns
        -------
        PointFields
            The fields, with stress and flux densities.
        """
        fluxes = np.einsum("ijkm,pkm->pij", stiffness, gradients, optimize=True)
        return cls(points, values, gradients, fluxes)

    def with_heat(self, moduli: Array, column: int) -> "PointFields":
        """Return the fields with the stress and fluxes that the temperature causes.

        Parameters
        ----------
        moduli : Array
            Thermal moduli, (3, N_FIELDS), SI units.
        column : int
            Column of the temperature among the fields.

        Returns
        -------
        PointFields
            The fields.
        """
        fluxes = self.fluxes.copy()
        fluxes[:, :, :N_FIELDS] -= moduli * self.values[:, column, None, None]
        return replace(self, fluxes=fluxes)


@dataclass(frozen=True, eq=False)
class Coarsening:
    """A coarser reduced system.

    Attributes
    ----------
    system : ReducedSystem
        The coarser system, with m nodes.
    nodes : Indices
        (m,) nodes of the finer system that are the nodes of the coarser one, in its order.
    prolong : callable
        Values (n, k) at the nodes of the finer system from values (m, k).
    """

    system: ReducedSystem
    nodes: Indices
    prolong: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Subsystem:
    """A reduced system on a part of a zone: displacements there due to loads there.

    Attributes
    ----------
    system : ReducedSystem
        The system on the part, with m nodes.
    nodes : Indices
        (m,) nodes of the whole zone that are the nodes of the part, in its order.
    """

    system: ReducedSystem
    nodes: Indices


@dataclass(frozen=True, eq=False)
class Stencil:
    """Responses on a lattice, accurate to about six digits.

    Attributes
    ----------
    lattice : Indices
        (nx, ny), node at each place.
    periodic : bool
        True if the lattice repeats itself.
    responses : Array
        (2 r + 1, 2 r + 1, f, f): entry [r + i, r + j] is the displacement of a node due to the load on the node that
        lies (i, j) places before it.
    """

    lattice: Indices
    periodic: bool
    responses: Array


@dataclass(frozen=True, eq=False)
class EdgeCorrection:
    """Changes at the nodes near a contact edge that lies between nodes.

    Attributes
    ----------
    extra_compliance : Array
        (n, f, f) addition to the diagonal blocks, with positive semidefinite symmetric parts.
    area_fraction : Array
        (n,) fraction of the area of each node that is in contact, in [0, 1]; also positive at nodes just outside.
    """

    extra_compliance: Array
    area_fraction: Array


@dataclass(frozen=True, eq=False)
class IndenterEdge:
    """The edge of an indenter as seen from the nodes.

    Attributes
    ----------
    distance : Array
        (n,) [m] from the edge, positive under the indenter and negative outside; inf or -inf far away.
    outward : Array
        (n, 2) direction across the edge in the local frame, zero far away.
    gap : Array
        (n,) [m] between the body and the continued surface of the indenter at nodes just outside, inf elsewhere.
    """

    distance: Array
    outward: Array
    gap: Array


def apply_fields(system: ReducedSystem, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
    """Return the displacement in some fields due to a load in some fields, for any system.

    Without the capability `FieldwiseApply` the system computes all fields by `apply`.

    Parameters
    ----------
    system : ReducedSystem
        The system.
    load : (n, l) array
        Load in the fields `loaded`.
    loaded, fields : sequences of int
        Numbers of l and k fields.

    Returns
    -------
    (n, k) array
        Columns in the order of `fields`.
    """
    fieldwise = system.capability(FieldwiseApply)
    if fieldwise is not None:
        return fieldwise.apply_fields(load, loaded, fields)
    full = np.zeros((system.n_fields, len(load)), load.dtype).T
    full[:, list(loaded)] = load
    return system.apply(full)[:, list(fields)]


def apply_load(system: ReducedSystem, load: Array, fields: Sequence[int]) -> Array:
    """Return the displacement (n, k) in k fields due to a load (n, f), skipping fields that are unloaded."""
    loaded = np.flatnonzero(load.any(axis=0)).tolist()
    some = load if len(loaded) == system.n_fields else load.T[loaded].T
    return apply_fields(system, some, loaded, fields)


def diagonal(system: ReducedSystem, fields: Sequence[int]) -> Array:
    """Return the diagonals of the diagonal blocks of any system in some fields.

    Parameters
    ----------
    system : ReducedSystem
        The system.
    fields : sequence of int
        Numbers of k fields.

    Returns
    -------
    (n, k) array
        Response of each node to its own unit load in the same field.
    """
    fieldwise = system.capability(FieldwiseApply)
    if fieldwise is not None:
        return fieldwise.diagonal(fields)
    blocks = system.diagonal_blocks()
    return np.array([blocks[:, field, field] for field in fields]).T


def rescale_inverse(inverse: Callable[[Array], Array], before: Array, after: Array) -> Callable[[Array], Array]:
    """Return an approximate inverse of a compliance that exceeds another one at single nodes.

    Parameters
    ----------
    inverse : callable
        Approximate inverse of the other compliance.
    before, after : (n, k) arrays
        Diagonals of the other compliance and of the new one.

    Returns
    -------
    callable
        Linear map from displacements (n, k) to loads (n, k).
    """
    factor = np.sqrt(np.abs(before / after))
    return lambda displacement: factor * inverse(factor * displacement)
