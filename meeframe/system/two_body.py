"""Two deformable bodies as one reduced system: compliances add (Johnson, Contact Mechanics (1985), section 4.1).

The second body is described like the first, in its own coordinates, with its contact zone up; it is then turned over
about the x1 axis, (x, y, z) -> (x, -y, -z), onto the first. Its load is the reaction to that on the first body, and
fluxes that leave one body enter the other: load_second = -R^T load. Contact depends on relative displacements and on
jumps of the potentials, u - R u_second, so that

    offset = offset_first - R offset_second,    compliance = C_first + R C_second R^T,

where R changes components in the local frames of the second body to those of the first: diag(1, -1, -1, 1, 1) for
frames that coincide. Where the contact zones have different divisions, loads and displacements are transferred
(`meeframe.system.transfer`).
"""

from typing import Final, Protocol

import numpy as np
import scipy  # its parts load where they are used

from meeframe.common.errors import CaseError, MeshError
from meeframe.fields import MECHANICAL, Array, Indices
from meeframe.system.capabilities import InteriorFields, PointFields
from meeframe.system.composed import ComposedSystem, Rotation, Term, compose
from meeframe.system.reduced import Progress, ReducedSystem, silent
from meeframe.system.transfer import TransferredSystem, transfer_body

TURN_OVER: Final = np.array([1.0, -1.0, -1.0])
COINCIDENCE_TOLERANCE: Final = 1e-6
"""Largest distance of coinciding nodes, relative to the extent of the zone."""
SAME_DIVISION: Final = 1e-3
"""Largest difference of normals [rad] and of weights (relative to the largest) on zones with the same division."""


class ZoneGeometry(Protocol):
    """The geometry of a contact zone, as in ReducedSystem."""

    @property
    def points(self) -> Array:
        """Node coordinates, (n, 3) [m]."""

    @property
    def frames(self) -> Array:
        """Local frames, (n, 3, 3), rows e1, e2, nu."""

    @property
    def weights(self) -> Array:
        """Integration weights, (n,) [m^2]."""


def combine_bodies(first: ReducedSystem, second_body: ReducedSystem) -> ComposedSystem:
    """Return two bodies in contact as one reduced system, on the nodes of the first.

    Displacements, potentials (as jumps) and loads are those of the first body relative to the second, in the frames of
    the first, and `recover` gives the fields of the first.

    Parameters
    ----------
    first, second_body
        Each in its own coordinates with its contact zone up.

    Raises
    ------
    MeshError
        As `match_nodes`, and as `transfer_body` where the contact zones have different divisions.
    """
    partners, fields = match_nodes(first, second_body), range(first.n_fields)
    if partners is None:
        transferred = transfer_body(first, second_body, TURN_OVER)
        offset = first.offset - transferred.offset
        return compose(first, (Term(first), Term(transferred)), first.frames, offset)
    blocks = np.tile(np.eye(first.n_fields), (len(partners), 1, 1))
    rotated_frames = second_body.frames[partners] * TURN_OVER
    blocks[:, MECHANICAL, MECHANICAL] = first.frames @ rotated_frames.transpose(0, 2, 1)
    second = Term(second_body, Rotation.of(blocks), partners)
    offset = first.offset - second.from_body(second_body.offset, fields, fields)
    return compose(first, (Term(first), second), first.frames, offset)


def second_load(system: ComposedSystem, load: Array) -> Array:
    """Return the reaction (n, f) on the second body, at its nodes and in its frames, to a load (n, f) on the first."""
    fields, body = range(system.n_fields), system.terms[1].system
    if isinstance(body, TransferredSystem):
        return -body.transfer.to_body(load, fields, fields)
    return -system.terms[1].to_body(load, fields, fields)


def second_displacement(system: ReducedSystem, load: Array) -> Array | None:
    """Return the displacement (n, f) of the second body's surface, at the nodes and in the frames of the first body.

    It counts from the supports and potentials of the second body, wherever a load step has moved them. The displacement
    of the first body is this one plus that of the system. None if the system has a single body.
    """
    if not isinstance(system, ComposedSystem) or len(system.terms) != 2:
        return None
    term, fields = system.terms[1], range(system.n_fields)
    displacement = term.system.offset - term.system.apply(term.to_body(load, fields, fields))
    return term.from_body(displacement, fields, fields)


def interior_of_second(system: ReducedSystem, load: Array, points: Array, progress: Progress = silent) -> PointFields:
    """Return the fields inside the second body for a load (n, fields) on the first.

    Parameters
    ----------
    system
        Two bodies in contact, from `combine_bodies`.
    load
        Load on the first body, as in `ReducedSystem.apply`.
    points
        Positions (m, 3) in the global axes of the first body [m].
    progress
        As for `InteriorFields.evaluate`.

    Returns
    -------
    PointFields
        Fields in the global axes of the first body. Values count from the supports and potentials of the second body,
        wherever a load step has moved them.

    Raises
    ------
    CaseError
        If there is no second body, or as `InteriorFields.evaluate`, with points in the coordinates of that body.
    """
    if not isinstance(system, ComposedSystem) or len(system.terms) != 2:
        raise CaseError("there is no second body; allowed: the fields of the first")
    second = system.terms[1].system
    interior = required_interior(second.body if isinstance(second, TransferredSystem) else second)
    fields = interior.evaluate(second_load(system, load), points * TURN_OVER, progress)
    components = np.ones(system.n_fields)
    components[MECHANICAL] = TURN_OVER
    return PointFields(
        fields.points * TURN_OVER,
        fields.values * components,
        fields.gradients * components[:, None] * TURN_OVER,
        fields.fluxes * TURN_OVER[:, None] * components,
    )


def required_interior(system: ReducedSystem) -> InteriorFields:
    """Return the interior fields of a reduced system. Raises CaseError if it has none."""
    interior = system.capability(InteriorFields)
    if interior is None:
        raise CaseError(
            "there are no fields inside the body: its formulation provides none (no capability InteriorFields; a half "
            "space that heat expands has none), or the reduced system was read from a cache"
        )
    return interior


def match_nodes(first: ZoneGeometry, second_body: ZoneGeometry) -> Indices | None:
    """Return the node of the second body, turned over, at each node of the first.

    Parameters
    ----------
    first, second_body
        The zones, each in the coordinates of its body.

    Returns
    -------
    Indices or None
        (n,) numbers of nodes; None unless all coincide (COINCIDENCE_TOLERANCE) and have equal weights (SAME_DIVISION).

    Raises
    ------
    MeshError
        If the nodes coincide but the two surfaces do not face each other.
    """
    if len(first.points) != len(second_body.points):
        return None
    extent = float(np.linalg.norm(np.ptp(first.points, axis=0)))
    distances, nearest = scipy.spatial.cKDTree(second_body.points * TURN_OVER).query(first.points)
    partners: Indices = np.asarray(nearest, np.int64)
    if not (distances <= COINCIDENCE_TOLERANCE * extent).all() or len(np.unique(partners)) != len(partners):
        return None
    normals = first.frames[:, 2] + second_body.frames[partners, 2] * TURN_OVER
    askew = np.flatnonzero(np.linalg.norm(normals, axis=1) > SAME_DIVISION)
    if askew.size:
        raise MeshError(
            f"the contact zones of the two bodies do not face each other at {askew.size} of {len(partners)} nodes, "
            f"first at {first.points[askew[0]]} [m]; allowed: a second body whose surface, turned over about the x1 "
            "axis, lies on that of the first"
        )
    differences = np.abs(first.weights - second_body.weights[partners])
    return partners if differences.max() <= SAME_DIVISION * np.abs(first.weights).max() else None
