"""Check that prescribed values fix a body and each separate part of it."""

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.fields import ELECTRIC, MECHANICAL, N_MECHANICAL, Array, FieldSet
from meeframe.mesh.body import Body
from meeframe.mesh.parts import body_parts
from meeframe.mesh.surface import SurfaceMesh

Flags = NDArray[np.bool_]


def check_supports(body: Body) -> None:
    """Check that prescribed values fix the rigid motions and potentials of each separate part of a body.

    Loads on the contact zone fix nothing. A grounded electrode of a layer fixes the electric potential. A semi-infinite
    body needs no supports, since its fields vanish at infinity.

    Parameters
    ----------
    body : Body
        The body.

    Raises
    ------
    CaseError
        If a potential or a rigid motion is free; the message says of which part.
    """
    if body.mesh.semi_infinite:
        return
    fixed = np.zeros((len(body.mesh.points), body.fields.size), bool)
    for condition in body.conditions:
        if condition.kind == "value":
            fixed[body.mesh.group_points(condition.group), condition.field] = True
    if any(layer.interface.electrode == "grounded" for layer in body.layers.layers):
        fixed[:, ELECTRIC] = True
    parts = body_parts(body.mesh)
    n_parts = int(parts.max()) + 1
    for part in range(n_parts):
        members = parts == part
        name = _name(body.mesh, members) if n_parts > 1 else ""
        _check_part(body.mesh.points[members], fixed[members], body.fields, name)


def _check_part(points: Array, fixed: Flags, fields: FieldSet, name: str) -> None:
    """Check the supports of a separate part with points (p, 3); fixed: fields (p, fields) with prescribed values."""
    for field, scalar in enumerate(fields.scalars, N_MECHANICAL):
        if not fixed[:, field].any():
            raise CaseError(
                f"no boundary condition prescribes {scalar.value_name}{name}, so that its constant is undetermined"
            )
    free = 6 - _rank(points, fixed[:, MECHANICAL])
    if free:
        motions = f"{free} of the 6 rigid motions{name}"
        raise CaseError(f"the boundary conditions leave {motions} free; prescribe more of the displacement")


def _rank(points: Array, fixed: Flags) -> int:
    """Return the number of rigid motions a + w x (x - centre) / size that fixed displacements prevent.

    Centre and size are those of the supports, however small they are relative to the body. Supports thinner than about
    1e-6 of their size count as a line or plane, since coordinates read in single precision are not more accurate. A rod
    1e7 times as long as wide, clamped along a long face alone, is therefore rejected.
    """
    supports, axes = np.nonzero(fixed)
    if not len(supports):
        return 0
    positions, directions = points[supports], np.eye(3)[axes]
    arms = (positions - positions.mean(axis=0)) / np.ptp(positions, axis=0).max()
    return int(np.linalg.matrix_rank(np.concatenate([directions, np.cross(arms, directions)], axis=1), tol=1e-6))


def _name(mesh: SurfaceMesh, members: Flags) -> str:
    elements = sum(int(members[block.connectivity[:, 0]].sum()) for block in mesh.blocks)
    x, y, z = mesh.points[members][0]
    return f" of the separate part of {elements} elements at ({x:.6g}, {y:.6g}, {z:.6g}) [m]"
