"""Compute the response of layers to a given load by the half space and by finite elements on finer and finer meshes."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from meeframe_halfspace import HalfSpace
from meeframe_skfem import FiniteElements
from meeframe_skfem.interior import FiniteElementInterior

from meeframe.elements import Quad4, Quad9
from meeframe.fields import N_FIELDS, N_MECHANICAL, Array, FieldScaling
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.study.reports.extrapolation import of_order
from meeframe.system.capabilities import InteriorFields

UM: Final = 1e-6
WIDTH, HALF_WIDTH, SPREAD = 4.0 * UM, 10.0 * UM, 0.6 * UM
"""Width of the loaded zone and half width of the block of finite elements; standard deviation of the load [m]."""
LOAD: Final = np.array([1.0, 0.0, -0.5, 0.3, 0.3])
"""Amplitudes of tractions and fluxes: pressure and drag, and fluxes of similar effect, in scaled fields."""
DIVISIONS: Final = (4, 6)
"""Elements along the zone, which the finite elements, of 27 nodes, share."""
GROWTH: Final = 2.0
"""Growth of the finest elements in the depth."""
RINGS: Final = 3
"""Elements from the finest zone to the sides of the block."""
FINE: Final = 64
"""Cells of the half space along the zone."""
ORDER: Final = 4.0
"""Theoretical order of work with quadratic elements: twice that of its norm."""
_PLACES: Final = np.linspace(-0.5, 0.5, 17) * WIDTH
"""Coordinates of the points at which values on the surface and tractions on the interface are taken."""
QUANTITIES: Final = ("tangential displacement", "normal displacement", "electric potential", "magnetic potential")
COLUMNS: Final = (0, 2, 3, 4)
TRACTIONS: Final = ("largest shear", "largest tension")


def _turned(name: str) -> Material:
    return library_material(name).rotated(rotation_about([1.0, 2.0, 3.0], np.radians(40.0)))


def _film(name: str, interface: Interface | None = None, thickness: float = UM, turned: bool = False) -> Layer:
    return Layer(_turned(name) if turned else library_material(name), thickness, interface or Interface())


SPRINGS: Final = Interface(3e17, 1e17, {"electric": 0.5})
STACKS: Final[dict[str, tuple[Material, LayerStack]]] = {
    "BaTiO3, grounded electrode, CoFe2O4": (
        library_material("cofe2o4"),
        LayerStack((_film("batio3", Interface(electrode="grounded")),), RigidBase(3.0 * UM)),
    ),
    "triclinic PZT-4, springs and a poor conductor, BaTiO3-CoFe2O4": (
        library_material("batio3-cofe2o4"),
        LayerStack((_film("pzt-4", SPRINGS, turned=True),), RigidBase(3.0 * UM)),
    ),
    "CoFe2O4, BaTiO3, triclinic BaTiO3-CoFe2O4": (
        _turned("batio3-cofe2o4"),
        LayerStack((_film("cofe2o4"), _film("batio3")), RigidBase(2.0 * UM)),
    ),
}
"""Material of the body and layers, on a rigid base, by title."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Numbers of one stack: by the half space on its fine grid, and by finite elements on each mesh.

    Attributes
    ----------
    means
        Means of displacement [m] and potentials [V, A] under the load, weighted by it, (4,) of QUANTITIES.
    tractions
        Largest shear and tension on the first interface [Pa], (2,).
    element_means, element_tractions
        The same by finite elements, (meshes, 4) and (meshes, 2).
    """

    means: Array
    tractions: Array
    element_means: Array
    element_tractions: Array

    @property
    def limits(self) -> Array:
        """Means by finite elements, extrapolated to elements of zero size from the last two meshes, (4,)."""
        sizes = [1.0 / count for count in DIVISIONS]
        return np.array([of_order(sizes, values.tolist(), ORDER) for values in self.element_means.T])


def compare(name: str, divisions: tuple[int, ...] = DIVISIONS, cells: int = FINE) -> Comparison:
    """Return the numbers of a stack."""
    material, layers = STACKS[name]
    waves = _half_space(Body.of(material, _mesh(cells, 1, Quad4()), (), "contact", layers))
    meshes = [
        _finite_elements(Body.of(material, _mesh(count, RINGS, Quad9()), (), "contact", layers), count)
        for count in divisions
    ]
    means, tractions = (np.array([mesh[part] for mesh in meshes]) for part in (0, 1))
    return Comparison(*waves, means, tractions)


def _mesh(divisions: int, rings: int, element: Quad4 | Quad9) -> object:
    return half_space_mesh(HALF_WIDTH, WIDTH, divisions, rings, element)


def _half_space(body: Body) -> tuple[Array, Array]:
    system = HalfSpace(matrix_up_to=0).reduce(body)
    interior = system.capability(InteriorFields)
    assert interior is not None
    load = _load(body, system.points)
    every = (round(len(system.points) ** 0.5) - 1) // (len(_PLACES) - 1)
    order = np.lexsort(system.points[:, :2].T).reshape(-1, round(len(system.points) ** 0.5))
    nodes = order[::every, ::every].ravel()
    values = system.apply(load)[nodes] * np.where(np.arange(N_FIELDS) < N_MECHANICAL, 1.0, -1.0)
    fluxes = interior.evaluate(load, _below(system.points[nodes], body.layers.top_thickness)).fluxes
    return _means(system.points[nodes], values), _largest(fluxes)


def _finite_elements(body: Body, divisions: int) -> tuple[Array, Array]:
    """Return the numbers by finite elements, factorised once and never condensed to the zone."""
    solution = FiniteElements(growth=GROWTH ** (DIVISIONS[-1] / divisions)).solve(body)
    interior, load = FiniteElementInterior(solution), _load(body, solution.matched.zone.points)
    surface = np.stack(np.meshgrid(_PLACES, _PLACES, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    values, depth = interior.evaluate(load, surface).values, body.layers.top_thickness
    sides = [interior.evaluate(load, _below(surface, depth * (1.0 + offset))).fluxes for offset in (-1e-6, 1e-6)]
    return _means(surface, values), _largest(np.mean(sides, axis=0))


def _load(body: Body, points: Array) -> Array:
    """Return the load (n, 5) at points, with LOAD times 100 MPa and fluxes of like effect."""
    factors = FieldScaling.of(body.layers.layers[0].material.stiffness).factors
    return np.outer(_density(points), 1e8 * LOAD * factors[2] / factors)


def _density(points: Array) -> Array:
    density: Array = np.exp(-0.5 * (points[:, :2] ** 2).sum(axis=1) / SPREAD**2)
    return density


def _below(surface: Array, depth: float) -> Array:
    return np.column_stack([surface[:, :2], np.full(len(surface), -depth)])


def _means(points: Array, values: Array) -> Array:
    """Return means (4,) of QUANTITIES, weighted by the load."""
    density = _density(points)
    means: Array = (density @ values / density.sum())[list(COLUMNS)]
    return means


def _largest(fluxes: Array) -> Array:
    """Return the largest shear and tension (2,) of fluxes at points of a plane."""
    traction = fluxes[:, 2, :N_MECHANICAL]
    return np.array([np.hypot(*traction[:, :2].T).max(), traction[:, 2].max()])
