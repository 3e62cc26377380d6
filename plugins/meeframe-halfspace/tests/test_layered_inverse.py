"""The approximate inverse is as good on layers as on a half space, and is made once."""

from unittest.mock import patch

import numpy as np
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.layered_grid import LayeredPeriodicGrid

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant, Status
from meeframe.elements import Quad4
from meeframe.laws import Insulating, IsotropicCoulomb
from meeframe.material import library_material
from meeframe.material.layers import Layer, LayerStack
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.force_control import PRESS, SLIDE, SLIDE_2, prescribe_resultant
from meeframe.testing.operation_counter import OperationCounter

WIDTH, RADIUS, FORCE, MU = 4e-3, 0.1, 450.0, 0.3
FILMS = LayerStack(tuple(Layer(library_material(name), 5e-4) for name in ("batio3", "cofe2o4")))


def reduced(layers: LayerStack) -> ReducedSystem:
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH, 63, 1, Quad4())
    return HalfSpace(matrix_up_to=0).reduce(
        Body.of(library_material("batio3-cofe2o4"), mesh, (), "contact", layers=layers)
    )


def products(system: ReducedSystem) -> int:
    """Return the number of products for a sphere under a force and half of the force that friction can carry."""
    counter = OperationCounter.of(system, True)
    x, y, _ = system.points.T
    totals: tuple[PrescribedResultant, ...] = tuple(
        prescribe_resultant(counter, mode, total)
        for mode, total in ((PRESS, FORCE), (SLIDE, 0.5 * MU * FORCE), (SLIDE_2, 0.0))
    )
    none = np.zeros((len(x), 2))
    channels = flux_channels(Insulating(), Insulating())
    gap = (x**2 + y**2) / (2.0 * RADIUS)
    problem = ContactProblem(counter, IsotropicCoulomb(MU), channels, gap, none, none, totals)
    solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10))
    assert solution.status is Status.CONVERGED
    return len(counter.products)


def test_layers_need_as_many_products_as_a_half_space() -> None:
    assert products(reduced(FILMS)) <= 1.15 * products(reduced(LayerStack()))


def test_waves_of_subgrids_are_stored() -> None:
    """A second solution on the same subgrids computes no symbol again."""
    system = reduced(FILMS)
    products(system)
    with patch.object(LayeredPeriodicGrid, "symbol", side_effect=AssertionError("computed again")):
        products(system)
