"""Test the reduced system of half spaces: conformance, order of convergence, matrix, rejected input, periodic
surfaces."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest
from meeframe_halfspace import GaussianLoad, HalfSpace
from meeframe_halfspace.response import scaled_compliance

import meeframe
from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4, Quad8, Quad9, Tri3
from meeframe.fields import FieldScaling
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, find_contact_zone, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.model.load import load_case
from meeframe.system.capabilities import apply_fields
from meeframe.testing import check_formulation, check_indentation
from meeframe.testing.capabilities import check_edge_correction, check_edge_resultants
from meeframe.testing.formulation import check_edges

STIFFNESS = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
AMPLITUDE = np.array([1.0, -0.7, 1.3, 0.8, -0.6]) / FieldScaling.of(STIFFNESS).factors
POTENTIALS = np.array([1.0, 1.0, 1.0, -1.0, -1.0])


def body(divisions, width=(1.0, 0.8), element=None, stiffness=STIFFNESS):
    mesh = half_space_mesh(2.0, width, divisions, 1, element or Quad4())
    return Body(stiffness, mesh, (BoundaryCondition("top", 2, "flux"),), "contact")


def random_load(system, seed=0):
    scale = 1.0 / FieldScaling.of(STIFFNESS).factors
    return np.random.default_rng(seed).normal(size=(len(system.points), 5)) * scale


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    "formulation", [HalfSpace(), HalfSpace("constant", matrix_up_to=0), HalfSpace(edges="resolved")]
)
def test_conformance(formulation):
    check_formulation(formulation, body((24, 21)), GaussianLoad(STIFFNESS, AMPLITUDE, 0.12), tolerance=1e-2)


def test_kit_detects_undeclared_edge_resolution():
    system = HalfSpace(edges="resolved").reduce(body((24, 21)))
    with pytest.raises(AssertionError, match="resolves_edges does not tell"):
        check_edges(HalfSpace(), system)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda c: replace(c, extra_compliance=0.0 * c.extra_compliance), "no node responds more"),
        (lambda c: replace(c, extra_compliance=-c.extra_compliance), "gains energy"),
        (lambda c: replace(c, extra_compliance=0.5 * c.extra_compliance), "resultant of a circular punch in field 0"),
        (lambda c: replace(c, extra_compliance=2.0 * c.extra_compliance), "resultant of a circular punch in field 0"),
        (lambda c: replace(c, area_fraction=np.ceil(c.area_fraction)), "do not add up to the area"),
    ],
    ids=["no correction", "wrong sign", "half of it", "twice", "whole areas"],
)
def test_kit_rejects_wrong_edge_corrections(wrong, message):
    right = HalfSpace(edges="resolved").reduce(body((24, 21)))

    class WrongSystem(type(right)):
        def edge_correction(self, pressure, indenter_edge=None):
            return wrong(super().edge_correction(pressure, indenter_edge))

    system = WrongSystem(**{entry.name: getattr(right, entry.name) for entry in fields(right) if entry.init})

    def check(system):
        check_edge_correction(system)
        check_edge_resultants(system, STIFFNESS)

    check(right)
    with pytest.raises(AssertionError, match=message):
        check(system)


def test_indentation_kit():
    stiffness = library_material("batio3-cofe2o4").stiffness
    mesh = half_space_mesh(0.05, 0.005, 32, 1, Quad4())
    check_indentation(HalfSpace(), Body(stiffness, mesh, (), "contact"), tolerance=2e-3)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("density", ["bilinear", "constant"])
def test_all_fields_converge_with_second_order(density):
    errors = []
    for n in (32, 64, 128):
        system = HalfSpace(density, matrix_up_to=0).reduce(body((n, n + 3)))
        field = GaussianLoad(STIFFNESS, AMPLITUDE, 0.08, (0.05, -0.03))
        exact = field.values(system.points)
        computed = system.apply(field.fluxes(system.points, system.frames[:, 2])) * POTENTIALS
        errors.append(np.abs(computed - exact).max(axis=0) / np.abs(exact).max(axis=0))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders[1] > 1.87).all()
    assert (orders[1] > orders[0]).all()  # approaches 2 under refinement
    assert (errors[-1] < 1.5e-3).all()


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("divisions", [(9, 6), (8, 11)])
@pytest.mark.parametrize("formulation", [HalfSpace(), HalfSpace("constant"), HalfSpace("trigonometric", periodic=True)])
def test_matrix_matches_fft(divisions, formulation):
    held = formulation.reduce(body(divisions))
    free = replace(formulation, matrix_up_to=0).reduce(body(divisions))
    assert held.dense() is not None
    assert free.dense() is None
    load = random_load(held)
    size = np.abs(held.apply(load)).max(axis=0)
    assert (np.abs(held.apply(load) - free.apply(load)) / size).max() < 1e-12
    blocks = np.abs(held.diagonal_blocks()).max(axis=0)
    assert (np.abs(held.diagonal_blocks() - free.diagonal_blocks()) / blocks).max() < 1e-12


@pytest.mark.parametrize(
    "formulation", [HalfSpace("constant", matrix_up_to=0), HalfSpace(periodic=True, matrix_up_to=0)]
)
def test_products_in_double_and_single_precision(formulation):
    """Loads of two fields cause displacements in three fields."""
    system = formulation.reduce(body((40, 31)))
    load, loaded, fields = random_load(system), [2, 4], [0, 4, 2]
    load[:, [0, 1, 3]] = 0.0
    expected = system.apply(load)[:, fields]
    size = np.abs(expected).max(axis=0)
    assert (np.abs(apply_fields(system, load[:, loaded], loaded, fields) - expected) / size).max() < 1e-13
    single = apply_fields(system, load[:, loaded].astype(np.float32), loaded, fields)
    assert single.dtype == np.float32
    assert 1e-9 < (np.abs(single - expected) / size).max() < 1e-5


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_concurrent_threads_share_a_system(precision):
    """Each thread requests a different field at the same time, from a system without any computed entries."""
    whole = HalfSpace(matrix_up_to=0).reduce(body((40, 31)))
    load = random_load(whole)
    expected = [apply_fields(whole, load.astype(precision), range(5), [field]) for field in range(5)]
    for _ in range(3):
        system, barrier = HalfSpace(matrix_up_to=0).reduce(body((40, 31))), Barrier(5)

        def ask(field, system=system, barrier=barrier):
            barrier.wait()
            return apply_fields(system, load.astype(precision), range(5), [field])

        with ThreadPoolExecutor(5) as pool:
            for found, right in zip(pool.map(ask, range(5)), expected, strict=True):
                np.testing.assert_array_equal(found, right)


def test_pickled_system_gives_same_results():
    system = HalfSpace(matrix_up_to=0).reduce(body((24, 21)))
    load = random_load(system)
    expected = system.apply(load)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(system)).apply(load), expected)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_zero_load_on_new_system(precision):
    system = HalfSpace(matrix_up_to=0).reduce(body((9, 6)))
    found = system.apply(np.zeros((len(system.points), 5), precision))
    assert (found.shape, found.dtype) == (system.offset.shape, precision)
    assert not found.any()


def test_restart_without_contact(tmp_path):
    """The indenter is lifted by 5 um and pressed again: the result equals that of pressing at once."""
    text = Path(__file__).parents[3].joinpath("validation/hertz/sphere.toml").read_text()
    path = tmp_path / "case.toml"

    def case(approach, more=""):
        small = text.replace("divisions = 76", "divisions = 40").replace('"50 um"', approach)
        path.write_text(small + more)
        return load_case(path)

    meeframe.run(case('"-5 um"'), tmp_path / "open")
    restarted = meeframe.solve_case(case('"50 um"', '\n[restart]\nfrom = "open"\n'))
    pressed = meeframe.solve_case(case('"50 um"'))
    assert str(restarted.status) == str(pressed.status) == "converged"
    found, expected = (result.steps[-1].traction for result in (restarted, pressed))
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max(), rtol=0)


@pytest.mark.parametrize("periodic", [False, True])
def test_integer_loads(periodic):
    system = HalfSpace(periodic=periodic, matrix_up_to=0).reduce(body((9, 6)))
    load = np.random.default_rng(7).integers(-5, 6, system.offset.shape)
    np.testing.assert_array_equal(system.apply(load), system.apply(load.astype(float)))


def test_weights_and_nodes_match_four_node_elements():
    """Half spaces can therefore be compared and combined with boundary elements node by node."""
    given = body((9, 6))
    system = HalfSpace().reduce(given)
    zone = find_contact_zone(given.mesh, "contact")
    np.testing.assert_allclose(system.weights, zone.weights, rtol=1e-12)
    np.testing.assert_array_equal(system.points, zone.points)


@pytest.mark.parametrize("element", [Quad9(), Tri3()])
def test_elements_with_nodes_on_a_grid_are_accepted(element):
    half = (5, 4) if isinstance(element, Quad9) else (10, 8)
    system, plain = HalfSpace().reduce(body(half, element=element)), HalfSpace().reduce(body((10, 8)))
    order = np.lexsort(np.round(system.points[:, :2].T, 9)), np.lexsort(np.round(plain.points[:, :2].T, 9))
    load = random_load(plain)
    other = np.empty_like(load)
    other[order[0]] = load[order[1]]
    size = np.abs(plain.apply(load)).max(axis=0)
    assert (np.abs(system.apply(other)[order[0]] - plain.apply(load)[order[1]]) / size).max() < 1e-12


@pytest.mark.parametrize("density", ["trigonometric", "bilinear", "constant"])
def test_response_to_wave_on_periodic_surface(density):
    """The response to a wave is Y(q)/|q| for every direction."""
    divisions, width = (15, 11), (1.0, 0.8)
    system = HalfSpace(density, periodic=True, matrix_up_to=0).reduce(body(divisions, width))
    spacing = np.array(width) / divisions
    period = spacing * (np.array(divisions) + 1)
    power = {"trigonometric": 0, "constant": 1, "bilinear": 2}[density]
    for waves in ((1, 0), (0, -2), (3, 2), (-2, 5)):
        q = 2.0 * np.pi * np.array(waves) / period
        k = np.linalg.norm(q)
        factors = FieldScaling.of(STIFFNESS).factors
        y = scaled_compliance(STIFFNESS, np.eye(3), np.array([np.arctan2(q[1], q[0])]))[0] * np.outer(factors, factors)
        wave = np.exp(1j * system.points[:, :2] @ q)
        window = np.prod(np.sinc(q * spacing / (2.0 * np.pi)) ** power)
        exact = np.real(np.outer(wave, y @ AMPLITUDE)) * window / k * POTENTIALS
        computed = system.apply(np.outer(wave.real, AMPLITUDE))
        assert (np.abs(computed - exact).max(axis=0) / np.abs(exact).max(axis=0)).max() < 1e-11
    np.testing.assert_allclose(system.weights.sum(), np.prod(period))


def test_mean_load_responds_like_wave_of_period_length():
    system = HalfSpace("trigonometric", periodic=True, matrix_up_to=0).reduce(body((15, 11), (1.5, 1.1)))
    factors = FieldScaling.of(STIFFNESS).factors
    angles = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    y = scaled_compliance(STIFFNESS, np.eye(3), angles).mean(axis=0) * np.outer(factors, factors)
    length = np.sqrt(1.6 * 1.2) / (2.0 * np.pi)
    uniform = system.apply(np.tile(AMPLITUDE, (len(system.points), 1)))
    np.testing.assert_allclose(
        uniform, np.tile((y @ AMPLITUDE).real * length * POTENTIALS, (len(uniform), 1)), rtol=1e-9
    )


def test_large_period_approaches_free_surface():
    """The influence of the images of two opposite loads decreases with the period."""
    stiffness = library_material("batio3-cofe2o4").stiffness
    differences = []
    for n in (39, 79):
        given = body((n, n), (n / 40.0, n / 40.0), stiffness=stiffness)
        free, periodic = (HalfSpace("bilinear", p, 0).reduce(given) for p in (False, True))
        x, y, _ = free.points.T
        load = np.zeros((len(x), 5))
        load[:, 2] = -x * np.exp(-(x**2 + y**2) / 0.02)
        one, other = (system.apply(load)[:, 2] for system in (free, periodic))
        inside = np.hypot(x, y) < 0.4
        differences.append(np.abs(one - other)[inside].max() / np.abs(one).max())
    assert differences[1] < 0.3 * differences[0] < 0.1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (replace(body((4, 4)), mesh=block_mesh(1.0, 1.0, 0.5, 4, 1, 1, Quad4())), "finite body"),
        (body((4, 4), element=Quad8()), "do not form a full grid"),
        (replace(body((4, 4)), conditions=(BoundaryCondition("top", 3, "value"),)), "electric_potential"),
        (replace(body((4, 4)), conditions=(BoundaryCondition("top", 2, "flux", 1.0),)), "zero fluxes"),
        (replace(body((4, 4)), contact_group=None), "no contact zone"),
    ],
)
def test_unsupported_bodies_are_rejected(given, message):
    with pytest.raises((CaseError, MeshError), match=message):
        HalfSpace().check(given)


def test_uneven_spacing_is_rejected():
    given = body((4, 4))
    points = given.mesh.points.copy()
    points[np.isclose(points[:, 0], 0.25), 0] += 0.01
    with pytest.raises(MeshError, match="equally spaced"):
        HalfSpace().check(replace(given, mesh=replace(given.mesh, points=points)))


def test_rotated_zones_are_rejected():
    """A rotated zone has a single node on each extreme line along an axis."""
    given = body((4, 4))
    points = given.mesh.points @ rotation_about((0.0, 0.0, 1.0), 0.5).T
    with pytest.raises(MeshError, match=r"its 25 nodes do not form a full grid: .* allowed: .* edges along its axes"):
        HalfSpace().check(replace(given, mesh=replace(given.mesh, points=points)))


def test_curved_or_inverted_zones_are_rejected():
    given = body((4, 4))
    points = given.mesh.points.copy()
    points[np.isclose(points[:, 0], 0.25), 2] += 1e-4
    with pytest.raises(MeshError, match=r"0\.0001 m deep"):
        HalfSpace().check(replace(given, mesh=replace(given.mesh, points=points)))
    (block,) = given.mesh.blocks
    connectivity = block.connectivity.copy()
    connectivity[3] = connectivity[3, ::-1]
    with pytest.raises(MeshError, match="some elements are degenerate"):
        HalfSpace().check(replace(given, mesh=replace(given.mesh, blocks=(replace(block, connectivity=connectivity),))))


@pytest.mark.parametrize(
    "wrong",
    [
        {"density": "linear"},
        {"density": "trigonometric"},
        {"matrix_up_to": -1},
        {"matrix_up_to": 1.5},
        {"periodic": "no"},
        {"periodic": 1},
    ],
)
def test_keys_out_of_bounds_are_rejected(wrong):
    with pytest.raises(CaseError, match=next(iter(wrong))):
        HalfSpace(**wrong)
