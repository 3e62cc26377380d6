"""Check that prescribed values hold a body and every separate part of it."""

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.fields import MECHANICAL, N_MECHANICAL, Array, FieldSet
from meeframe.mesh.body import Body
from meeframe.mesh.parts import body_parts
from meeframe.mesh.surface import SurfaceMesh

Flags = NDArray[np.bool_]


def check_supports(body: Body) -> None:
    """Raise CaseError unless prescribed values fix the rigid motions and potentials of every separate part.

    Loads on the contact zone fix nothing. The fields of a semi-infinite body vanish at infinity: it needs no supports.
    """
    if body.mesh.semi_infinite:
        return
    fixed = np.zeros((len(body.mesh.points), body.fields.size), bool)
    for condition in body.conditions:
        if condition.kind == "value":
            fixed[body.mesh.group_points(condition.group), condition.field] = True
    parts = body_parts(body.mesh)
    n_parts = int(parts.max()) + 1
    for part in range(n_parts):
        here = parts == part
        _check_part(body.mesh.points[here], fixed[here], body.fields, _name(body.mesh, here) if n_parts > 1 else "")


def _check_part(points: Array, fixed: Flags, fields: FieldSet, name: str) -> None:
    """Raise CaseError unless the prescribed values (p, fields) fix a part with points (p, 3)."""
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
    """Return the number of the rigid motions a + w x (x - centre) / size that displacements fixed at points (p, 3)
    prevent.

    Centre and size are those of the supports, however small they are beside the body. What of the supports is thinner
    than about 1e-6 of their size counts as a line or plane, as coordinates read in single precision are no better: a
    rod 1e7 times as long as wide, clamped along a long face alone, is refused.
    """
    supports, axes = np.nonzero(fixed)
    if not len(supports):
        return 0
    at, along = points[supports], np.eye(3)[axes]
    arms = (at - at.mean(axis=0)) / np.ptp(at, axis=0).max()
    return int(np.linalg.matrix_rank(np.concatenate([along, np.cross(arms, along)], axis=1), tol=1e-6))


def _name(mesh: SurfaceMesh, here: Flags) -> str:
    elements = sum(int(here[block.connectivity[:, 0]].sum()) for block in mesh.blocks)
    x, y, z = mesh.points[here][0]
    return f" of the separate part of {elements} elements at ({x:.6g}, {y:.6g}, {z:.6g}) [m]"
