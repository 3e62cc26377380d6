"""Free terms agree with closed forms, and free terms with principal values satisfy exact fields on closed surfaces."""

from dataclasses import dataclass
from math import pi

import numpy as np
import pytest

from meeframe.elements import ELEMENTS, Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.elements.quadrature import element_rule
from meeframe.fields import Array
from meeframe.greens import LineIntegral
from meeframe.greens.base import Kernel
from meeframe.material import library_material
from meeframe.testing.principal_value import free_term, tangent_facet, traction_principal_value
from meeframe.testing.strategies import scaled_stiffness

POISSON = 0.3


@pytest.fixture(scope="module")
def isotropic():
    return LineIntegral().bind(
        scaled_stiffness(library_material("isotropic", young_modulus=1e9, poisson_ratio=POISSON))
    )


@pytest.fixture(scope="module")
def stiffness():
    """Return the extended stiffness of a fully anisotropic and coupled material with constants of order one."""
    rng = np.random.default_rng(5)

    def positive(n):
        factor = rng.normal(size=(n, n))
        return factor @ factor.T / n + np.eye(n)

    voigt = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    elastic, dielectric = positive(6), positive(6)
    c = np.zeros((3, 5, 5, 3))
    c[:, :3, :3, :] = elastic[voigt[:, :, None, None], voigt[None, None]]
    for field in (3, 4):
        coupling = 0.6 * rng.normal(size=(3, 6))[:, voigt]
        c[:, :3, field, :] = np.einsum("mij->ijm", coupling)
        c[:, field, :3, :] = coupling
        c[:, field, field, :] = -dielectric[3 * (field - 3) : 3 * (field - 2), 3 * (field - 3) : 3 * (field - 2)]
    c[:, 3, 4, :] = -dielectric[:3, 3:]
    c[:, 4, 3, :] = -dielectric[3:, :3]
    assert np.allclose(c, c.transpose(3, 2, 1, 0))
    return c


@pytest.fixture(scope="module")
def anisotropic(stiffness):
    return LineIntegral().bind(stiffness)


def box(element, cells=2, map_points=lambda x: x):
    """Return the nodes of all elements of the mapped cube [-1, 1]^3 with cells x cells quadrilaterals per face."""
    xi, eta = (element.nodes.T + 1) / cells - 1
    elements = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            for i in range(cells):
                for j in range(cells):
                    plane = np.column_stack([xi + 2 * i / cells, eta + 2 * j / cells])
                    points = np.empty((len(element.nodes), 3))
                    points[:, axis] = sign
                    points[:, [(axis + 1) % 3, (axis + 2) % 3]] = plane if sign > 0 else plane[:, ::-1]
                    elements.append(map_points(points))
    return elements


def sheared(points):
    return points @ np.array([[1.0, 0.2, 0.1], [0.0, 1.3, 0.3], [0.1, 0.0, 0.6]])


def sphere(points):
    blown = np.tan(points * pi / 4)
    return blown / np.linalg.norm(blown, axis=-1, keepdims=True)


def fichera():
    """Return the cube without one of its octants, of quad4 elements of side 1, with re-entrant edges and corner."""
    full = {(i, j, k) for i in range(2) for j in range(2) for k in range(2)} - {(1, 1, 1)}
    square = (Quad4().nodes + 1) / 2
    elements = []
    for cell in sorted(full):
        for axis in range(3):
            for side in (0, 1):
                beyond = list(cell)
                beyond[axis] += 2 * side - 1
                if tuple(beyond) not in full:
                    points = np.empty((4, 3))
                    points[:, axis] = side
                    points[:, [(axis + 1) % 3, (axis + 2) % 3]] = square if side else square[:, ::-1]
                    elements.append(points + cell)
    return elements


def tetrahedron(element):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0.2, 1, 0], [0.1, 0.3, 0.8]])
    shares = np.column_stack([1 - element.nodes.sum(axis=1), element.nodes])
    return [shares @ corners[list(face)] for face in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))]


@dataclass(frozen=True)
class Collocated:
    """Integrals int T N_a and int U t of one source over a closed surface, and the free term."""

    free: Array
    traction: Array
    nodes: Array
    displacement: Array


def collocate(kernel: Kernel, element: SurfaceElement, elements: list[Array], source: Array, stress=None) -> Collocated:
    """Return the integrals of a source; `stress` (3, 5) is a constant state, whose tractions give int U t."""
    facets, tractions, displacement = [], [], np.zeros(5)
    for nodes in elements:
        distance = np.linalg.norm(nodes - source, axis=1)
        local = int(distance.argmin())
        own = distance[local] < 1e-12
        rule = element_rule(element, nodes, source, 1e-9, element.nodes[local] if own else None)
        u, t = kernel.evaluate(rule.positions - source, rule.normals)
        if own:
            facets.append(tangent_facet(element, nodes, local))
            tractions.append(traction_principal_value(kernel, element, nodes, local, 1e-9))
        else:
            tractions.append(np.einsum("m,ma,mjk->ajk", rule.measures, rule.shapes, t))
        if stress is not None:
            displacement += np.einsum("m,mjk,mi,ij->k", rule.measures, u, rule.normals, stress)
    free = free_term(kernel, np.array(facets))
    return Collocated(free, np.concatenate(tractions), np.concatenate(elements), displacement)


def assert_constants_vanish(kernel, element, elements, source, tolerance=1e-8):
    result = collocate(kernel, element, elements, np.array(source, float))
    assert np.abs(result.free + result.traction.sum(axis=0)).max() < tolerance


def facets_of(*sectors):
    return np.array([(a, b, np.cross(a, b)) for a, b in sectors], float)


EX, EY, EZ = np.eye(3)
# the octant x, y, z > 0: seen from outside, the facets run clockwise about the axes
OCTANT = facets_of((EY, EX), (EZ, EY), (EX, EZ))


def test_free_term_of_a_smooth_point(anisotropic):
    plane = np.array([[EX, EX, EZ]])
    half = np.array([[EX, -EX, EZ], [-EX, EX, EZ]])
    for facets in (plane, half):
        assert np.allclose(free_term(anisotropic, facets), np.eye(5) / 2, rtol=0, atol=1e-12)


def test_free_term_of_an_isotropic_cube_corner(isotropic):
    """The integral of Kelvin's traction over the octant of a sphere has a closed form."""
    expected = np.eye(5) / 8
    expected[:3, :3] += (1 - np.eye(3)) / (8 * pi * (1 - POISSON))
    assert np.allclose(free_term(isotropic, OCTANT), expected, rtol=0, atol=1e-10)


def test_free_term_of_an_isotropic_wedge(isotropic):
    """A wedge of angle alpha has the fraction of the circle, and the terms of plane strain in its plane."""
    for angle in (pi / 3, pi / 2, 3 * pi / 2, 1.9 * pi):
        edge = np.array([np.cos(angle), np.sin(angle), 0.0])
        outward = np.array([-np.sin(angle), np.cos(angle), 0.0])
        facets = np.array([[-EZ, EZ, -EY], [EZ, -EZ, outward]])
        assert np.allclose(np.cross(outward, EZ), edge)
        free = free_term(isotropic, facets)
        share, factor = angle / (2 * pi), 1 / (8 * pi * (1 - POISSON))
        in_plane = share * np.eye(2) + factor * np.array(
            [[np.sin(2 * angle), 2 * np.sin(angle) ** 2], [2 * np.sin(angle) ** 2, -np.sin(2 * angle)]]
        )
        assert np.allclose(free[:2, :2], in_plane, rtol=0, atol=1e-10)
        assert np.allclose(free[2:, 2:], share * np.eye(3), rtol=0, atol=1e-10)


def test_cone_and_complement_fill_space(anisotropic):
    rng = np.random.default_rng(2)
    for _ in range(5):
        a, b, c = (v / np.linalg.norm(v) for v in rng.normal(size=(3, 3)))
        if a @ np.cross(b, c) < 0:
            b, c = c, b
        cone = np.array([[u, v, n / np.linalg.norm(n)] for u, v, n in facets_of((b, a), (c, b), (a, c))])
        rest = cone[:, [1, 0, 2]] * np.array([1, 1, -1])[:, None]
        whole = free_term(anisotropic, cone) + free_term(anisotropic, rest)
        assert np.allclose(whole, np.eye(5), rtol=0, atol=1e-9)


def test_facets_of_nodes():
    nodes = np.column_stack([Quad9().nodes, np.zeros(9)])
    assert np.allclose(tangent_facet(Quad9(), nodes, 1), [EY, -EX, EZ])
    assert np.allclose(tangent_facet(Quad9(), nodes, 5)[[0, 2]], [EY, EZ])
    start, end, normal = tangent_facet(Quad9(), nodes, 8)
    assert np.allclose(start, end)
    assert np.allclose(normal, EZ)
    triangle = np.column_stack([Tri6().nodes, np.zeros(6)])
    assert np.allclose(tangent_facet(Tri6(), triangle, 0), [EX, EY, EZ])
    assert np.allclose(tangent_facet(Tri6(), triangle, 4)[:2], [[-(0.5**0.5), 0.5**0.5, 0], [0.5**0.5, -(0.5**0.5), 0]])


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("element", [Quad4(), Quad8(), Quad9()], ids=lambda e: e.name)
@pytest.mark.parametrize("position", [(0, 0, 1), (0, 1, -1), (-1, -1, 1)], ids=["face", "edge", "corner"])
def test_constant_fields_on_a_sheared_block(anisotropic, element, position):
    assert_constants_vanish(anisotropic, element, box(element, 2, sheared), sheared(np.array(position, float)))


@pytest.mark.parametrize("position", [(1, 0.5, 0.5), (1, 0.5, 0), (-1, 1, 0.5)], ids=["centre", "mid-side", "edge"])
def test_constant_fields_at_nodes_inside_and_on_sides(anisotropic, position):
    assert_constants_vanish(anisotropic, Quad9(), box(Quad9(), 2, sheared), sheared(np.array(position, float)))


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("position", [(0, 0, 1), (1, 0.5, 0.5), (0, 1, -1), (0.5, 1, 1), (1, 1, 1)])
def test_constant_fields_on_a_sphere(anisotropic, position):
    """Quadratic elements have kinks between them, which the free term must include."""
    assert_constants_vanish(anisotropic, Quad9(), box(Quad9(), 2, sphere), sphere(np.array(position, float)))


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("position", [(1, 1, 1), (2, 1, 1), (1, 1, 2), (1, 2, 2), (0, 0, 1), (1, 2, 1)])
def test_constant_fields_with_reentrant_edges(anisotropic, position):
    assert_constants_vanish(anisotropic, Quad4(), fichera(), position)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("element", [Tri3(), Tri6()], ids=lambda e: e.name)
def test_constant_fields_on_a_tetrahedron(anisotropic, element):
    elements = tetrahedron(element)
    for source in np.unique(np.round(np.concatenate(elements), 12), axis=0):
        assert_constants_vanish(anisotropic, element, elements, source)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_linear_fields(anisotropic, stiffness, element):
    """c u + int T u = int U t for u = G x tests weakly and strongly singular integrals of all shape functions
    together."""
    elements = tetrahedron(element) if element.reference == "triangle" else box(element, 1, sheared)
    gradient = np.random.default_rng(3).normal(size=(5, 3))
    stress = np.einsum("ijkm,km->ij", stiffness, gradient)
    for source in elements[0]:
        result = collocate(anisotropic, element, elements, source, stress)
        left = (gradient @ source) @ result.free
        left += np.einsum("aj,ajk->k", result.nodes @ gradient.T, result.traction)
        assert np.abs(left - result.displacement).max() < 1e-8 * np.abs(stress).max()


def test_principal_value_does_not_depend_on_the_unit_of_length(anisotropic):
    elements = box(Quad9(), 2, sphere)
    source = elements[0][0]
    sums = [
        sum(
            traction_principal_value(anisotropic, Quad9(), unit * nodes, int(local), 1e-8).sum(axis=0)
            for nodes in elements
            for local in np.flatnonzero(np.linalg.norm(nodes - source, axis=1) < 1e-12)
        )
        for unit in (1.0, 1e-3)
    ]
    assert np.allclose(*sums, rtol=0, atol=1e-9)
