"""Compute the response of layers to a given load by the half space and by finite elements on finer and finer meshes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

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
from meeframe.mesh.surface import SurfaceMesh
from meeframe.study.reports.extrapolation import of_order
from meeframe.system.capabilities import InteriorFields

UM: Final = 1e-6
WIDTH, HALF_WIDTH, SPREAD = 4.0 * UM, 20.0 * UM, 0.6 * UM
"""Width of the loaded zone and half width of the block of finite elements; standard deviation of the load [m].

The sides of the block are held. At 10 µm they reduce the displacement under a drag on the first stack by 0.5 %.
"""
LOAD: Final = np.array([1.0, 0.0, -0.5, 0.3, 0.3])
"""Amplitudes of tractions and fluxes: pressure and drag, and fluxes of similar effect, in scaled fields."""
DIVISIONS: Final = (4, 6, 8)
"""Elements along the zone, which the finite elements, of 27 nodes, share.

The films are one element thick on the first mesh and two on the others, so that all sizes are about halved from the
first mesh to the last, from which limits are extrapolated.
"""
GROWTH: Final = 1.8
"""Growth of the elements in the depth on the second mesh."""
RINGS: Final = 3
"""Elements of the surface mesh from the zone to the sides of the block."""
FINE: Final = 64
"""Cells of the half space along the zone."""
ORDER: Final = 4.0
"""Theoretical order of work with quadratic elements: twice that of its norm."""
_PLACES: Final = np.linspace(-0.5, 0.5, 17) * WIDTH
"""Coordinates of the points at which values on the surface are taken."""
_GAUSS: Final = 0.5 - np.sqrt(3.0) / 6.0
"""Distance of the Gauss points of two-point rules from the sides of an element, in its width.

Gradients of quadratic elements are more accurate there by an order than elsewhere (Barlow, 1976); on the interface
itself they are least accurate.
"""
QUANTITIES: Final = ("tangential displacement", "normal displacement", "electric potential", "magnetic potential")
COLUMNS: Final = (0, 2, 3, 4)


def _rotated(name: str) -> Material:
    return library_material(name).rotated(rotation_about([1.0, 2.0, 3.0], np.radians(40.0)))


def _film(name: str, interface: Interface | None = None, thickness: float = UM, rotated: bool = False) -> Layer:
    return Layer(_rotated(name) if rotated else library_material(name), thickness, interface or Interface())


SPRINGS: Final = Interface(3e17, 1e17, {"electric": 0.5})
STACKS: Final[dict[str, tuple[Material, LayerStack]]] = {
    "BaTiO3, grounded electrode, CoFe2O4": (
        library_material("cofe2o4"),
        LayerStack((_film("batio3", Interface(electrode="grounded")),), RigidBase(3.0 * UM)),
    ),
    "triclinic PZT-4, springs and a poor conductor, BaTiO3-CoFe2O4": (
        library_material("batio3-cofe2o4"),
        LayerStack((_film("pzt-4", SPRINGS, rotated=True),), RigidBase(3.0 * UM)),
    ),
    "CoFe2O4, BaTiO3, triclinic BaTiO3-CoFe2O4": (
        _rotated("batio3-cofe2o4"),
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
    element_means
        The same by finite elements, (meshes, 4).
    depths
        Depth of the Gauss points above the first interface in which tractions are compared [m], (meshes,).
    errors
        Root of the mean square difference of the tractions, relative to the one of the tractions, (meshes,).
    profile
        Positions along e1 of the Gauss points closest to the middle on the last mesh [m], and shear and normal traction
        there [Pa] by the half space and by finite elements, (5, points).
    """

    means: Array
    element_means: Array
    depths: Array
    errors: Array
    profile: Array

    @property
    def limits(self) -> Array:
        """Means by finite elements, extrapolated to elements of zero size from the first and the last mesh, (4,)."""
        sizes = [1.0 / DIVISIONS[0], 1.0 / DIVISIONS[-1]]
        return np.array([of_order(sizes, [values[0], values[-1]], ORDER) for values in self.element_means.T])


def of_numbers(numbers: Mapping[str, Any]) -> Comparison:
    """Return a comparison of the stored numbers, without profile."""
    return Comparison(**{key: np.array(values) for key, values in numbers.items()}, profile=np.empty((5, 0)))


def compare(name: str, divisions: tuple[int, ...] = DIVISIONS, cells: int = FINE) -> Comparison:
    """Return the numbers of a stack."""
    material, layers = STACKS[name]
    system = HalfSpace(matrix_up_to=0).reduce(Body.of(material, _mesh(cells, 1, Quad4()), (), "contact", layers))
    interior = system.capability(InteriorFields)
    assert interior is not None
    load = _load(layers, system.points)
    row = cells + 1
    order = np.lexsort(system.points[:, :2].T).reshape(row, row)
    every = cells // (len(_PLACES) - 1)
    nodes = order[::every, ::every].ravel()
    values = system.apply(load)[nodes] * np.where(np.arange(N_FIELDS) < N_MECHANICAL, 1.0, -1.0)
    means, depths, errors, profile = [], [], [], np.empty((5, 0))
    for count in divisions:
        body = Body.of(material, _mesh(count, RINGS, Quad9()), (), "contact", layers)
        # factorised once and never condensed to the zone
        solution = FiniteElements(growth=GROWTH ** (DIVISIONS[1] / count)).solve(body)
        elements, given = FiniteElementInterior(solution), _load(layers, solution.matched.zone.points)
        surface = np.stack(np.meshgrid(_PLACES, _PLACES, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
        means.append(_means(surface, elements.evaluate(given, surface).values))
        points = _gauss_points(count, solution.matched.volume.points[:, 2], layers.top_thickness)
        waves, found = (one.evaluate(on, points).fluxes[:, 2, :3] for one, on in ((interior, load), (elements, given)))
        depths.append(-points[0, 2])
        errors.append(np.linalg.norm(found - waves) / np.linalg.norm(waves))
        middle = np.isclose(points[:, 1], np.abs(points[:, 1]).min(), rtol=1e-6, atol=0.0)
        profile = np.stack([points[middle, 0], *waves[middle][:, [0, 2]].T, *found[middle][:, [0, 2]].T])
    return Comparison(
        _means(system.points[nodes], values), np.array(means), np.array(depths), np.array(errors), profile
    )


def _mesh(divisions: int, rings: int, element: Quad4 | Quad9) -> SurfaceMesh:
    return half_space_mesh(HALF_WIDTH, WIDTH, divisions, rings, element)


def _gauss_points(divisions: int, heights: Array, depth: float) -> Array:
    """Return the Gauss points (m, 3) next to a depth of the elements above it in the zone; heights: of all nodes."""
    levels = np.unique(np.round(-heights / depth, 9))
    top = levels[np.searchsorted(levels, 1.0 - 1e-6) - 2]  # nodes in the middle of an element are a level
    width = WIDTH / divisions
    sides = np.arange(divisions) * width - 0.5 * WIDTH
    line = np.sort(np.concatenate([sides + _GAUSS * width, sides + (1.0 - _GAUSS) * width]))
    grid = np.meshgrid(line, line, [-depth * (1.0 - _GAUSS * (1.0 - top))], indexing="ij")
    return np.stack(grid, axis=-1).reshape(-1, 3)


def _load(layers: LayerStack, points: Array) -> Array:
    """Return the load (n, 5) at points, with LOAD times 100 MPa and fluxes of like effect."""
    factors = FieldScaling.of(layers.layers[0].material.stiffness).factors
    return np.outer(_density(points), 1e8 * LOAD * factors[2] / factors)


def _density(points: Array) -> Array:
    density: Array = np.exp(-0.5 * (points[:, :2] ** 2).sum(axis=1) / SPREAD**2)
    return density


def _means(points: Array, values: Array) -> Array:
    """Return means (4,) of QUANTITIES, weighted by the load."""
    density = _density(points)
    means: Array = (density @ values / density.sum())[list(COLUMNS)]
    return means
