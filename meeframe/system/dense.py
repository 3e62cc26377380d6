"""Reduced systems stored as one matrix, as made by dense boundary elements and finite elements."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, final

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.fields import MECHANICAL, N_MECHANICAL, POTENTIALS, Array
from meeframe.mesh.regular import Cells
from meeframe.system.capabilities import EdgeResolution, InteriorFields
from meeframe.system.reduced import NodalFields, ReducedSystem

C = TypeVar("C")


@final
@dataclass(frozen=True, eq=False)
class DenseSystem(ReducedSystem):
    """A reduced system with displacement = offset + matrix : load.

    Attributes
    ----------
    points, frames, weights, cells, offset
        As in `ReducedSystem`.
    matrix : Array
        (n, fields, n, fields), response (node, field) to a load (node, field), with the signs of `ReducedSystem`.
    recovery : callable
        Function that returns the fields on the whole boundary for a load (n, fields).
    interior : InteriorFields or None
        The capability to evaluate fields inside the body, if the formulation has it.
    edges : EdgeResolution or None
        The capability to resolve contact edges between the nodes, if the formulation has it.
    """

    matrix: Array
    recovery: Callable[[Array], NodalFields]
    interior: InteriorFields | None = None
    edges: EdgeResolution | None = None

    def capability(self, kind: type[C]) -> C | None:
        """Return the capability to evaluate fields inside the body, or to resolve edges, if there is one.

        Parameters
        ----------
        kind : type
            Class of the capability.

        Returns
        -------
        object or None
            An object of this class.
        """
        if isinstance(self.interior, kind):
            return self.interior
        return self.edges if kind is EdgeResolution and isinstance(self.edges, kind) else super().capability(kind)

    def apply(self, load: Array) -> Array:
        """Return the displacement due to a load by one matrix-vector product.

        Parameters
        ----------
        load : Array
            (n, fields) load.

        Returns
        -------
        Array
            Compliance(load), (n, fields).
        """
        size = self.offset.size
        response: Array = self.matrix.reshape(size, size) @ np.ravel(load)
        return response.reshape(load.shape)

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load, (n, f, f)."""
        nodes = np.arange(len(self.offset))
        return self.matrix[nodes, :, nodes, :]

    def dense(self) -> Array | None:
        """Return the compliance, (n, f, n, f)."""
        return self.matrix

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the whole boundary.

        Parameters
        ----------
        load : Array
            (n, fields) load on the contact zone.

        Returns
        -------
        NodalFields
            Extended displacements and tractions in SI units and global axes.
        """
        return self.recovery(load)


def with_matrix(system: ReducedSystem) -> DenseSystem:
    """Return a system with its compliance stored as a matrix, of which fields inside the body are not evaluated.

    Parameters
    ----------
    system : ReducedSystem
        System of few nodes: one product for each unit load makes the matrix.

    Returns
    -------
    DenseSystem
        The same system.
    """
    data = system.points, system.frames, system.weights, system.cells, system.offset
    return DenseSystem(*data, _matrix_of(system), system.recover, None, system.capability(EdgeResolution))


@memoize_by_identity
def _matrix_of(system: ReducedSystem) -> Array:
    """Return the compliance (n, f, n, f) of a system."""
    load, responses = np.zeros_like(system.offset), []
    for index in np.ndindex(load.shape):
        load[index] = 1.0
        responses.append(system.apply(load))
        load[index] = 0.0
    return np.stack(responses, axis=2).reshape(*load.shape, *load.shape)


def in_local_frames(
    points: Array,
    frames: Array,
    weights: Array,
    cells: Cells,
    offset: Array,
    compliance: Array,
    fields: Callable[[Array], NodalFields],
) -> DenseSystem:
    """Return the reduced system of a linear relation in global axes.

    The relation is values (n, f) = offset + compliance : extended tractions (n, f).

    Parameters
    ----------
    points, frames, weights, cells
        As in `ReducedSystem`.
    offset : Array
        Extended displacement at zero traction, (n, f), SI units, potentials not negated.
    compliance : Array
        Extended displacement (node, field) due to an extended traction (node, field), (n, f, n, f), SI units.
    fields : callable
        Function that returns the fields on the whole boundary for extended tractions (n, f) in global axes.

    Returns
    -------
    DenseSystem
        The system, with potentials negated.
    """
    n_fields = offset.shape[1]
    to_load = np.zeros((len(frames), n_fields, n_fields))
    to_load[:, MECHANICAL, MECHANICAL] = frames
    to_load[:, range(N_MECHANICAL, n_fields), range(N_MECHANICAL, n_fields)] = 1.0
    to_displacement = to_load.copy()
    to_displacement[:, POTENTIALS] *= -1.0
    matrix = np.einsum("naj,njmk,mbk->namb", to_displacement, compliance, to_load, optimize=True)
    return DenseSystem(
        points=points,
        frames=frames,
        weights=weights,
        cells=cells,
        offset=np.einsum("naj,nj->na", to_displacement, offset),
        matrix=np.ascontiguousarray(matrix),
        recovery=lambda load: fields(np.einsum("naj,na->nj", to_load, load)),
    )
