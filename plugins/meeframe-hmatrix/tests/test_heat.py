"""Heat in hierarchical boundary elements: exact field of a heated block, dense boundary elements, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_hmatrix import HierarchicalBEM
from meeframe_hmatrix.blocks import LowRank, leaves

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4, Quad9
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.system.capabilities import InteriorFields, apply_load
from meeframe.testing.formulation import check_exact
from meeframe.testing.manufactured import ThermalField, prescribe, with_heat

MATERIAL = (
    library_material("orthotropic-mee")
    .with_heat([3.0, 2.5, 4.0], [1.2e-5, 2e-5, 0.8e-5], None, [2e-5, -1e-5, -7e-5], [1e-4, 2e-4, -3e-4], "strain")
    .rotated(rotation_about([1.0, 2.0, 3.0], 0.7))
)


@pytest.mark.full
def test_linear_temperature_is_exact_to_the_tolerance():
    """Loads, fluxes and heat on the zone of a quadratic field, with far blocks in the matrix."""
    field = ThermalField(MATERIAL, 20.0, np.array([30.0, -40.0, 25.0]))
    kinds = {"base": "vvvvvv", "top": "ffffff", "side_x-": "fffffv", "side_x+": "vvvvvf"}
    kinds |= {"side_y-": "vvvvvf", "side_y+": "ffffff"}
    mesh = block_mesh(0.5, 0.8, 0.5, 2, 1, 2, Quad9())
    body = replace(with_heat(prescribe(mesh, field, MATERIAL.stiffness, kinds), MATERIAL), contact_group="contact")
    formulation = HierarchicalBEM(tolerance=1e-6, leaf_size=4)
    system = formulation.reduce(body)
    assert any(isinstance(leaf, LowRank) for leaf in leaves(system.boundary.system.matrix))
    check_exact(system, field, 1e-5)
    load = field.fluxes(system.points, system.frames[:, 2])
    again = formulation.from_arrays(body, system.to_arrays())
    np.testing.assert_array_equal(again.apply(load), system.apply(load))
    inside = np.array([[0.0, 0.0, -0.4], [0.2, -0.1, -0.05]])
    load[:, :3] = np.einsum("nai,ni->na", system.frames, load[:, :3])
    fields, exact = system.capability(InteriorFields).evaluate(load, inside), field.values(inside)
    assert (np.abs(fields.values - exact).max(axis=0) <= 1e-5 * np.abs(exact).max(axis=0)).all()
    stress = field.fluxes(inside, np.tile([0.0, 0.0, 1.0], (2, 1)))[:, :5]
    size = np.abs(MATERIAL.thermal_moduli).max(axis=0) * 40.0
    assert (np.abs(fields.fluxes[:, 2, :5] - stress).max(axis=0) <= 1e-4 * size).all()


@pytest.mark.full
@pytest.mark.parametrize("size", [1e-5, pytest.param(1.0, marks=pytest.mark.full)])
def test_agrees_with_dense_boundary_elements_in_any_unit_of_length(size):
    mesh = block_mesh(0.5 * size, 0.8 * size, 0.2 * size, 4, 2, 2, Quad4())
    base = tuple(BoundaryCondition("base", field, "value", 30.0 if field == 5 else 0.0) for field in range(6))
    body = Body.of(MATERIAL, mesh, (*base, BoundaryCondition("side_x+", 5, "flux", -80.0 / size)), "contact")
    dense = DenseBEM().reduce(body)
    system = HierarchicalBEM(leaf_size=8).reduce(body)
    assert (np.abs(system.offset - dense.offset).max(axis=0) <= 3e-4 * np.abs(dense.offset).max(axis=0)).all()
    for field, amount in ((2, 1e7), (4, 1e-3), (5, 1e3 / size)):
        load = np.zeros_like(dense.offset)
        load[:, field] = amount * (1.0 + dense.points[:, 0] / size)
        exact, computed = dense.apply(load), system.apply(load)
        assert (np.abs(computed - exact).max(axis=0) <= 3e-4 * np.abs(exact).max(axis=0)).all()
        if field != 5:
            assert not apply_load(system, load, (5,)).any()


def test_semi_infinite_body_that_expands_is_refused():
    body = Body.of(MATERIAL, half_space_mesh(0.1, 0.02, (4, 4), 1, Quad4()), (), "contact")
    with pytest.raises(CaseError, match="semi-infinite"):
        HierarchicalBEM().check(body)
