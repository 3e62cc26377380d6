"""Dense boundary elements converge with the theoretical order for the field of a source outside the body."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.elements import Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.greens import Tabulated
from meeframe.material import library_material, rotation_about
from meeframe.mesh import box_mesh, sphere_mesh
from meeframe.mesh.body import Body
from meeframe.mesh.surface import SurfaceMesh
from meeframe.testing.manufactured import (
    ExactField,
    HeatSourceField,
    PointSourceField,
    prescribe,
    relative_errors,
    with_heat,
)

SLACK = 0.3
MATERIAL = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
SOURCE = PointSourceField(MATERIAL.stiffness, np.array([1.2, 1.4, 1.1]), np.array([1.0, -0.5, 0.7, 0.8, -0.6]))
BOX = {"x-": "vvvvv", "x+": "vfffv", "y-": "fffvf", "y+": "fvvff", "z-": "vvvvv", "z+": "fffff"}
SPHERE = {"lower": "vvvvv", "upper": "fffff"}
HOT = MATERIAL.with_heat(
    np.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.5], [-0.2, 0.5, 4.0]]),
    [1.2e-5, 2e-5, 0.8e-5],
    None,
    [2e-5, -1e-5, -7e-5],
    [1e-4, 2e-4, -3e-4],
    "strain",
)
HEAT = HeatSourceField(HOT, np.array([1.2, 1.4, 1.1]))
HOT_BOX = {"x-": "vvvvvv", "x+": "vfffvf", "y-": "fffvfv", "y+": "fvffvf", "z-": "vvvvvv", "z+": "ffffff"}
HOT_SPHERE = {"lower": "vvvvvv", "upper": "ffffff"}


def halved_sphere(divisions: int, element: SurfaceElement) -> SurfaceMesh:
    mesh = sphere_mesh(0.6, divisions, element)
    blocks = []
    for block in mesh.blocks:
        heights = mesh.points[block.connectivity].mean(axis=1)[:, 2]
        blocks.append(replace(block, groups=(heights > 0).astype(np.int64)))
    return SurfaceMesh(mesh.points, tuple(blocks), ("lower", "upper"))


def box(divisions: int, element: SurfaceElement) -> SurfaceMesh:
    return box_mesh((1.0, 1.0, 1.0), (divisions, divisions, divisions), element)


@pytest.mark.parametrize(
    ("mesh_of", "element"),
    [
        *((box, element) for element in (Quad4(), Quad8(), Quad9(), Tri3(), Tri6())),
        *((halved_sphere, element) for element in (Quad9(), Tri3())),
    ],
    ids=lambda value: getattr(value, "name", None) or value.__name__,
)
def test_order_of_convergence(mesh_of, element):
    """Values converge with the degree of the shape functions plus one, fluxes with their degree.

    Where the value is prescribed, the flux solves an integral equation of the first kind and loses one order compared
    with the interpolated values.
    """
    kinds = BOX if mesh_of is box else SPHERE
    meshes = [mesh_of(divisions, element) for divisions in ((4, 8) if element.order == 1 else (2, 4))]
    check_orders(element, [prescribe(mesh, SOURCE, MATERIAL.stiffness, kinds) for mesh in meshes], SOURCE)


@pytest.mark.parametrize(
    ("mesh_of", "element", "divisions"),
    [(box, Quad4(), (2, 4)), (halved_sphere, Quad9(), (2, 4))],
    ids=["box-quad4", "sphere-quad9"],
)
def test_order_of_convergence_with_heat(mesh_of, element, divisions):
    """Heat source outside the body, whose temperature acts on all other fields: the orders are the same."""
    kinds = HOT_BOX if mesh_of is box else HOT_SPHERE
    meshes = [mesh_of(number, element) for number in divisions]
    bodies = [with_heat(prescribe(mesh, HEAT, HOT.stiffness, kinds), HOT) for mesh in meshes]
    check_orders(element, bodies, HEAT)


def check_orders(element: SurfaceElement, bodies: list[Body], field: ExactField) -> None:
    """Check the orders of the errors of values and fluxes on two meshes, the finer one with half the size."""
    formulation = DenseBEM(Tabulated(), quadrature_tolerance=1e-6)
    errors = [relative_errors(body.mesh, field, formulation.boundary_fields(body)) for body in bodies]
    value_order, flux_order = np.log2(np.divide(*errors))
    assert value_order > element.order + 1 - SLACK
    assert flux_order > element.order - SLACK
