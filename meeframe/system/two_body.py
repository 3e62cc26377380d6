"""Two deformable bodies as one reduced system: compliances add (Johnson, Contact Mechanics (1985), section 4.1).

The second body is described like the first, in its own coordinates, with its contact zone up; it is then turned over
about the x1 axis, (x, y, z) -> (x, -y, -z), onto the first. Its load is the reaction to that on the first body, and
fluxes that leave one body enter the other: load_second = -R^T load. Contact depends on relative displacements and on
jumps of the potentials, u - R u_second, so that

    offset = offset_first - R offset_second,    compliance = C_first + R C_second R^T,

where R changes components in the local frames of the second body to those of the first: diag(1, -1, -1, 1, 1) for
frames that coincide.
"""

from typing import Final, Protocol

import numpy as np
import scipy  # its parts load where they are used

from meeframe.common.errors import MeshError
from meeframe.fields import MECHANICAL, Array, Indices
from meeframe.system.composed import ComposedSystem, Rotation, Term, compose
from meeframe.system.reduced import ReducedSystem

TURN_OVER: Final = np.array([1.0, -1.0, -1.0])
COINCIDENT: Final = 1e-6
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
    """Return two bodies in contact as one reduced system.

    Displacements, potentials (as jumps) and loads are those of the first body relative to the second, in the frames of
    the first, and `recover` gives the fields of the first.

    Parameters
    ----------
    first, second_body
        Each in its own coordinates with its contact zone up.

    Raises
    ------
    MeshError
        As `match_nodes`.
    """
    partners, fields = match_nodes(first, second_body), range(first.n_fields)
    blocks = np.tile(np.eye(first.n_fields), (len(partners), 1, 1))
    rotated_frames = second_body.frames[partners] * TURN_OVER
    blocks[:, MECHANICAL, MECHANICAL] = first.frames @ rotated_frames.transpose(0, 2, 1)
    second = Term(second_body, Rotation.of(blocks), partners)
    offset = first.offset - second.from_body(second_body.offset, fields, fields)
    return compose(first, (Term(first), second), first.frames, offset)


def second_load(system: ComposedSystem, load: Array) -> Array:
    """Return the reaction (n, f) on the second body, at its nodes and in its frames, to a load (n, f) on the first."""
    return -system.terms[1].to_body(load, range(system.n_fields), range(system.n_fields))


def second_displacement(system: ReducedSystem, load: Array) -> Array | None:
    """Return the displacement (n, f) of the second body's surface, at the nodes and in the frames of the first body.

    It counts from the supports and potentials of the second body, wherever a load step has moved them. The displacement
    of the first body is this one plus that of the system. None if the system has a single body.
    """
    if not isinstance(system, ComposedSystem) or len(system.terms) != 2:
        return None
    body = system.terms[1].system
    displacement = body.offset + body.apply(second_load(system, load))
    return system.terms[1].from_body(displacement, range(system.n_fields), range(system.n_fields))


def match_nodes(first: ZoneGeometry, second_body: ZoneGeometry) -> Indices:
    """Return the node of the second body, turned over, at each node of the first, (n,).

    Raises
    ------
    MeshError
        Unless the nodes coincide (COINCIDENT), the two surfaces face each other, and they have the same division into
        elements (SAME_DIVISION). The message says how many nodes have no partner and by how much the first one misses.
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
    """Raise MeshError unless normals are opposite and weights equal at coinciding nodes."""
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
