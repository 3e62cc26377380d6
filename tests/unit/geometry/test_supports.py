"""Each separate component of a body must be supported; cavities belong to the component around them."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4
from meeframe.formulations.dense_bem import DenseBEM, formulation
from meeframe.material import library_material
from meeframe.mesh import box_mesh, check_mesh, check_supports
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import reflection


def cube(size: float, shift: float, name: str) -> SurfaceMesh:
    mesh = box_mesh((size,) * 3, (1, 1, 1), Quad4())
    names = tuple(f"{name} {group}" for group in mesh.group_names)
    return replace(mesh, points=mesh.points - mesh.points.mean(axis=0) + [shift, 0.0, 0.0], group_names=names)


def joined(*meshes: SurfaceMesh) -> SurfaceMesh:
    blocks, n_points, names = [], 0, ()
    for mesh in meshes:
        for block in mesh.blocks:
            cells, groups = block.connectivity + n_points, block.groups + len(names)
            blocks.append(replace(block, connectivity=cells, groups=groups))
        n_points, names = n_points + len(mesh.points), names + mesh.group_names
    return SurfaceMesh(np.concatenate([mesh.points for mesh in meshes]), tuple(blocks), names)


def cavity(mesh: SurfaceMesh) -> SurfaceMesh:
    rotated = [replace(b, connectivity=b.connectivity[:, reflection(b.element)]) for b in mesh.blocks]
    return replace(mesh, blocks=tuple(rotated))


def body(mesh: SurfaceMesh, **fields: list[int]) -> Body:
    """Return a body with values prescribed on the lower faces of the named cubes."""
    clamps = (BoundaryCondition(f"{name} z-", field, "value") for name in fields for field in fields[name])
    return Body(library_material("orthotropic-mee").stiffness, mesh, tuple(clamps), None)


ALL = [0, 1, 2, 3, 4]
MISSING = {
    "no electric potential": ([0, 1, 2, 4], "no boundary condition prescribes electric_potential of the separate part"),
    "no magnetic potential": ([0, 1, 2, 3], "no boundary condition prescribes magnetic_potential of the separate part"),
    "no supports": ([3, 4], "leave 6 of the 6 rigid motions of the separate part"),
    "no tangential supports": ([2, 3, 4], "leave 3 of the 6 rigid motions of the separate part"),
}


@pytest.mark.parametrize(("given", "message"), MISSING.values(), ids=MISSING)
@pytest.mark.parametrize("shift", [5.0, 0.1], ids=["beside", "in a cavity"])
def test_unsupported_components_are_rejected_early(given, message, shift, monkeypatch):
    monkeypatch.setattr(formulation, "assemble", None)
    mesh = joined(cube(4.0, 0.0, "a"), cavity(cube(3.0, 0.0, "hole")), cube(1.0, shift, "b"))
    check_mesh(mesh)
    with pytest.raises(CaseError, match=rf"{message} of 6 elements at \({shift - 0.5:g}, -0.5, 0.5\) \[m\]"):
        DenseBEM().boundary_fields(body(mesh, a=ALL, b=given))
    check_supports(body(mesh, a=ALL, b=ALL))


@pytest.mark.parametrize("held", ["a", "hole"])
def test_cavities_need_no_supports(held):
    mesh = joined(cube(4.0, 0.0, "a"), cavity(cube(1.0, 0.5, "hole")))
    check_mesh(mesh)
    check_supports(body(mesh, **{held: ALL}))
    with pytest.raises(CaseError, match="leave 3 of the 6 rigid motions free"):
        check_supports(body(mesh, **{held: [2, 3, 4]}))


def test_components_do_not_support_each_other():
    """A support of one component does not constrain another."""
    mesh = joined(cube(1.0, 0.0, "a"), cube(1.0, 3.0, "b"))
    held = body(mesh, a=[2, 3, 4], b=ALL)
    held = replace(held, conditions=(*held.conditions, BoundaryCondition("a x-", 0, "value")))
    with pytest.raises(CaseError, match="leave 1 of the 6 rigid motions of the separate part of 6 elements"):
        check_supports(held)


def test_small_supports_suffice():
    mesh = cube(1.0, 0.0, "a")
    stretched = replace(mesh, points=mesh.points * [1.0, 1.0, 1e7])
    check_supports(body(stretched, a=ALL))


def test_long_narrow_supports_suffice():
    """Only the width of a long face prevents the rotation about the rod."""
    mesh = cube(1.0, 0.0, "a")

    def rod(length: float) -> Body:
        return body(replace(mesh, points=mesh.points * [length, 1.0, 1.0]), a=ALL)

    check_supports(rod(1e5))
    with pytest.raises(CaseError, match="leave 1 of the 6 rigid motions free"):
        check_supports(rod(1e7))
