"""Prescribed and shared values of the nodes: boundary conditions, electrodes, continuity at interfaces."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from meeframe.plugin import ELECTRIC, Array, CaseError, Indices
from meeframe.plugin.boundary_elements import NONE, Layout
from meeframe_skfem.layers import InterfaceNodes, LayeredMesh

Flags = NDArray[np.bool_]

CONFLICT_TOLERANCE: Final = 1e-9  # relative difference of potentials that are the same


@dataclass(frozen=True, eq=False)
class Constraints:
    """Known values, and values that are equal to others.

    Attributes
    ----------
    masters : Indices
        Number of the value, among p nodes times fields, to which each one is equal, (p fields,).
    values : Array
        Known values in units of the system, zero where unknown, (p fields,).
    unknown : Indices
        Masters whose value is unknown, rising, (u,).
    """

    masters: Indices
    values: Array
    unknown: Indices

    def merge(self, matrix: csr_array) -> csr_array:
        """Return a matrix, (p fields, p fields), with rows and columns of equal values added to those of masters."""
        return csr_array(self.merge_rows(csr_array(self.merge_rows(matrix).T)).T)

    def merge_rows(self, matrix: csr_array) -> csr_array:
        """Return a matrix, (p fields, n), with rows of equal values added to those of masters."""
        size = len(self.masters)
        if (self.masters == np.arange(size)).all():
            return matrix
        return csr_array(coo_array((np.ones(size), (self.masters, np.arange(size))), shape=(size, size)) @ matrix)

    def merge_forces(self, forces: Array) -> Array:
        """Return forces (p, fields) as those of masters, (p fields,)."""
        return np.bincount(self.masters, forces.ravel(), minlength=len(self.masters))

    def expand(self, unknown: Array, known: Array | float = 0.0) -> Array:
        """Return all values (p fields,) of the unknown ones (u,) and the known ones, (p fields,) or zero."""
        values = np.zeros(len(self.masters)) + known
        values[self.unknown] = unknown
        return values[self.masters]


def constrain(layered: LayeredMesh, nodes: Indices, layout: Layout) -> Constraints:
    """Collect the constraints of a body.

    A floating electrode that touches a face with a prescribed potential has that potential.

    Parameters
    ----------
    layered : LayeredMesh
        The mesh.
    nodes : Indices
        Its nodes on the surface, in the order of the layout.
    layout : Layout
        Boundary conditions on the surface.

    Raises
    ------
    CaseError
        If an electrode has more than one potential.
    """
    n_points, n_fields = len(layered.mesh.points), layout.value_data.shape[1]
    n_originals = int(layered.originals.max()) + 1
    known, data = np.zeros((n_originals, n_fields), bool), np.zeros((n_originals, n_fields))
    known[nodes], data[nodes] = layout.value_column == NONE, layout.value_data
    known, data = known[layered.originals], data[layered.originals]
    masters = np.arange(n_points * n_fields).reshape(n_points, n_fields)
    for interface in layered.interfaces:
        held = ~interface.jumps
        masters[np.ix_(interface.lower, held)] = masters[np.ix_(interface.upper, held)]
        if interface.electrode is not None:
            _add_electrode(interface, masters[:, ELECTRIC], known[:, ELECTRIC], data[:, ELECTRIC])
    flat = masters.ravel()
    unknown = np.flatnonzero(~known.ravel() & (flat == np.arange(flat.size)))
    return Constraints(flat, np.where(known, data, 0.0).ravel(), unknown)


def _add_electrode(interface: InterfaceNodes, masters: Indices, known: Flags, potentials: Array) -> None:
    """Enter an electrode into numbers of masters, which potentials are known, and the potentials, (p,) each."""
    nodes = interface.upper
    prescribed = potentials[nodes[known[nodes]]]
    if interface.electrode == "floating":
        masters[interface.lower] = masters[nodes] = masters[nodes[0]]
        if not len(prescribed):
            return
    potential = 0.0 if interface.electrode == "grounded" else prescribed[0]
    _check_potentials(prescribed, potential)
    known[nodes], potentials[nodes] = True, potential


def _check_potentials(values: Array, expected: float) -> None:
    tolerance = CONFLICT_TOLERANCE * np.abs(values).max(initial=0.0)
    if (np.abs(values - expected) > tolerance).any():
        raise CaseError(
            "electrode of a layer: boundary conditions prescribe another electric potential on faces that it touches; "
            "allowed: zero beside a grounded electrode, one potential beside a floating one"
        )
