"""Fixtures for hierarchical matrices: a block like that of the paper with all kinds of boundary data, smooth loads."""

from collections.abc import Callable

import numpy as np
import pytest

from meeframe.elements import Quad4
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.system.reduced import ReducedSystem


def block(divisions: int, element: SurfaceElement) -> Body:
    """Return a block with prescribed motion of its base, potentials on base and two sides, tractions and fluxes on
    others."""
    stiffness = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
    mesh = block_mesh(0.01, 0.02, 0.005, divisions, 2, 2, element)
    displaced = tuple(BoundaryCondition("base", field, "value", 1e-6 * (1 + field)) for field in range(3))
    grounded = tuple(
        BoundaryCondition(group, field, "value", value)
        for group in ("base", "side_x-", "side_x+")
        for field, value in ((3, 3e3), (4, 1e2))
    )
    loaded = (BoundaryCondition("top", 0, "flux", 1e5), BoundaryCondition("side_y+", 4, "flux", 1e-4))
    return Body(stiffness, mesh, displaced + grounded + loaded, "contact")


def load_on(system: ReducedSystem) -> Array:
    """Return a load (n, 5) [SI] in all fields, slowly varying and of similar energy."""
    x, y = (system.points[:, :2] / np.ptp(system.points[:, :2])).T
    shapes = np.stack([np.cos(3 * x), np.cos(2 * y), 1 + x * y, np.sin(3 * x) + 0.2, np.cos(x + 2 * y)], axis=1)
    load: Array = shapes * np.array([1e8, 1e8, -1e8, 3e-2, 0.6])
    return load


@pytest.fixture(scope="session")
def make_block() -> Callable[..., Body]:
    """Return the function block(divisions, element)."""
    return lambda divisions, element=None: block(divisions, element or Quad4())


@pytest.fixture(scope="session")
def smooth_load() -> Callable[[ReducedSystem], Array]:
    """Return the function load_on(system)."""
    return load_on
